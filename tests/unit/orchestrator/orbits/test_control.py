"""Orbits kept by coupled FMUs. References: the orbits of `find_orbits`, thesis 3.5.2, runs without control."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.control import Controlled
from vibroimpact.orchestrator.orbits.control_parts import coupled_scene
from vibroimpact.orchestrator.orbits.control_plan import ControlSettings, control_plan

pytest.importorskip("pythonfmu")

SCENE = EXAMPLES / "bifurcation.toml"
GRAZE, DOUBLING = 0.7106873690939, 0.9364931207
THESIS = 0.009
"""Distance from the graze, rad/s, to which the thesis kept its orbit."""


def scene() -> vi.Scene:
    return vi.Scene.from_text(SCENE.read_text(encoding="utf-8"), str(SCENE)).with_sweep({})


def kept(**options: float | str) -> xr.Dataset:
    return vi.control(scene(), 1.0, 0.7, **{"step": 1e-3, **options})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def found() -> xr.Dataset:
    return kept()


def test_the_unstable_orbit_is_kept_nearer_to_its_graze_than_in_the_thesis(found: xr.Dataset) -> None:
    assert found.attrs["end"] == "kept to the end of the plan"
    assert found.attrs["branch_ends_at"] == pytest.approx(GRAZE, abs=1e-9)
    assert 0.0 < found.attrs["kept_to"] - GRAZE < 1e-3 < THESIS
    assert np.count_nonzero(found.orbit_multiplier > 1.0) > 200
    assert float(np.abs(found.correction).max()) < 0.005


def test_what_was_kept_is_the_orbit(found: xr.Dataset) -> None:
    # at the last frequency of the plan there are enough impacts to reach the orbit
    last = found.isel(impact=found.impact_orbit == found.sizes["orbit"] - 1).isel(impact=slice(-5, None))
    orbit = vi.find_orbits(scene().with_values({"forcing.angular_frequency": found.attrs["kept_to"]}), 1, 1)
    assert last.impact_velocity.values == pytest.approx(float(orbit[0].velocities[0]), rel=1e-9)
    assert last.impact_phase.values == pytest.approx(float(orbit[0].phases[0]), abs=1e-9)
    assert np.abs(last.correction.values).max() < 1e-9
    period = 2.0 * math.pi / found.attrs["kept_to"]
    assert np.diff(last.impact_time.values) == pytest.approx(period, rel=1e-9)


def test_without_corrections_it_is_lost_where_its_period_doubles() -> None:
    loose = kept(limit=0.0, tolerance=2e-2, stay=100)
    assert loose.attrs["end"].startswith(("lost", "not settled"))
    assert DOUBLING - 0.06 < loose.attrs["reached"] < DOUBLING + 0.005
    assert not loose.correction.values.any()


@pytest.mark.parametrize("law", [pytest.param("deadbeat", marks=pytest.mark.long), "newton"])
def test_other_laws_keep_it_as_well(law: str) -> None:
    found = kept(law=law)
    assert found.attrs["kept_to"] - GRAZE < THESIS
    at = found.impact_orbit.values
    settled = np.flatnonzero((np.diff(at) > 0) & (found.orbit_multiplier.values[at[:-1]] > 1.0))
    assert settled.size > 200
    speeds = found.orbit_velocity.values[at[settled]]
    assert found.impact_velocity.values[settled] == pytest.approx(speeds, abs=2e-3)


def test_noisy_speeds_are_enough_and_cost_larger_corrections() -> None:
    found = kept(noise=1e-3, stay=5)
    assert found.attrs["kept_to"] - GRAZE < THESIS
    once, again = (vi.control(scene(), 1.0, 0.95, step=5e-3, noise=1e-3) for _ in range(2))
    assert once.identical(again), "the noise is that of its seed"
    middle = (found.angular_frequency > 0.8) & (found.angular_frequency < 0.9)
    spread = float(found.correction[middle].std())
    assert 1e-5 < spread < 1e-3


def test_it_goes_up_again() -> None:
    found = vi.control(scene(), 0.72, 0.98, step=2e-3)
    assert found.attrs["end"] == "kept to the end of the plan"
    assert found.attrs["kept_to"] == pytest.approx(0.98)
    assert "branch_ends_at" not in found.attrs


def test_a_stop_below_and_a_second_one_that_is_never_met_change_nothing(found: xr.Dataset) -> None:
    mirrored = scene().with_values(
        {
            "stop": [
                {"position": -1.0, "side": "lower", "restitution": 0.7},
                {"position": 40.0, "side": "upper", "restitution": 0.5},
            ]
        }
    )
    below = vi.control(mirrored, 1.0, 0.7, step=1e-3)
    assert below.attrs["kept_to"] == found.attrs["kept_to"]
    assert below.impact_velocity.values[:500] == pytest.approx(found.impact_velocity.values[:500], rel=1e-6)


def test_what_came_before_an_interruption_is_kept() -> None:
    plan = control_plan(scene(), 1.0, 0.97, ControlSettings(step=1e-3))
    found = Controlled(plan)
    with closing(found.rows()) as rows:
        next(impacts for impacts in rows if impacts > 100)
    assert found.end == "interrupted"
    assert found.dataset.sizes["impact"] > 100


def test_the_components_run_as_a_scene_too(tmp_path: Path) -> None:
    plan = control_plan(scene(), 0.95, 0.9, ControlSettings(step=1e-3))
    plan.controller(tmp_path / "controller.fmu")
    path = tmp_path / "scene.toml"
    path.write_text(coupled_scene(plan, "controller.fmu"), encoding="utf-8")
    coupled = vi.run(path)
    row = coupled["controller_row"].values
    assert row[0] == 0
    assert row[-1] == len(plan.orbits) - 1
    assert coupled["controller_kept"].values.all()


# ---- the command ----


def test_the_command_tells_draws_and_leaves_what_it_used(tmp_path: Path) -> None:
    files = ["-o", str(tmp_path / "kept.nc"), "--figure", str(tmp_path / "kept.png")]
    done = in_this_process(
        "control", str(SCENE), "--from", "0.95", "--to", "0.92", "--step", "1e-3", *files,
        "--keep", str(tmp_path / "parts"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "Kept to 0.92: kept to the end of the plan." in done.stdout
    assert (tmp_path / "kept.png").read_bytes()[:4] == b"\x89PNG"
    assert sorted(path.name for path in (tmp_path / "parts").iterdir()) == ["controller.fmu", "scene.toml"]
    with xr.open_dataset(tmp_path / "kept.nc") as written:
        assert written.attrs["results_kind"] == "control"
        assert written.attrs["control_law"] == "ogy"
    sweep = vi.run(
        scene().with_sweep({"forcing.angular_frequency": {"start": 0.9, "stop": 1.0, "points": 3}})
    )
    assert len(vi.draw(xr.load_dataset(tmp_path / "kept.nc"), over=sweep).axes) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--law", "pid"], "control: law: expected one of ogy, deadbeat, newton, got 'pid'."),
        (["--step", "0"], "control: step: expected a finite number > 0, got 0."),
        (["--step", "1e-9"], "control: step: expected 100000 steps at most, got"),
        (["--tolerance", "nan"], "control: tolerance: expected a finite number > 0, got nan."),
        (["--limit", "2"], "control: limit: expected a number from 0 to 1, got 2."),
        (["--noise", "-1"], "control: noise: expected a number from 0 to 1, got -1."),
        (["--periods", "0"], "control: periods: expected a whole number from 1 to 64, got 0."),
        (["--stay", "1000"], "control: stay: expected a whole number from 1 to 250, got 1000."),
        (["--seed", str(2**40)], "control: seed: expected a whole number of 32 bits"),
        (["--from", "-1"], "control: from: expected an angular frequency > 0, got -1."),
        (["--to", "inf"], "control: to: expected an angular frequency > 0, got inf."),
        (["--set", "forcing.amplitude=0"], "forcing.amplitude: expected a force to control, got 0."),
        (["--set", "forcing={}"], "forcing"),
        (["--keep", "."], "expected a new folder, got one that is there."),
    ],
)
def test_what_cannot_be_controlled_is_one_line(arguments: list[str], said: str, tmp_path: Path) -> None:
    done = in_this_process("control", str(SCENE), "--from", "1", "--to", "0.9", *arguments)
    assert done.returncode == 2, done.stdout
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_bodies_of_several_modes_and_places_without_orbits_are_refused(tmp_path: Path) -> None:
    chain = vi.Scene.from_text((EXAMPLES / "thesis" / "figure_6_13.toml").read_text(encoding="utf-8"))
    with pytest.raises(UsageError, match="expected an oscillator, whose state"):
        vi.control(chain, 1.0, 0.9)
    with pytest.raises(
        vi.VibroimpactError, match=r"expected an orbit P\(1,1\) to keep at 0.5, got none there"
    ):
        vi.control(scene(), 0.5, 0.4)
