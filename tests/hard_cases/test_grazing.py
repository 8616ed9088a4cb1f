"""No impact is lost at a graze: the peak of a steady motion exceeds the stop by ever less, from eight phases."""

import math

import pytest
from support.component_fmu import VERSIONS, OscillatorFmu, forced, simulate, stop
from support.tolerance import SEQUENCE

from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import parse_scene

ZETA, W = 0.05, 0.8
SIZE = math.hypot(1.0 - W * W, 2.0 * ZETA * W)
LAG = math.atan2(2.0 * ZETA * W, 1.0 - W * W)
LEVELS = [10.0**-n for n in (2, 3, 4, 5, 6, 7, 8, 9, 10)]
PHASES = [2.0 * math.pi * i / 8 for i in range(8)]
PERIOD = 2.0 * math.pi / W


def steady(excess: float, phase: float) -> dict[str, float]:
    """Return parameters of a steady motion of amplitude 1 + excess that starts at a forcing phase."""
    amplitude = 1.0 + excess
    return {
        **forced(amplitude * SIZE, W, ZETA),
        "forcing.phase": phase,
        "displacement_start": min(1.0, amplitude * math.cos(phase - LAG)),
        "velocity_start": -W * amplitude * math.sin(phase - LAG),
    }


@pytest.mark.parametrize("excess", LEVELS)
def test_a_peak_over_the_stop_is_an_impact_in_a_scene_from_every_phase(excess: float) -> None:
    found = 0
    for phase in PHASES:
        p = steady(excess, phase)
        scene = parse_scene(
            f"""
            [scene]
            units = "nondimensional"
            [body]
            mass = 1.0
            stiffness = 1.0
            damping = {p["damping"]!r}
            displacement_start = {p["displacement_start"]!r}
            velocity_start = {p["velocity_start"]!r}
            [forcing]
            amplitude = {p["forcing.amplitude"]!r}
            angular_frequency = {W!r}
            phase = {phase!r}
            [[stop]]
            position = 1.0
            restitution = 0.7
            [record]
            recorded_periods = 2
            """,
            "graze.toml",
        )
        runner = PointRunner(scene)
        try:
            record = runner.run({})
        finally:
            runner.close()
        # the part of a period before the first forcing phase 0 is not recorded: all runs have the second peak
        assert record.impacts is not None
        found += len(record.impacts) > 0
    assert found == 8


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("interval", [20.0, 0.7, 0.01])
def test_a_peak_over_the_stop_is_an_impact_in_a_stock_importer_from_every_phase(
    version: str, interval: float
) -> None:
    lost = []
    for excess in LEVELS:
        for phase in PHASES:
            result = simulate(
                "Oscillator",
                {**steady(excess, phase), **stop(1.0)},
                ["contact[1].count", "displacement"],
                math.ceil(PERIOD / interval) * interval,
                interval,
                version=version,
                validate=False,
            )
            if result["contact[1].count"][-1] < 1 or result["displacement"].max() > 1.0:
                lost.append((excess, phase))
    assert lost == []


@pytest.mark.parametrize("excess", LEVELS)
def test_the_velocity_of_a_graze_is_the_root_of_its_excess(excess: float) -> None:
    # V^2 = 2 |A| excess at a parabolic peak, A = W^2; relative corrections of the order of the excess
    with OscillatorFmu({**steady(excess, math.pi + LAG), **stop(1.0)}) as o:
        o.step(0.75 * PERIOD)
        count, velocity = o.contact("count", "last_velocity")
    assert count == 1
    noise = 1e-15 / excess  # the amplitude itself is a double
    assert abs(velocity / math.sqrt(2.0 * excess * W * W) - 1.0) <= excess + noise


@pytest.mark.parametrize("excess", [-(10.0**-n) for n in (2, 4, 6, 8, 10)])
def test_a_peak_below_the_stop_is_no_impact(excess: float) -> None:
    for phase in PHASES:
        with OscillatorFmu({**steady(excess, phase), **stop(1.0)}) as o:
            o.step(50 * PERIOD)
            assert o.contact("count", "graze_count") == [0, 0]


def test_a_touch_at_rest_neither_stops_nor_drives_an_undamped_mass() -> None:
    # the amplitude equals the stop's distance: a touch in every period, V = 0 up to rounding
    for start in ({"displacement_start": 1.0}, {"displacement_start": -1.0}, {"velocity_start": 1.0}):
        with OscillatorFmu({**start, **stop(1.0, 0.3)}) as o:
            o.step(200 * 2.0 * math.pi)
            energy = o.get("energy.kinetic") + o.get("energy.potential")
            assert abs(energy - 0.5) <= SEQUENCE
            assert not o.contact("stuck")[0]
