"""Effects of scenes: each is found, removed alone and timed in turn; the record of a run changes no motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from support.places import EXAMPLES
from support.still_clock import let_nothing_run, stop_the_clock

import vibroimpact as vi
from vibroimpact.analysis.study import whole
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.study.cost_of_effects import CostOfEffects
from vibroimpact.orchestrator.study.effects import effects_of, not_called, shares_of
from vibroimpact.orchestrator.study.measuring_effects import motion_alone
from vibroimpact.orchestrator.study.motion import changes_of_motion, motion_of, sampling_of_change
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.statistics import statistics_of

BEAM: dict[str, Any] = {
    "body": {"kind": "beam", "modes": 4, "length": 0.3, "flexural_rigidity": 0.18, "mass_per_length": 0.16}
    | {"damping_ratio": 0.03},
    "forcing": {"amplitude": 0.02, "angular_frequency": 37.7},
    "stop": [{"law": "restitution", "position": 0.0034, "restitution": 0.8, "yield_velocity": 0.5}],
    "record": {"transient_periods": 20, "recorded_periods": 4, "time_series": {"rate": 500.0}},
}


def changes_of(tables: dict[str, Any]) -> dict[str, Scene]:
    return {effect.name: effect.without for effect in effects_of(Scene.from_dict(tables))}


def test_each_thing_that_a_scene_asks_for_is_taken_away_alone() -> None:
    found = changes_of(BEAM)
    assert set(found) == {
        *("forcing", "damping", "restitution that falls with speed", "restitution stop", "modes 3 to 4"),
        *("record of impacts", "record of extrema", "record of strobe", "time series"),
    }
    assert found["restitution stop"].stops == ()
    assert found["modes 3 to 4"].body.size == 2
    assert found["forcing"].forcing is not None
    assert found["forcing"].forcing.scalar_amplitude == 0.0
    assert found["time series"].record.time_series is None
    assert found["damping"].record.time_series is None  # motions are compared without a time series
    assert found["record of impacts"].stops


def test_a_scene_without_an_effect_does_not_list_it() -> None:
    free = {"body": {"mass": 1.0, "stiffness": 1.0}, "record": {"recorded_time": 5.0}}
    assert set(changes_of(free)) == {"record of impacts"}
    assert {"forcing", "damping", "stops"} <= set(not_called(Scene.from_dict(free)))


def test_a_free_mass_needs_its_forcing() -> None:
    rigid = {
        "body": {"mass": 1.0, "stiffness": 0.0, "damping": 0.0},
        "forcing": {"amplitude": 1.0, "angular_frequency": 1.0},
        "record": {"transient_periods": 0, "recorded_periods": 3},
    }
    assert "forcing" in changes_of(rigid)


def test_what_is_kept_changes_no_motion_and_what_moves_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibroimpact.orchestrator.study.effects.PAIRS", 2)
    # 67,000 samples take nearly all of the run, so other processes do not change the order
    record = BEAM["record"] | {"time_series": {"rate": 100_000.0}}
    scene = Scene.from_dict(BEAM | {"record": record})
    shares = {share.effect.name: share for share in whole(CostOfEffects(scene)).shares}
    assert next(iter(shares)) == "time series"  # the most expensive
    assert shares["time series"].share > 0.5
    assert shares["time series"].change == 0.0
    assert shares["restitution stop"].changes.startswith("loses ")
    assert all(share.seconds.shape == (2,) for share in shares.values())


LINEAR: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 2.0, "stiffness": 2.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 1.0, "angular_frequency": 0.8},
    "stop": [{"position": 0.1, "restitution": 0.8}],
    "record": {"transient_periods": 200, "recorded_periods": 10},
}


def test_where_impacts_are_lost_the_motions_are_told_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    stop_the_clock(monkeypatch)
    found = vi.effects(LINEAR)
    (row,) = np.flatnonzero(found["asked_by"].values == "stop[1]")
    # without the stop the body is linear: x = A sin(w t), mean kinetic energy m (A w)^2 / 4
    rate = 0.8
    size = 1.0 / (2.0 * np.hypot(1.0 - rate**2, 2.0 * 0.1 * rate))
    assert found["displacement_range"].values[row, 1] == pytest.approx(2.0 * size, rel=1e-6)
    assert found["kinetic_energy"].values[row, 1] == pytest.approx(0.5 * (size * rate) ** 2, rel=1e-6)
    assert found["potential_energy"].values[row, 1] == pytest.approx(0.5 * size**2, rel=1e-6)
    assert found["impacts"].values[row].tolist() == [20, 0]
    run = vi.run(LINEAR, progress=False)
    assert found["displacement_range"].values[row, 0] == pytest.approx(
        float(run.displacement_range), rel=1e-9
    )
    speed = float(run.impact_velocity.mean())
    assert found["impact_velocity"].values[row, 0] == pytest.approx(speed, rel=1e-9)
    assert (found["orbit"].values[row], found["orbit_without"].values[row]) == ("P(2,1)", "no impacts")
    assert np.isnan(found["change"].values[row])
    assert found["changes"].values[row] == "loses 20 of 20 impacts"
    assert found["statistics"].values[row].startswith("P(2,1) to no impacts, displacement range +")
    # damping is compared impact by impact
    (damping,) = np.flatnonzero(found["name"].values == "damping")
    assert found["changes"].values[damping].startswith("up to ")
    assert found["statistics"].values[damping] == ""


def test_a_chaotic_motion_is_told_by_statistics_and_by_what_chance_makes_of_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stop_the_clock(monkeypatch)
    scene = Scene.from_dict(
        LINEAR
        | {
            "forcing": {"amplitude": 1.0, "angular_frequency": 2.8},
            "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.02, "damping_slope": 1e-12},
            "stop": [{"position": 0.0, "restitution": 0.8}],
            "record": {"transient_periods": 100, "recorded_periods": 1000},
        }
    )
    effects = [one for one in effects_of(scene) if one.asked_by in ("body.damping_slope", "stop[1]")]
    shares = {share.effect.asked_by: share for share in shares_of(scene, effects)}
    slight, stop = shares["body.damping_slope"], shares["stop[1]"]
    assert slight.motions is not None
    assert slight.motions[0].orbit == slight.motions[1].orbit == "chaotic"
    assert np.isnan(slight.change)
    changes, chance = changes_of_motion(*slight.motions), sampling_of_change(*slight.motions)
    for name, change in changes.items():
        assert 0.0 < abs(change) < 3.0 * chance[name], name
    assert stop.motions is not None
    assert stop.motions[1].orbit == "no impacts"
    off = changes_of_motion(*stop.motions)["kinetic_energy"]
    assert abs(off) > 3.0 * sampling_of_change(*stop.motions)["kinetic_energy"]
    assert "(by chance " in slight.statistics_in_words


def test_a_motion_under_forces_without_a_common_period_has_no_class() -> None:
    scene = load_scene(EXAMPLES / "two_frequencies.toml")
    record = {"transient_periods": 100, "recorded_periods": 20}
    of_two = motion_of(scene.with_values({"record": record}))
    of_one = motion_of(scene.with_values({"record": record, "forcing[2].amplitude": 0.0}))
    assert of_two is not None
    assert of_one is not None
    assert (of_two.orbit, of_one.orbit) == ("quasi-periodic forcing", "P(2,1)")
    assert "chaotic" not in of_two.change


def test_a_run_that_ends_early_says_its_outcome_once() -> None:
    scene = load_scene(EXAMPLES / "inverted_pendulum.toml").unswept()
    stop = [one for one in effects_of(scene) if one.asked_by == "stop[1]"]
    (share,) = shares_of(scene, stop)
    assert share.changes == "unbounded: no stop can be met any more from time 0 s on"


def test_a_motion_without_impacts_has_no_statistics_of_impacts() -> None:
    train = np.column_stack([np.arange(30.0), np.ones(30), np.ones(30)])
    samples = np.ones((40, 1))
    assert statistics_of(Observation(samples=samples), Observation(train, samples=samples), ()) is None


def test_a_dataset_that_has_no_place_is_refused_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    let_nothing_run(monkeypatch)
    with pytest.raises(UsageError, match="expected a place where a file can be written, got no folder"):
        vi.effects(BEAM, "nowhere/parts.nc")


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        *((f"record of {what}", 0.0) for what in ("impacts", "extrema", "strobe")),
        ("time series", 1e-10),  # samples split the flights
    ],
)
def test_motion_is_the_same_whatever_is_kept(name: str, tolerance: float) -> None:
    scene = Scene.from_dict(BEAM)
    (effect,) = (one for one in effects_of(scene) if one.name == name)
    full, without = (vi.run(one, progress=False) for one in (effect.base, effect.without))
    both = set(full.data_vars) & set(without.data_vars)
    assert {"displacement_max", "impact_velocity"} & both
    for variable in both - {"point_seconds"}:
        if full[variable].dtype.kind == "f":
            a, b = full[variable].values, without[variable].values
            assert np.allclose(a, b, rtol=tolerance, atol=0.0, equal_nan=True), variable


def test_effects_of_a_general_scene_are_its_components_samples_contacts_and_events() -> None:
    found = [effect.name for effect in effects_of(load_scene(EXAMPLES / "newtons_cradle.toml"))]
    contacts = [f"contact of bodies {k}" for k in range(1, 5)]
    assert found == ["samples", *(f"component ball{k}" for k in range(1, 6)), *contacts]


def test_a_component_is_taken_away_with_all_that_joins_it_and_the_others_are_compared(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stop_the_clock(monkeypatch)
    scene = load_scene(EXAMPLES / "two_oscillators.toml", ["record.recorded_time=20"])
    effect = next(one for one in effects_of(scene) if one.name == "component b")
    assert [one.name for one in effect.without.components] == ["a"]
    assert not effect.without.connections
    (share,) = shares_of(scene, [effect])
    # alone, a moves as cos sqrt(1.1) t; coupled, it is half of cos t + cos sqrt(1.2) t
    time, (slow, fast, alone) = np.arange(0.0, 20.0, 0.05), np.sqrt([1.0, 1.2, 1.1])
    coupled = 0.5 * np.array(
        [
            np.cos(slow * time) + np.cos(fast * time),
            -slow * np.sin(slow * time) - fast * np.sin(fast * time),
        ]
    )
    off = np.abs(coupled - [np.cos(alone * time), -alone * np.sin(alone * time)]).max(axis=1)
    assert share.change == pytest.approx((off / np.ptp(coupled, axis=1)).max(), rel=0.02)


MEASURED: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1000.0, "damping": 0.5},
    "forcing": {"amplitude": 3.0, "frequency": 5.0},
    "stop": [{"position": 0.01, "restitution": 0.7}],
    "sensor": {"gain": 300.0},
    "load_cell": {"sensitivity": 0.01, "contact_duration": 1e-3},
    "exciter": {"gain": 1.5, "distance": 0.06},
    "noise": {"sensor": 1e-3, "load_cell": 1e-3},
    "daq": {"rate": 1000.0, "bits": 12, "range": 5.0},
    "record": {"recorded_periods": 4, "time_series": {"variables": ["sensor.displacement", "load_cell"]}},
}
CHAIN = {"sensor", "load cell", "exciter", "force that falls with distance", "noise", "AD conversion"}


def test_each_table_of_a_measuring_chain_is_taken_away_alone() -> None:
    found = changes_of(MEASURED)
    # without [daq] nothing holds the force of an exciter that falls with the distance
    assert set(found) & CHAIN == CHAIN - {"exciter", "AD conversion"}
    assert found["load cell"].channels == ("sensor.displacement",)
    assert found["load cell"].load_cell is None
    assert found["sensor"].channels == ("load_cell",)
    assert found["noise"].noise is None
    assert not found["force that falls with distance"].falling_force
    near = MEASURED | {"exciter": {"gain": 1.5}}
    assert changes_of(near)["AD conversion"].sampling_rate == 1000.0
    assert "force that falls with distance" in not_called(Scene.from_dict(near))


def test_what_a_scene_lists_of_a_chain_are_its_tables() -> None:
    bare = {name: MEASURED[name] for name in ("body", "forcing", "stop")} | {
        "record": {"recorded_periods": 4}
    }
    assert set(not_called(Scene.from_dict(bare))) >= CHAIN
    assert not set(not_called(Scene.from_dict(MEASURED))) & CHAIN


def test_the_motion_of_a_scene_with_a_chain_is_forced_in_newtons() -> None:
    alone = motion_alone(Scene.from_dict(MEASURED | {"exciter": {"gain": 1.5}}))
    assert alone.forcing is not None
    assert (alone.forcing.amplitude, alone.load_cell, alone.channels) == (4.5, None, ())
    for exciter in ({"gain": 1.5, "distance": 0.06}, {"gain": 1.5, "offset": 0.1}):
        with pytest.raises(UsageError, match="exciter: expected a force that is the forcing alone"):
            motion_alone(Scene.from_dict(MEASURED | {"exciter": exciter}))
