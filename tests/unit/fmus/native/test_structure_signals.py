"""Signals of time on the Structure FMU against quadratures, closed forms, exact steps and balances of energy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import fmpy
import mpmath
import numpy as np
import pytest
from scipy.linalg import expm
from support.component_fmu import LOWER, ComponentFmu, stop
from support.modal_fmu import structure_fmu

from vibroimpact.fmus.core.signals import Signal, SignalKind
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.structure_file import structure_file

NATURAL, RATIO = 3.0, 0.05
#: One mode on which signal 1 acts with its amplitude, and a free mass.
MODE: dict[str, Any] = {
    "mode.angular_frequency": [NATURAL],
    "mode.damping_ratio": [RATIO],
    "mode.contact_shape": [[1.0]],
    "mode.observed_shape": [1.0],
    "mode.base": [-1.0],
    "mode.signal": [[1.0]],
}
FREE: dict[str, Any] = {**MODE, "mode.angular_frequency": [0.0], "mode.damping_ratio": [0.0]}


def signal(kind: SignalKind, k: int = 1, **more: Any) -> dict[str, float]:
    return {f"signal[{k}].{name}": value for name, value in {"kind": int(kind), **more}.items()}


def energy_error(fmu: ComponentFmu) -> float:
    """Return the energy that the balance misses, relative to the work of the forces."""
    terms = [("kinetic", 1), ("potential", 1), ("forcing_work", -1), ("damping_loss", 1), ("contact_loss", 1)]
    sizes = [sign * fmu.get(f"energy.{name}") for name, sign in terms]
    return float(abs(sum(sizes)) / sum(map(abs, sizes)))


@pytest.mark.parametrize("kind", [SignalKind.chirp_linear, SignalKind.chirp_logarithmic])
def test_a_chirp_moves_a_mode_as_a_quadrature_of_thirty_digits(kind: SignalKind) -> None:
    start, duration, first, last = 0.5, 4.0, 1.0, 20.0
    band: dict[str, Any] = {"angular_frequency": first, "end_angular_frequency": last}
    chirp = signal(kind, amplitude=2.0, start=start, duration=duration, phase=0.25, **band)
    with structure_fmu(MODE, {**chirp, "record.energies": True}) as fmu:
        for step in (0.25, 2.0, 4.25):
            fmu.step(step)
        (displacement, velocity), error = fmu.state(), energy_error(fmu)
    with mpmath.workdps(30):
        damped, rate = NATURAL * mpmath.sqrt(1 - mpmath.mpf(RATIO) ** 2), mpmath.mpf(RATIO) * NATURAL

        def phase(s: Any) -> Any:
            if kind is SignalKind.chirp_linear:
                return s + 19 * s**2 / 8
            growth = mpmath.log(20) / 4
            return mpmath.expm1(growth * s) / growth

        def response(s: Any) -> tuple[Any, Any]:
            left, load = 6.0 - s, 2 * mpmath.cos(mpmath.mpf(0.25) + phase(s))
            decay, sine = mpmath.exp(-rate * left), mpmath.sin(damped * left)
            rise = decay * sine / damped
            return load * rise, load * (decay * mpmath.cos(damped * left) - rate * rise)

        places = mpmath.linspace(0, 4, 9)
        exact = [mpmath.quad(lambda s, i=i: response(s)[i], places) for i in range(2)]
        assert abs(displacement - exact[0]) < 1e-14
        assert abs(velocity - exact[1]) < 1e-13
    assert error < 1e-13


@pytest.mark.parametrize(
    ("kind", "rise", "area"),
    [
        (SignalKind.half_sine, 0.0, 2.0 / math.pi),
        (SignalKind.triangle, 0.0, 0.5),
        (SignalKind.trapezoid, 0.1, 0.9),
        (SignalKind.trapezoid, 0.0, 1.0),
    ],
    ids=["half sine", "triangle", "trapezoid", "rectangle"],
)
@pytest.mark.parametrize("steps", [1, 7])
def test_a_pulse_throws_a_mass_at_a_stop_as_its_area_says(
    kind: SignalKind, rise: float, area: float, steps: int
) -> None:
    start, duration, amplitude, place = 0.2, 0.37, 3.0, 2.0
    pulse = signal(kind, amplitude=amplitude, start=start, duration=duration, rise=rise * duration)
    with structure_fmu(FREE, {**pulse, **stop(place, 1.0), "record.energies": True}) as fmu:
        for _ in range(steps):
            fmu.step(10.0 / steps)
        (displacement, velocity), error = fmu.state(), energy_error(fmu)
        assert fmu.get("contact[1].count") == 1
    speed = amplitude * duration * area
    meets = start + 0.5 * duration + place / speed
    assert velocity == pytest.approx(-speed, rel=1e-13)
    assert displacement == pytest.approx(place - speed * (10.0 - meets), rel=1e-13)
    assert error < 1e-13


def exact_steps(pieces: Any, end: float) -> np.ndarray:
    """Return the state at `end` from exact steps over the pieces of a signal, by matrix exponentials."""
    state = np.zeros(2)
    for start, length, coefficient in zip(*pieces, strict=True):
        matrix = np.zeros((6, 6))
        matrix[0, 1] = matrix[1, 2] = matrix[2, 3] = matrix[3, 4] = matrix[4, 5] = 1.0
        matrix[1, :2] = [-(NATURAL**2), -2.0 * RATIO * NATURAL]
        loads = coefficient[:4] * [1.0, 1.0, 2.0, 6.0]
        state = (expm(matrix * min(length, end - start.sum())) @ [*state, *loads])[:2]
    return state


def test_a_random_force_moves_a_mode_as_exact_steps_over_its_pieces() -> None:
    force = signal(SignalKind.random, amplitude=2.0, end_angular_frequency=30.0, seed=11)
    with structure_fmu(MODE, {**force, "record.energies": True}) as fmu:
        for _ in range(3):
            fmu.step(4.0)
        state, error = fmu.state(), energy_error(fmu)
    pieces = Signal(SignalKind.random, end_angular_frequency=30.0, seed=11).pieces(0.0, 12.0)
    pieces = pieces._replace(coefficient=2.0 * pieces.coefficient)
    assert np.allclose(state, exact_steps(pieces, 12.0), rtol=1e-12, atol=1e-13)
    assert error < 1e-12


@pytest.mark.parametrize("seed", range(4))
def test_flights_over_many_intervals_meet_what_single_segments_meet(seed: int) -> None:
    force = signal(SignalKind.random, amplitude=2.0, end_angular_frequency=100.0, seed=seed)
    place = 0.04 * (seed + 1)
    scene = {**force, **stop(place, 0.7), **stop(-2.0 * place, 0.6, k=2, side=LOWER)}
    arrays = {
        "mode.angular_frequency": [2.0, NATURAL],
        "mode.damping_ratio": [0.0, RATIO],
        "mode.contact_shape": [[0.5, 1.0]] * 2,
        "mode.observed_shape": [0.5, 1.0],
        "mode.signal": [[0.3, 1.0]],
    }
    with (
        structure_fmu(arrays, {**scene, "record.energies": True, "record.extrema": True}) as single,
        structure_fmu(arrays, {**scene, "record.extrema": True}) as many,
        structure_fmu(arrays, scene) as unrecorded,
    ):
        for _ in range(8):
            for fmu in (single, many, unrecorded):
                fmu.step(1.0)
            assert many.state() == pytest.approx(single.state(), abs=1e-11)
            assert unrecorded.state() == pytest.approx(single.state(), abs=1e-11)
            for name in ("record.displacement_max", "record.displacement_min"):
                assert many.get(name) == pytest.approx(single.get(name), abs=1e-11)
        counts = [[fmu.get(f"contact[{k}].count") for k in (1, 2)] for fmu in (single, many, unrecorded)]
        assert counts[0] == counts[1] == counts[2]
        assert counts[0][0] > 0


def test_many_signals_at_once_keep_the_balance_of_energy_through_impacts() -> None:
    loads = {
        **signal(SignalKind.random, 1, amplitude=2.0, end_angular_frequency=20.0, seed=3),
        **signal(SignalKind.chirp_linear, 2, amplitude=3.0, duration=30.0, end_angular_frequency=5.0),
        **signal(SignalKind.half_sine, 4, amplitude=5.0, start=7.0, duration=0.5),
        **signal(SignalKind.table, 5, amplitude=1.0, table_start=2, table_count=3),
        **signal(SignalKind.table_cubic, 6, amplitude=1.0, start=3.0, table_start=5, table_count=4),
        "forcing.amplitude": 1.0,
        "forcing.angular_frequency": 2.0,
        "force": 0.3,
    }
    arrays = {
        **MODE,
        "mode.forcing": [1.0],
        "mode.force": [1.0],
        "mode.contact_shape": [[1.0], [1.0]],
        "mode.signal": [[1.0]] * 6,
        "table.time": [0.0, 0.0, 5.0, 25.0, -3.0, 0.0, 1.0, 9.0],
        "table.value": [9.0, 0.0, 2.0, 1.0, 0.0, 1.0, -1.0, 2.0],
    }
    stops = {**stop(0.3, 0.7), **stop(-0.4, 0.6, k=2, side=2)}
    with structure_fmu(arrays, {**loads, **stops, "record.energies": True}) as fmu:
        for _ in range(5):
            fmu.step(6.5)
        assert fmu.get("contact[1].count") > 5
        assert energy_error(fmu) < 1e-11


def test_a_signal_of_the_base_is_in_the_absolute_acceleration() -> None:
    pulse = signal(SignalKind.triangle, amplitude=4.0, duration=2.0, of_base=1.0)
    with structure_fmu({**MODE, "mode.signal": [[-1.0]]}, pulse) as fmu:
        fmu.step(0.5)
        displacement, velocity = fmu.state()
        relative = -(NATURAL**2) * displacement - 2.0 * RATIO * NATURAL * velocity - 2.0
        assert fmu.get("acceleration") == pytest.approx(relative + 2.0, abs=1e-12)


def test_an_amplitude_is_tuned_from_now_on() -> None:
    step = signal(SignalKind.trapezoid, amplitude=1.0, duration=10.0)
    with structure_fmu(FREE, step) as fmu:
        fmu.step(1.0)
        fmu.set("signal[1].amplitude", 3.0)
        fmu.step(2.0)
        assert fmu.state() == pytest.approx((0.5 + 2.0 + 6.0, 7.0), rel=1e-14)


def test_a_state_goes_to_an_instance_with_other_signals() -> None:
    force = signal(SignalKind.random, amplitude=2.0, end_angular_frequency=30.0)
    with (
        structure_fmu(MODE, {**force, "signal[1].seed": 1}) as one,
        structure_fmu(MODE, {**force, "signal[1].seed": 2}) as other,
    ):
        one.step(3.0)
        other.step(3.0)
        assert one.state() != other.state()
        other.restore(one.serialized())
        other.time = one.time
        one.step(2.0)
        other.step(2.0)
        assert one.state() == other.state()


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_an_exported_file_has_signals_and_tables(tmp_path: Path, version: str) -> None:
    rows = {"table.time": [0.0, 1.0, 2.5], "table.value": [1.0, -1.0, 2.0]}
    arrays = {**MODE, "mode.signal": [[1.0], [0.5]], **rows}
    loads = {
        **signal(SignalKind.table_cubic, amplitude=2.0, table_count=3),
        **signal(SignalKind.random, 2, amplitude=1.0, end_angular_frequency=9.0, seed=5),
    }
    content = structure_file(arrays)
    path = export_fmu(
        "Structure", tmp_path / "one.fmu", modes=1, fmi=version, starts=loads, structure=content
    )
    with structure_fmu(arrays, loads) as own, ComponentFmu(path, version=version) as exported:
        for fmu in (own, exported):
            fmu.step(4.0)
        assert own.state() == exported.state()
        assert own.state() != (0.0, 0.0)


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_model_exchange_has_the_same_signals(tmp_path: Path, version: str) -> None:
    arrays = {**MODE, "mode.signal": [[1.0], [1.0]]}
    loads = {
        **signal(SignalKind.chirp_linear, amplitude=2.0, duration=5.0, end_angular_frequency=6.0),
        **signal(SignalKind.random, 2, amplitude=1.0, end_angular_frequency=6.0, seed=5),
        **stop(0.2, 0.7),
    }
    content = structure_file(arrays)
    path = export_fmu(
        "Structure", tmp_path / "one.fmu", modes=1, fmi=version, starts=loads, structure=content,
        model_exchange=True,
    )  # fmt: skip
    ends = []
    for kind in ("ModelExchange", "CoSimulation"):
        result = fmpy.simulate_fmu(
            str(path), fmi_type=kind, stop_time=4.0, output_interval=0.1, solver="CVode",
            relative_tolerance=1e-9, output=["displacement", "contact[1].count"],
        )  # fmt: skip
        ends.append((result["displacement"][-1], result["contact[1].count"][-1]))
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)
    assert ends[0][1] > 0


@pytest.mark.parametrize(
    ("parameters", "rows", "message"),
    [
        (signal(SignalKind.half_sine), {}, "signal[1].duration: expected a finite number > 0, got 0"),
        ({"signal[3].kind": 9}, {}, "signal[3].kind: expected 0 to 8, got 9"),
        (signal(SignalKind.table, table_count=2), {}, "ascend, got 0 as number 2"),
        (
            {
                **signal(SignalKind.table_cubic, table_count=3),
                **signal(SignalKind.table_cubic, 2, table_count=2, table_start=2),
            },
            {"table.time": [0.0, 1.0, 2.0]},
            "signal[2].table_start: expected all rows of signal[1], or none of them",
        ),
        (signal(SignalKind.table, table_count=3, table_start=8191), {}, "expected rows 1 to 8192"),
        (
            signal(SignalKind.random, table_count=2, end_angular_frequency=4.0),
            {"table.time": [0.0, 3.0], "table.value": [1.0, 1.0]},
            "signal[1].table: expected a density over all the band",
        ),
        (
            signal(SignalKind.random, table_count=2),
            {"table.time": [0.0, 3.0], "table.value": [1.0, -1.0]},
            "signal[1].table: expected finite values >= 0, got -1 as number 2",
        ),
    ],
)
def test_a_bad_signal_is_refused_by_one_line(
    parameters: dict[str, float], rows: dict[str, Any], message: str
) -> None:
    messages: list[str] = []
    with pytest.raises(Exception, match="Initialization"):
        structure_fmu({**MODE, **rows}, parameters, messages=messages)
    assert any(message in line for line in messages), messages
