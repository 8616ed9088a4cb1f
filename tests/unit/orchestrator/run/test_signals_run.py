"""Runs under chirps, pulses, tables and random forces: Newton's law, closed forms, seeds, files, exports."""

from __future__ import annotations

import math
import re
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from fmpy import simulate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.run.summary import clock_remark
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.effects import effects_of

MASS, STIFFNESS, DAMPING = 4.0, 4.0, 0.4
BODY = {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING}
STOP = [{"position": 0.2, "restitution": 0.7}]
CHIRP = {"signal": "chirp", "amplitude": 1.5, "start": 1.0, "duration": 20.0, "phase": 0.4}
CHIRP |= {"angular_frequency": 0.5, "end_angular_frequency": 3.0}
PULSE = {"signal": "pulse", "amplitude": -2.0, "start": 0.5, "duration": 3.0}
TABLE = {
    "signal": "table",
    "times": [0.0, 1.0, 1.5, 4.0, 9.0],
    "values": [0.0, 1.0, -0.5, 2.0, 0.0],
    "start": 2.0,
}
BAND = {"signal": "random", "amplitude": 0.7, "band": [0.4, 6.0], "seed": 3}
SIGNALS = {
    "linear chirp": CHIRP,
    "logarithmic chirp": CHIRP | {"spacing": "logarithmic"},
    "falling chirp": CHIRP | {"angular_frequency": 3.0, "end_angular_frequency": 0.0},
    "half sine": PULSE | {"shape": "half_sine"},
    "triangle": PULSE | {"shape": "triangle"},
    "trapezoid": PULSE | {"shape": "trapezoid", "rise": 0.7},
    "rectangle": PULSE | {"shape": "trapezoid"},
    "table": TABLE,
    "spline": TABLE | {"interpolation": "cubic", "amplitude": 2.0},
}
MOTION = ["displacement", "velocity", "acceleration"]
TABLES: dict[str, Any] = {"body": BODY, "stop": STOP, "record": {"recorded_time": 30.0}}


def scene(forcing: Any, **changes: Any) -> Scene:
    return Scene.from_dict(deepcopy(TABLES) | {"forcing": forcing} | changes)


def run(forcing: Any, **changes: Any) -> xr.Dataset:
    return vi.run(scene(forcing, **changes))


def sampled(rate: float, *names: str, time: float = 30.0) -> dict[str, Any]:
    return {"recorded_time": time, "time_series": {"rate": rate, "variables": [*MOTION, *names]}}


def force_on(found: xr.Dataset) -> np.ndarray[Any, Any]:
    """Return the force on the mass in the samples of a free run, N: Newton's law."""
    x, v, a = (found[name].values for name in MOTION)
    return np.asarray(MASS * a + DAMPING * v + STIFFNESS * x)


@pytest.mark.parametrize("signal", SIGNALS.values(), ids=SIGNALS)
def test_the_acceleration_is_that_of_the_sampled_force(signal: dict[str, Any]) -> None:
    # an uneven rate keeps samples off the instants at which a rectangle jumps
    found = run(signal, stop=[], record=sampled(7.3, "forcing[1]"))
    assert np.abs(found.forcing_1.values).max() > 0.9
    assert force_on(found) == pytest.approx(found.forcing_1.values, abs=1e-12)
    assert found.attrs["engine"].startswith("fused: Structure")


def test_the_force_of_a_chain_is_shared_by_its_masses() -> None:
    chain = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0}
    pulse = SIGNALS["half sine"]
    both = run(pulse | {"amplitude": [2.0, -1.0]}, body=chain, stop=[], record={"recorded_time": 5.0})
    each = [
        run(pulse | {"amplitude": one}, body=chain, stop=[], record={"recorded_time": 5.0})
        for one in ([2.0, 0.0], [0.0, -1.0])
    ]
    total = each[0].final_state.values + each[1].final_state.values
    assert both.final_state.values == pytest.approx(total, abs=1e-13)


def test_a_half_sine_leaves_the_motion_of_its_closed_form() -> None:
    undamped = {"mass": MASS, "stiffness": STIFFNESS}
    found = run(
        PULSE | {"shape": "half_sine", "start": 0.0}, body=undamped, stop=[], record=sampled(1.0, time=3.0)
    )
    rate, time = math.pi / 3.0, 3.0
    size = -2.0 / MASS / (1.0 - rate**2)
    assert found.displacement.values[-1] == pytest.approx(
        size * (math.sin(rate * time) - rate * math.sin(time)), abs=1e-13
    )


@given(
    st.lists(st.floats(0.05, 3.0), min_size=1, max_size=30),
    st.lists(st.floats(-3.0, 3.0), min_size=31, max_size=31),
)
@settings(max_examples=10)
def test_a_table_of_straight_lines_is_the_sum_of_its_ramps(steps: list[float], values: list[float]) -> None:
    times = [0.0, *np.cumsum(steps).tolist()]
    heights = [0.0, *values[: len(steps) - 1], 0.0]
    whole = {"signal": "table", "times": times, "values": heights}
    halves = [whole | {"amplitude": 0.25}, whole | {"amplitude": 0.75}]
    one, two = (run(forces, stop=[], record={"recorded_time": 40.0}) for forces in ([whole], halves))
    slopes = np.diff(heights) / np.diff(times)
    bends = np.diff([0.0, *slopes, 0.0])
    natural, decay = math.sqrt(STIFFNESS / MASS), 0.5 * DAMPING / MASS
    turns, since = math.sqrt(natural**2 - decay**2), 40.0 - np.array(times)
    # response to a ramp of slope 1: (t - c / k) / k plus a free motion from its opposite start
    lag = DAMPING / STIFFNESS
    start, speed = lag / STIFFNESS, -1.0 / STIFFNESS
    free = np.exp(-decay * since) * (
        start * np.cos(turns * since) + (speed + decay * start) / turns * np.sin(turns * since)
    )
    expected = float(np.sum(bends * ((since - lag) / STIFFNESS + free)))
    size = np.abs(bends).sum() * 40.0
    assert one.final_displacement.item() == pytest.approx(expected, abs=1e-14 * size)
    assert two.final_displacement.item() == pytest.approx(expected, abs=1e-14 * size)


# ---- random forces ----


def test_a_random_force_has_its_standard_deviation_and_its_seed() -> None:
    found = run(BAND, stop=[], record=sampled(2.0, time=20000.0))
    force = force_on(found)
    # 20,000 s of a band of 5.6 rad/s have some 17,800 independent pairs of values
    assert force.std() == pytest.approx(0.7, rel=4.0 / math.sqrt(17800.0))
    assert abs(force.mean()) < 0.02
    again, other = (run(BAND | {"seed": seed}, stop=[], record=sampled(2.0, time=50.0)) for seed in (3, 4))
    assert force_on(again)[:100] == pytest.approx(force[:100], abs=1e-13)
    assert np.abs(force_on(other)[:100] - force[:100]).max() > 0.1


def test_realisations_are_an_axis_over_the_seeds_of_all_random_forces() -> None:
    two = [BAND | {"seed": 2}, BAND | {"seed": 5, "amplitude": 0.2}]
    axes = {f"forcing[{k}].seed": {"values": [s, s + 1], "zip": "realisation"} for k, s in ((1, 2), (2, 5))}
    named, written = (run(two, sweep=sweep) for sweep in ({"realisations": 2}, axes))
    assert named.final_displacement.values.tolist() == written.final_displacement.values.tolist()
    assert named.final_displacement.sizes == {"realisation": 2}


@pytest.mark.parametrize(
    ("forcing", "sweep", "line"),
    [
        (BAND, {"realisations": 1}, "expected a whole number from 2 to 1000000, got 1"),
        (BAND, {"realisations": 2.5}, "expected a whole number from 2 to 1000000, got 2.5"),
        ({"amplitude": 1.0, "angular_frequency": 1.0}, {"realisations": 3}, "expected a random force beside"),
        (BAND, {"realisations": 3, "forcing.seed": {"values": [1, 2]}}, "expected no axis over forcing.seed"),
    ],
)
def test_realisations_that_cannot_be_are_one_line(
    forcing: dict[str, Any], sweep: dict[str, Any], line: str
) -> None:
    with pytest.raises(SceneError, match=re.escape(f"sweep.realisations: {line}")):
        run(forcing, sweep=sweep)


def test_realisations_are_a_sweep_over_seeds() -> None:
    swept = run(BAND, sweep={"forcing.seed": {"start": 1, "stop": 3, "points": 3}})
    assert len(set(swept.final_displacement.values.tolist())) == 3
    alone = run(BAND | {"seed": 2})
    assert swept.final_displacement.values[1] == alone.final_displacement.item()
    assert swept.seed.values.tolist() == [1.0, 2.0, 3.0]


def test_a_random_force_has_no_samples() -> None:
    with pytest.raises(SceneError, match=r"record.time_series.variables\[4\]: expected a variable name"):
        scene(BAND, record=sampled(1.0, "forcing[1]"))


def test_a_density_is_a_band_of_its_variance() -> None:
    variance = 0.49
    density = [[0.4, variance / 5.6], [6.0, variance / 5.6]]
    by_density = {"signal": "random", "density": density, "seed": 3}
    one, other = (run(force, stop=[], record={"recorded_time": 20.0}) for force in (BAND, by_density))
    assert one.final_state.values == pytest.approx(other.final_state.values, abs=1e-10)


# ---- beside sines, at stops, from files ----


def test_a_signal_beside_a_sine_counts_periods_that_do_not_repeat() -> None:
    both = [{"amplitude": 1.0, "angular_frequency": 1.0}, CHIRP]
    found = run(both, record={"recorded_periods": 5})
    assert found.attrs["clock_periods"] == 0
    assert "the other signals do not repeat" in clock_remark(scene(both, record={"recorded_periods": 5}))


def test_a_pulse_throws_the_mass_against_its_stop() -> None:
    found = run(PULSE | {"shape": "half_sine", "amplitude": 3.0})
    assert found.sizes["impact"] > 1
    assert found.impact_time.values[0] > 0.5


def test_a_table_of_a_file_is_the_table(tmp_path: Path) -> None:
    rows = "".join(f"{time},{value}\n" for time, value in zip(TABLE["times"], TABLE["values"], strict=True))
    (tmp_path / "load.csv").write_text(f"time (s),force (N)\n# measured\n\n{rows}")
    by_file = {"signal": "table", "file": "load.csv", "start": 2.0}
    read = Scene.from_dict(TABLES | {"forcing": by_file}, str(tmp_path / "scene.toml"))
    assert read.files == (tmp_path / "load.csv",)
    assert vi.run(read).final_state.values.tolist() == run(TABLE).final_state.values.tolist()


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (b"0,1\n1,x\n", 'two finite numbers in line 2, got "1,x"'),
        (b"0,1\n", "2 to 8192 rows of two numbers, got 1"),
        (b"0,1\n1,nan\n", "two finite numbers in line 2"),
        (b"0,1\n1,2,3\n", "two finite numbers in line 2"),
        (b"0,1\n0,2\n", "instants that ascend, got 0.0 as number 2, after 0.0"),
        (b"\xff\xfe\x00", "a file of text in UTF-8"),
        (b"0,1\n" * 300_000, "a file of at most 1048576 bytes"),
    ],
)
def test_a_wrong_file_of_a_table_is_one_line(content: bytes, expected: str, tmp_path: Path) -> None:
    (tmp_path / "load.csv").write_bytes(content)
    with pytest.raises(SceneError) as refused:
        Scene.from_dict(
            TABLES | {"forcing": {"signal": "table", "file": "load.csv"}}, str(tmp_path / "scene.toml")
        )
    (line,) = str(refused.value).splitlines()
    assert f"forcing.file: expected {expected}" in line


def test_effects_list_a_signal() -> None:
    (alone,) = [each for each in effects_of(scene(TABLE)) if each.name == "forcing"]
    assert alone.without.forces == ()
    both = [{"amplitude": 1.0, "angular_frequency": 1.0}, BAND]
    names = [each.name for each in effects_of(scene(both, record={"recorded_periods": 5}))]
    assert {"force 1, sine", "force 2, random"} <= set(names)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_export_moves_as_its_scene_in_another_tool(fmi: str, tmp_path: Path) -> None:
    several = scene(
        [CHIRP, TABLE, BAND],
        record={"recorded_time": 20.0, "time_series": {"rate": 10, "variables": ["displacement"]}},
    )
    ours = vi.run(several)
    file = export_scene(several, tmp_path / "signals.fmu", fmi=fmi)
    theirs = simulate_fmu(file, stop_time=20.0, output_interval=0.1, output=["displacement"])
    assert ours.sizes["impact"] > 3
    assert theirs["displacement"][:200] == pytest.approx(ours.displacement.values[:200], abs=1e-9)


def test_the_motion_of_a_stop_is_an_effect() -> None:
    moving = [STOP[0] | {"motion_amplitude": 0.05, "motion_angular_frequency": 1.0}]
    force = {"amplitude": 1.0, "angular_frequency": 1.0}
    shaken = scene(force, stop=moving, record={"recorded_periods": 3})
    names = {effect.name: effect for effect in effects_of(shaken)}
    without = names["motion of stop[1]"].without
    assert not without.moving_stop
    alone = scene([{"signal": "constant", "amplitude": 1.0}], stop=moving, record={"recorded_periods": 3})
    (found,) = [effect for effect in effects_of(alone) if effect.name == "motion of stop[1]"]
    assert (found.asked_by, found.without.stops[0].motion_amplitude) == ("stop[1].motion_amplitude", 0.0)
