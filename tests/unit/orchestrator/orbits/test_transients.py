"""Transients: starts come together at the rate of the orbit's multipliers, or end elsewhere, which is reported."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.transients import (
    CHAOTIC,
    ELSEWHERE,
    FORGOTTEN,
    LOST,
    SHIFTED,
    SLOW,
    verdict,
)

BODY = {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05}


def scene(frequency: float, position: float = 1.0, **body: float) -> vi.Scene:
    tables: dict[str, Any] = {
        "body": BODY | body,
        "forcing": {"amplitude": 0.5, "angular_frequency": frequency},
        "stop": [{"position": position, "restitution": 0.7}],
        "record": {"transient_periods": 0, "recorded_periods": 1},
    }
    return vi.Scene.from_dict(tables)


def said(found: xr.Dataset) -> str:
    return " ".join(verdict(found))


def test_a_body_that_meets_no_stop_forgets_as_its_damping_says() -> None:
    found = vi.transients(scene(1.3, position=1000.0), starts=3)
    expected = math.exp(-0.05 * 2.0 * math.pi / 1.3)
    assert found.attrs["linear_contraction"] == pytest.approx(expected, rel=1e-12)
    # two multipliers of one size turn round each other
    assert found.contraction.values == pytest.approx(np.full(3, expected), rel=1e-2)
    predicted = np.log(1e-6 / found.first_distance.values) / math.log(expected)
    assert found.forgotten_after.values == pytest.approx(predicted, abs=3.0)


@pytest.mark.parametrize("frequency", [0.945, 0.95])
def test_near_an_orbit_the_contraction_is_its_largest_multiplier(frequency: float) -> None:
    (orbit,) = vi.find_orbits(scene(frequency), 1, 1)
    assert orbit.is_stable
    assert orbit.multipliers[0].imag == 0.0
    found = vi.transients(scene(frequency), starts=3, spread=1e-3)
    assert set(found.end.values) == {FORGOTTEN}
    assert found.contraction.values == pytest.approx(np.full(3, abs(orbit.multipliers[0])), rel=2e-2)


def test_starts_that_end_on_another_attractor_are_named() -> None:
    found = vi.transients(scene(1.4), starts=6)
    assert found.attrs["motion"] == "no impacts"
    assert set(found.end.values) == {FORGOTTEN, ELSEWHERE}
    assert set(found.motion.values[found.end.values == ELSEWHERE]) == {"P(1,1)"}
    assert np.isinf(found.forgotten_after.values[found.end.values == ELSEWHERE]).all()
    assert "end on another attractor (P(1,1)): the motion hangs on the start." in said(found)


def test_the_same_orbit_a_period_later_is_told_from_another_one() -> None:
    found = vi.transients(scene(0.9), starts=6)
    assert set(found.motion.values) == {"P(1,2)"}
    assert set(found.end.values) == {FORGOTTEN, SHIFTED}
    assert "whole periods apart" in said(found)


def test_chaos_forgets_nothing() -> None:
    chaotic = vi.Scene.from_file(EXAMPLES / "thesis" / "figure_2_11.toml")
    found = vi.transients(chaotic, starts=2, periods=120)
    assert found.sizes["period"] == 120
    assert set(found.end.values) == {CHAOTIC}
    assert "The motion is chaotic: its start is never forgotten" in said(found)


def test_too_few_periods_are_said_to_be_too_few() -> None:
    found = vi.transients(scene(1.3, position=1000.0), starts=2, periods=20)
    assert set(found.end.values) == {SLOW}
    assert "follow more periods, or allow a larger tolerance" in said(found)


def test_without_a_force_the_period_is_that_of_the_first_mode() -> None:
    free = {
        "body": BODY | {"displacement_start": 0.9},
        "stop": [{"position": 1.0, "restitution": 0.7}],
        "record": {"recorded_time": 10.0},
    }
    found = vi.transients(vi.Scene.from_dict(free), starts=3)
    assert found.attrs["period_of"] == "the first mode"
    assert found.attrs["period_length"] == pytest.approx(2.0 * math.pi, rel=1e-12)
    assert set(found.end.values) == {FORGOTTEN}
    assert "periods of the first mode." in said(found)


@pytest.mark.parametrize(
    "load",
    [
        {"amplitude": 0.6, "angular_frequency": 0.0},
        {"signal": "constant", "amplitude": 0.6},
        {"amplitude": 1.2, "angular_frequency": 0.0, "phase": math.pi / 3.0},
    ],
)
def test_a_constant_force_stays_where_the_first_mode_gives_the_period(load: dict[str, Any]) -> None:
    pressed = {
        "body": BODY,
        "forcing": load,
        "stop": [{"position": 0.5, "restitution": 0.7}],
        "record": {"recorded_time": 10.0},
    }
    found = vi.transients(vi.Scene.from_dict(pressed), starts=2)
    assert found.attrs["motion"] == "rest"  # without the load the body rests at 0, away from its stop
    assert set(found.end.values) == {FORGOTTEN}
    assert set(found.motion.values) == {"rest"}


def test_a_chain_without_a_force_forgets_as_its_slowest_mode_says() -> None:
    chain = {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": 1.0, "dampings": 0.1}
    tables = {"stop": [{"position": 1000.0, "restitution": 0.7}], "record": {"recorded_time": 10.0}}
    found = vi.transients(vi.Scene.from_dict({"body": chain} | tables), starts=2)
    assert found.contraction.values == pytest.approx(found.attrs["linear_contraction"], rel=1e-2)
    assert set(found.end.values) == {FORGOTTEN}


def test_a_random_force_has_no_period_of_its_own() -> None:
    noise = [{"signal": "random", "amplitude": 0.1, "band": [0.5, 2.0]}]
    with pytest.raises(UsageError, match="expected sines, constant forces or no force, got 1 random"):
        vi.transients(vi.Scene.from_dict({"body": BODY, "forcing": noise, "record": {"recorded_time": 9.0}}))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"starts": 0}, "transients: starts: expected 1 to 1000, got 0."),
        ({"spread": math.nan}, "transients: spread: expected a finite number > 0, got nan."),
        ({"spread": -1.0}, "transients: spread: expected a finite number > 0, got -1."),
        ({"tolerance": 0.0}, "transients: tolerance: expected 1e-10 to 1, got 0."),
        ({"tolerance": math.nan}, "transients: tolerance: expected 1e-10 to 1, got nan."),
        ({"periods": 0}, "transients: periods: expected 1 to 1000000, got 0."),
    ],
)
def test_numbers_that_make_no_sense_are_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError) as refused:
        vi.transients(scene(1.0), **options)
    assert str(refused.value) == message


def test_components_are_refused() -> None:
    with pytest.raises(
        UsageError, match="body: expected an oscillator, a chain, a beam or several bodies whose orbits"
    ):
        vi.transients(EXAMPLES / "newtons_cradle.toml")


def test_on_a_stop_that_yields_the_contraction_is_that_of_its_orbit() -> None:
    stop = {"position": 0.8, "law": "kelvin_voigt", "stiffness": 50.0, "damping": 1.0}
    yielding = scene(1.2).with_values({"stop": [stop]})
    (orbit,) = [each for each in vi.find_orbits(yielding, 1, 1) if each.is_stable]
    found = vi.transients(yielding, starts=2)
    assert set(found.end.values) == {FORGOTTEN}
    # two multipliers of one size turn round each other
    assert found.contraction.values == pytest.approx(np.full(2, abs(orbit.multipliers[0])), rel=1e-2)


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(scene(1.0).text, encoding="utf-8")
    output, figure = tmp_path / "t.nc", tmp_path / "t.png"
    done = in_this_process("transients", path, "--starts", "2", "-o", output, "--figure", figure)
    assert (done.returncode, done.stderr) == (0, "")
    assert "The start is forgotten to 1e-06 after " in done.stdout
    assert figure.stat().st_size > 10_000
    with vi.open_measured(output) as found:
        assert found.attrs["scene_file"] == str(path)
        assert found.sizes["start"] == 2
    again = in_this_process("transients", path, "--starts", "3", "-o", output)
    assert again.returncode == 0
    assert LOST not in done.stdout
