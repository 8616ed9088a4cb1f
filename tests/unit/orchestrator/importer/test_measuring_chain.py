"""The measuring chain coupled to bodies: samples at their edges, impacts at their times, exciters that pull back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from support.coupled_parts import VERSIONS, body, link, part

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.core import Oscillator, motion
from vibroimpact.fmus.core.measuring import LoadCell, digitised, gaussian, sensor_reading
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, Exchange

Array = NDArray[np.float64]
UPPER, RESTITUTION = 1, 1
NATURAL = 60.0


def shipped(name: str, component: str, version: str = "3.0", **parameters: float) -> ComponentSpec:
    return part(name, fmu_path(component, version), **parameters)


def mass(version: str = "3.0", **more: float) -> ComponentSpec:
    return body("body", {"mass": 1.0, "stiffness": NATURAL**2, **more}, version)


def joined(*pairs: str) -> list[ConnectionSpec]:
    return [link(*pair.split(" > ")) for pair in pairs]


def watched(
    parts: Sequence[ComponentSpec],
    connections: Sequence[ConnectionSpec],
    end: float,
    outputs: Mapping[str, str],
    *,
    macro_step: float,
    exchange: Exchange = "gauss_seidel",
) -> dict[str, Array]:
    """Return the time and outputs, `name: component.variable`, at the start of each step and at the end."""
    importer = Importer(parts, connections, macro_step=macro_step, exchange=exchange)
    groups = []
    for text in outputs.values():
        owner, variable = text.split(".", 1)
        kind = "Int64" if variable == "sample" else "Float64"
        groups.append(importer.components[owner].group(kind, [variable]))
    rows: list[list[float]] = []

    def look(time: float, _: float = 0.0) -> None:
        rows.append([time, *(float(group.get()[0]) for group in groups)])

    importer.watchers.append(StepWatcher(look, lambda *_: None))
    try:
        importer.begin()
        importer.advance(end)
        look(end)
    finally:
        importer.free()
    return dict(zip(("time", *outputs), np.array(rows).T, strict=True))


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("macro_step", [7e-4, 2.3e-3])
def test_an_analog_input_samples_a_moving_body_at_its_own_edges(version: str, macro_step: float) -> None:
    start, rms, rate, skew, clock_error = 2e-3, 0.01, 997.0, 3.3e-4, 120.0
    parts = [
        mass(version, displacement_start=start),
        shipped("sensor", "Sensor", version, gain=1500.0, offset=0.2, range=3.0),
        shipped("noise", "Noise", version, rms=rms, rate=rate, seed=9, channel=4),
        shipped("input", "AnalogInput", version, **{
            "rate": rate, "skew": skew, "clock_error": clock_error, "bits": 14, "range": 5.0,
        }),
    ]  # fmt: skip
    wires = joined(
        "body.displacement > sensor.input", "sensor.output > noise.input", "noise.output > input.input"
    )
    outputs = {"volts": "input.output", "sample": "input.sample"}
    found = watched(parts, wires, 0.05, outputs, macro_step=macro_step)
    taken = np.unique(found["sample"], return_index=True)
    chosen = taken[1][taken[0] >= 0]
    edges = np.arange(len(chosen)) / (rate * (1.0 + 1e-6 * clock_error)) + skew
    assert len(chosen) == 50
    np.testing.assert_allclose(found["time"][chosen], edges, rtol=0.0, atol=1e-15)
    volts = sensor_reading(start * np.cos(NATURAL * edges), 1500.0, 0.2, 3.0)
    numbers = gaussian(9, 4, 0, 60)[np.floor(edges * rate + 1e-4).astype(int)]
    analog = volts + rms * numbers
    step = 10.0 / 2**14
    # rounding of the motion may move a voltage over the middle between two levels
    assert np.abs(found["volts"][chosen] - analog).max() <= 0.5 * step + 1e-12
    assert np.count_nonzero(found["volts"][chosen] != digitised(analog, 5.0, 14)) <= 1


CELL = {
    "sensitivity": 0.01,
    "natural_frequency": 700.0,
    "damping_ratio": 0.03,
    "contact_duration": 2e-3,
}


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("macro_step", [1e-3, 2.7e-3])
def test_a_load_cell_shows_each_impact_of_a_body_at_its_time(version: str, macro_step: float) -> None:
    stop = {"law": RESTITUTION, "position": 0.5e-3, "side": UPPER, "restitution": 0.8}
    own = {f"contact[1].{name}": value for name, value in stop.items()}
    parts = [mass(version, velocity_start=0.3, **own), shipped("cell", "LoadCell", version, **CELL)]
    wires = joined(
        "body.contact[1].force > cell.force",
        "body.contact[1].total_impulse > cell.impulse",
        "body.contact[1].last_time > cell.impact_time",
    )
    outputs = {"volts": "cell.output", "total": "body.contact[1].total_impulse"}
    found = watched(parts, wires, 0.3, outputs, macro_step=macro_step)
    hits, impulses = free_impacts(0.3, 0.5e-3, 0.8, 0.3)
    assert len(hits) == 6
    np.testing.assert_allclose(found["total"][-1], impulses.sum(), rtol=1e-12)
    expected = LoadCell(**CELL).follow(found["time"], np.zeros_like(found["time"]), hits, impulses)
    np.testing.assert_allclose(found["volts"], expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


def free_impacts(speed: float, position: float, restitution: float, end: float) -> tuple[Array, Array]:
    """Return times and impulses of a mass of 1 kg released at 0 towards a stop, by its sine between impacts."""
    first = math.asin(position * NATURAL / speed) / NATURAL
    approach = math.sqrt(speed**2 - (NATURAL * position) ** 2)
    times, impulses = [first], [(1.0 + restitution) * approach]
    while True:
        rebound = restitution * approach
        # a whole turn, less the arc beyond the stop
        flight = 2.0 * (math.pi - math.atan2(rebound, NATURAL * position)) / NATURAL
        if times[-1] + flight > end:
            return np.array(times), np.array(impulses)
        approach = rebound
        times.append(times[-1] + flight)
        impulses.append((1.0 + restitution) * approach)


@pytest.mark.parametrize(("exchange", "order"), [("gauss_seidel", 1.0), ("iterated", 2.0)])
def test_an_exciter_that_pulls_less_at_a_distance_is_that_of_another_solver(
    exchange: Exchange, order: float
) -> None:
    gain, offset, distance, frequency = 3.0, 1.0, 3e-3, 90.0
    reference = solve_ivp(
        lambda t, y: [
            y[1],
            (gain * 2.0 * math.cos(frequency * t) + offset) / (1.0 + y[0] / distance) ** 2 - NATURAL**2 * y[0],
        ],
        (0.0, 0.2), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-14,
    ).y[0, -1]  # fmt: skip
    errors = []
    for macro_step in (4e-4, 2e-4, 1e-4):
        parts = [
            body("generator", {"mass": 1.0, "stiffness": frequency**2, "displacement_start": 2.0}),
            shipped("exciter", "Exciter", "3.0", gain=gain, offset=offset, distance=distance),
            mass("3.0"),
        ]
        wires = joined(
            "generator.displacement > exciter.input",
            "body.displacement > exciter.displacement",
            "exciter.force > body.force",
        )
        found = watched(
            parts, wires, 0.2, {"x": "body.displacement"}, macro_step=macro_step, exchange=exchange
        )
        errors.append(abs(found["x"][-1] - reference))
    assert errors[-1] < (2e-5 if order == 1.0 else 1e-7)
    for coarse, fine in pairwise(errors):
        assert coarse / fine == pytest.approx(2.0**order, rel=0.3)


def test_a_body_that_touches_its_exciter_ends_the_run_with_a_reason() -> None:
    parts = [
        mass("3.0", displacement_start=-0.9e-3, velocity_start=-0.1),
        shipped("exciter", "Exciter", "3.0", distance=1e-3),
    ]
    with pytest.raises(ComponentError, match="displacement: expected a body that does not touch the exciter"):
        watched(
            parts,
            joined("body.displacement > exciter.displacement"),
            0.1,
            {"x": "body.displacement"},
            macro_step=1e-3,
        )


def test_a_summed_chatter_is_in_the_total_impulse_at_once() -> None:
    # a ball that falls on a stop until it rests: the stop's impulse is weight times time, less what it holds at the
    # end
    oscillator = {"mass": 2.0, "stiffness": 0.0, "forcing.amplitude": -2.0 * 9.81, "displacement_start": 0.1}
    stop = {"law": RESTITUTION, "position": 0.0, "side": 2, "restitution": 0.5}
    parts = [body("body", oscillator | {f"contact[1].{name}": value for name, value in stop.items()})]
    outputs = {"total": "body.contact[1].total_impulse", "start": "body.contact[1].stick_start"}
    found = watched(parts, [], 1.0, outputs, macro_step=0.01)
    rest = found["start"][-1]
    assert rest == pytest.approx(3.0 * math.sqrt(0.2 / 9.81), rel=1e-9)
    assert found["total"][-1] == pytest.approx(2.0 * 9.81 * rest, rel=1e-9)


def test_the_generator_of_a_voltage_is_an_undamped_oscillator() -> None:
    x, _ = motion(Oscillator(stiffness=(2.0 * math.pi * 20.0) ** 2), (4.0, 0.0), [0.5])
    assert x[0] == pytest.approx(4.0, rel=1e-12)
