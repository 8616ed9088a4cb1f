"""Any signals of time on any Structure: energies balance, steps may be cut anywhere, and no body is beyond a stop."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.component_fmu import HERTZ, KELVIN_VOIGT, LOWER, RESTITUTION, UPPER, ComponentFmu, stop
from support.modal_fmu import structure_fmu

from vibroimpact.fmus.core.signals import SignalKind

Numbers = dict[str, Any]
BALANCE = {"kinetic": 1, "potential": 1, "forcing_work": -1, "damping_loss": 1, "contact_loss": 1}
#: Impacts after which chaos may have multiplied rounding by 1e7.
MOST_IMPACTS = 15


def log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return float(10.0 ** random.uniform(low, high))


def signal_of(random: np.random.Generator, rows: list[tuple[float, float]]) -> Numbers:
    """Return a signal of any kind; the rows of its table are added to the others."""
    kind, duration = SignalKind(int(random.integers(1, 9))), log_uniform(random, -2.0, 1.0)
    low, high = log_uniform(random, -1.0, 1.5), log_uniform(random, -1.0, 2.0)
    signal = {
        **{
            "kind": int(kind),
            "amplitude": log_uniform(random, -1.0, 1.0),
            "start": random.uniform(-1.0, 3.0),
        },
        **{"duration": duration, "rise": duration * random.choice([0.0, 0.3, 0.5])},
        **{"angular_frequency": low, "end_angular_frequency": high, "phase": random.uniform(-4.0, 4.0)},
    }
    if kind is SignalKind.random:
        signal |= {"angular_frequency": 0.3 * high, "seed": int(random.integers(2**31)), "duration": 0.0}
    if kind in {SignalKind.table, SignalKind.table_cubic}:
        count = int(random.integers(2, 20))
        signal |= {"table_start": len(rows) + 1, "table_count": count}
        times = np.cumsum(10.0 ** random.uniform(-2.0, 0.5, count))
        rows += zip(times.tolist(), random.normal(size=count).tolist(), strict=True)
    return signal


def scene_of(random: np.random.Generator) -> tuple[Numbers, Numbers]:
    """Return arrays and parameters of a Structure with two stops at one point."""
    modes, count = int(random.choice([1, 1, 2, 4])), int(random.integers(1, 4))
    natural = np.sort(10.0 ** random.uniform(-1.0, 1.5, modes))
    natural[0] *= random.random() > 0.2
    rows: list[tuple[float, float]] = [(0.0, 0.0)]
    signals = [signal_of(random, rows) for _ in range(count)]
    shape = random.normal(size=modes)
    table = np.array(rows)
    arrays = {
        "mode.angular_frequency": natural,
        "mode.damping_ratio": np.where(natural > 0.0, random.choice([0.0, 0.02, 1.0, 3.0], modes), 0.0),
        **{"mode.contact_shape": [shape, shape], "mode.observed_shape": shape},
        **{"mode.forcing": random.normal(size=modes), "mode.signal": random.normal(size=(count, modes))},
        **{"table.time": table[:, 0], "table.value": table[:, 1]},
    }
    law = int(random.choice([RESTITUTION, RESTITUTION, KELVIN_VOIGT, HERTZ]))
    soft: Numbers = {} if law == RESTITUTION else {"stiffness": log_uniform(random, 1.0, 4.0)}
    clock = {
        "forcing.amplitude": random.normal(),
        "forcing.angular_frequency": log_uniform(random, -1.0, 1.0),
    }
    parameters = {
        **{f"signal[{k}].{name}": value for k, one in enumerate(signals, 1) for name, value in one.items()},
        **(clock if random.random() < 0.5 else {}),
        **stop(log_uniform(random, -1.5, 1.0), random.choice([0.0, 0.6]), law=law, side=UPPER, **soft),
        **stop(-log_uniform(random, -1.5, 1.0), random.choice([0.0, 0.6]), k=2, side=LOWER),
    }
    return arrays, parameters


def end_of(fmu: ComponentFmu, cuts: NDArray[np.float64]) -> NDArray[np.float64]:
    for step in cuts:
        fmu.step(float(step))
    return np.array(fmu.state())


@settings(max_examples=25)
@given(st.integers(0, 2**32 - 1))
def test_any_signals_balance_their_energy_and_take_any_cut_of_steps(seed: int) -> None:
    random = np.random.default_rng(seed)
    (arrays, parameters), end = scene_of(random), log_uniform(random, -1.0, 0.8)
    cuts = np.diff([0.0, *np.sort(random.uniform(0.0, end, 4)), end])
    with (
        structure_fmu(arrays, {**parameters, "record.energies": True}) as one,
        structure_fmu(arrays, {**parameters, "record.extrema": True}) as other,
    ):
        state, again = end_of(one, np.array([end])), end_of(other, cuts)
        energies = [sign * one.get(f"energy.{name}") for name, sign in BALANCE.items()]
        impacts = sum(one.get(f"contact[{k}].count") for k in (1, 2))
        lowest, highest = (parameters[f"contact[{k}].position"] for k in (2, 1))
    assert abs(sum(energies)) <= 1e-9 * sum(map(abs, energies))
    assert state[0] >= lowest * (1.0 + 1e-12)
    assert state[0] <= highest * (1.0 + 1e-12) or parameters["contact[1].law"] != RESTITUTION
    if impacts < MOST_IMPACTS:
        assert np.allclose(state, again, rtol=1e-7, atol=1e-7 * (1e-3 + np.abs(state).max()))
