"""FMUs with restricted steps, and FMUs with clocks: the right values, or a refusal that names the reason.

Some components declare one step size (`canHandleVariableCommunicationStepSize = false`) or an own grid
(`fixedInternalStepSize`). They silently give wrong values for every other step. Rates, contacts, events, impacts and
clocks beside them would cut their steps: values are then held or interpolated, and the run says so. Input clocks have
any interval and shift.
"""

from __future__ import annotations

import json
import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from support import fmu_factory

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import Scene

CASES, SAMPLE = 4000, 4
SECONDS = 60.0

EXACT, GRID, ONE_SIZE = 0.0, 3.0, 5.0
"""Schemes of the Mass: its exact flow, Euler steps at multiples of its inner step, and one step size."""
STIFFNESS = 4.0
EVERY_SIZE = 'canHandleVariableCommunicationStepSize="true"'
FLAGS = {
    ONE_SIZE: "canHandleVariableCommunicationStepSize = false",
    GRID: "fixedInternalStepSize = ",
}
TICK = 'intervalVariability="constant" intervalDecimal="0.2"'
LATE = 'intervalVariability="fixed"'
TIMED = ("constant", "fixed", "tunable", "changing", "countdown")
"""Variabilities that an output clock cannot have."""

Tables = dict[str, Any]
Floats = NDArray[np.float64]


def check(seed: int) -> str | None:
    """Return the fault of the run of this seed; None where its values or its refusal are right."""
    draw = random.Random(seed)
    return _clocks(draw) if draw.random() < 0.3 else _steps(draw)


def _run(tables: Tables, judge: Callable[[RunRecord], str | None], reasons: list[str]) -> str | None:
    """Run a scene; a refusal has to contain one of the given reasons."""
    try:
        runner = GeneralRunner(Scene.from_dict(tables, str(Path.cwd() / "scene.toml")))
        try:
            record = runner.run({})
        finally:
            runner.close()
    except VibroimpactError as refusal:
        problem = None if any(reason in str(refusal) for reason in reasons) else f"refused: {refusal}"
    else:
        problem = (
            judge(record) if record.outcome is Outcome.ok else f"{record.outcome.name}: {record.message}"
        )
    return None if problem is None else f"{json.dumps(tables)}: {problem}"


# ---- sizes of steps ----


def _steps(draw: random.Random) -> str | None:
    fmi = draw.choice(("2.0", "3.0"))
    scheme = draw.choice((EXACT, ONE_SIZE, ONE_SIZE, *([GRID] if fmi == "3.0" else [])))
    step = draw.choice((0.01, 0.0125, 1.0 / 300.0, 0.02, draw.uniform(0.005, 0.03)))
    macro_step = step * draw.choice((1, 1, 1, 2, 5, 1.5, 0.5))
    parameters = {"v": 1.0, "k": STIFFNESS, "scheme": scheme}
    if scheme == GRID:
        parameters["inner_step"] = step
    has_states = draw.random() < 0.6
    tables: Tables = {
        "scene": {"units": "SI"},
        "component": {"m": {"fmu": _described_mass(fmi, scheme, step, has_states), "parameters": parameters}},
        "record": {
            "recorded_time": macro_step * draw.choice((40, 64, 40.5)),
            "transient_time": macro_step * draw.choice((0, 0, 8, 3.3)),
            "rate": 1.0 / (step * draw.choice((1, 1, 1, 2, 0.5, 1.7))),
            "variables": ["m.x", "m.v"],
        },
        "execution": {"macro_step": macro_step},
    }
    reach = _cut(draw, tables, has_states)
    reasons = [] if scheme == EXACT else [FLAGS[scheme]]
    if "ball" in tables["component"]:  # the ball has a grid too
        reasons.append(f"{FLAGS[GRID]}0.001")
    if not has_states:  # a repeated step needs states
        reasons += (
            ["canGetAndSetFMU", "cannot restore", "state"] if "contact" in tables or "event" in tables else []
        )
    return _run(
        tables, lambda record: _wrong_motion(record, scheme, step, macro_step, has_states, reach), reasons
    )


def _described_mass(fmi: str, scheme: float, step: float, has_states: bool) -> str:
    """Write a Mass that declares its stepping; return the name of its file."""
    mass = fmu_factory.mass(Path.cwd(), fmi, states=has_states)
    own = {
        ONE_SIZE: EVERY_SIZE.replace("true", "false"),
        GRID: f'{EVERY_SIZE} fixedInternalStepSize="{step!r}"',
        EXACT: EVERY_SIZE,
    }
    return fmu_factory.redescribed(mass, Path.cwd() / "described.fmu", (EVERY_SIZE, own[scheme])).name


def _cut(draw: random.Random, tables: Tables, has_states: bool) -> float:
    """Add something that may cut the steps of the mass; return its largest free displacement, m."""
    components = tables["component"]
    match draw.randrange(7):
        case 0:
            components["ball"] = {"fmu": fmu_factory.stepped_ball(Path.cwd()).name}
        case 1:
            parameters: Tables = {"velocity_start": 1.0, "contact[1].law": "restitution"}
            parameters |= {"contact[1].position": 0.1, "contact[1].restitution": 0.8}
            components["own"] = {"fmu": "Oscillator", "parameters": parameters}
        case 2:
            components["c"] = {
                "fmu": fmu_factory.clocked(Path.cwd()).name,
                "parameters": {"interval": draw.choice((0.25, 0.1)), "shift": draw.choice((0.0, 0.125))},
            }
        case 3:
            tables["event"] = [{"watch": draw.choice(("m.x", "m.v")), "direction": "either", "level": 0.11}]
        case 4:
            position = draw.choice((0.2, 0.4))
            components["s"] = {
                "fmu": "ImpactStop",
                "parameters": {"law": "kelvin_voigt", "stiffness": 500.0, "position": position},
            }
            given = {} if has_states and draw.random() < 0.5 else {"mass": 1.0}
            contact = {"body": "m", "displacement": "x", "velocity": "v", "force": "f", "stop": "s"}
            tables["contact"] = [contact | given]
            return position
        case 5:
            components["y"] = {"fmu": "Oscillator", "parameters": {"velocity_start": 1.0}}
            tables["connection"] = [
                {"from": "m.x", "to": "y.force", "gain": 2.0, "gain_unit": "N/m"},
            ]
            tables["execution"]["exchange"] = draw.choice(("jacobi", "gauss_seidel"))
        case _:
            pass
    return math.inf


def _wrong_motion(
    record: RunRecord, scheme: float, step: float, macro_step: float, has_states: bool, reach: float
) -> str | None:
    """Return the error of samples against the motion of the undriven mass; in a contact, the error of its energy."""
    assert record.samples is not None
    time, x, v = record.samples.T
    if reach < 0.5:
        energy = 0.5 * v**2 + 0.5 * STIFFNESS * x**2 + 250.0 * (x - reach).clip(0.0) ** 2
        off = np.abs(energy - 0.5)
        # each step of a contact holds its force constant, and ends with the right energy. Bodies without states arrive
        # late, and their samples between steps are interpolated
        inside = x > reach - macro_step
        allowed = np.where(inside, 0.02, 1e-6) if has_states else np.full(len(x), 0.2)
        return None if (off <= allowed).all() else f"energy off by {float(off.max()):.2g} of .5"
    is_held, is_interpolated = "stepped on this grid" in record.message, "interpolated" in record.message
    reached = macro_step * np.floor(time / macro_step + 1e-6) if is_held else time
    exact = np.array([0.5 * np.sin(2.0 * reached), np.cos(2.0 * reached)])
    expected = _euler(time, step) if scheme == GRID else exact
    worst = float(np.abs(np.array([x, v]) - expected).max(initial=0.0))
    # a sample inside a step of a body without states is interpolated
    allowed = 1e-9 + STIFFNESS * (2.0 * macro_step) ** 2 if is_interpolated else 1e-9
    if scheme == GRID and not has_states:
        allowed += 2.0 * STIFFNESS * (step + macro_step)
    return None if worst <= allowed else f"motion off by {worst:.2g}, allowed {allowed:.2g}"


def _euler(time: Floats, step: float) -> Floats:
    """Return displacement and velocity of symplectic Euler steps at multiples of a step."""
    counts = np.floor(time / step + 1e-6).astype(int)
    states = np.empty((int(counts.max(initial=0)) + 1, 2))
    x, v = 0.0, 1.0
    for k in range(len(states)):
        states[k] = x, v
        v -= step * STIFFNESS * x
        x += step * v
    chosen: Floats = states[counts].T
    return chosen


# ---- clocks ----


def _clocks(draw: random.Random) -> str | None:
    interval, shift = draw.choice((0.25, 0.1, draw.uniform(0.01, 0.7))), draw.choice((0.0, 0.125, 0.3))
    tick = draw.choice((0.2, 0.125, round(draw.uniform(0.02, 0.6), 3)))
    tick_shift = draw.choice((0.0, 0.0, 0.05))
    own = f'intervalVariability="constant" intervalDecimal="{tick!r}" shiftDecimal="{tick_shift!r}"'
    replacements, reasons = [(TICK, own)], list[str]()
    match draw.randrange(6):
        case 0:
            replacements.append((LATE, 'intervalVariability="tunable"'))
        case 1:
            old = 'causality="input" variability="discrete" '
            new = f'causality="output" variability="discrete" intervalVariability="{draw.choice(TIMED)}"'
            replacements[0] = (old + TICK, new)
            reasons = ["output clock tick"]
        case 2:
            interval = draw.choice((0.0, -0.5))
            reasons = ["clock late"]
        case _:
            pass
    fmu = fmu_factory.redescribed(
        fmu_factory.clocked(Path.cwd()), Path.cwd() / "described.fmu", *replacements
    )
    tables: Tables = {
        "scene": {"units": "SI"},
        "component": {"c": {"fmu": fmu.name, "parameters": {"interval": interval, "shift": shift}}},
        "record": {
            "recorded_time": draw.uniform(0.5, 2.0),
            "transient_time": draw.choice((0.0, draw.uniform(0.0, 1.0))),
            "rate": draw.uniform(20.0, 300.0),
            "variables": ["c.y", "c.ticks", "c.late_ticks", "c.sum"],
        },
        "execution": {"macro_step": draw.uniform(0.01, 1.0)},
    }
    if draw.random() < 0.5:
        tables["component"]["y"] = {"fmu": fmu_factory.faulty(Path.cwd(), draw.choice(("2.0", "3.0"))).name}
        tables["connection"] = [{"from": "y.y", "to": "c.u"}]
        tables["execution"]["exchange"] = draw.choice(("jacobi", "gauss_seidel", "iterated"))

    def judge(record: RunRecord) -> str | None:
        if reasons:
            return f"expected a refusal with {reasons}"
        return _wrong_ticks(record, (tick, tick_shift), (interval, shift), "y" in tables["component"])

    return _run(tables, judge, reasons)


def _wrong_ticks(
    record: RunRecord, tick: tuple[float, float], late: tuple[float, float], is_fed: bool
) -> str | None:
    """Return the fault of the ticks of both clocks (each an interval and a shift) or of their counts."""
    assert record.samples is not None
    time, y, ticks, late_ticks, total = record.samples.T
    apart = np.full(len(time), np.inf)
    expected_total = np.zeros(len(time))
    for name, counted, (interval, shift) in (("tick", ticks, tick), ("late", late_ticks, late)):
        instants = shift + interval * np.arange(int(time[-1] / interval) + 2)
        expected = (instants[None] < time[:, None]).sum(axis=1)
        apart = np.minimum(apart, np.abs(instants[None] - time[:, None]).min(axis=1))
        clear = (
            np.abs(instants[None] - time[:, None]).min(axis=1) > 1e-9
        )  # a sample at a tick may come before or after it
        if (counted[clear] != expected[clear]).any():
            return f"{name}: {counted[clear].tolist()} ticks for {expected[clear].tolist()}"
        expected_total += (time[:, None] - instants[None]).clip(0.0).sum(axis=1)
    if not np.allclose(total, expected_total, rtol=0.0, atol=1e-8):
        return f"sum off by {float(np.abs(total - expected_total).max()):.2g}"
    last = tick[1] + tick[0] * (ticks - 1.0)
    expected_y = np.where(ticks > 0, 10.0 * ticks + (last if is_fed else 0.0), 0.0)
    clear = apart > 1e-9
    if not np.allclose(y[clear], expected_y[clear], rtol=0.0, atol=1e-9):
        return f"y off by {float(np.abs(y - expected_y)[clear].max()):.2g}"
    return None
