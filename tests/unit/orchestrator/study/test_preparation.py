"""Preparation of a scene before it runs: the number of modes that meets a tolerance, and the estimated error."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.still_clock import NEVER_LATE, stop_the_clock

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.convergence import ModeRuns, converged_modes
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.preparation import prepared_scene, with_found_modes
from vibroimpact.orchestrator.study.references import observed, scales_of
from vibroimpact.orchestrator.study.swept_modes import SweepPlaces, modes_of_sweep

STRIP: dict[str, Any] = {
    "body": {
        **{"kind": "beam", "modes": "auto", "damping_ratio": 0.02, "length": 0.25},
        **{"flexural_rigidity": 0.9333, "mass_per_length": 0.108},
    },
    "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
    "stop": [{"law": "kelvin_voigt", "position": 1e-4, "stiffness": 1e4, "damping": 1.0}],
    "record": {"transient_periods": 20, "recorded_periods": 20},
    "execution": {"tolerance": 1e-3},
}


def strip(**changes: Any) -> Scene:
    return Scene.from_dict(STRIP).with_values(changes)


def error_of(scene: Scene, modes: int, others: int = 64) -> float:
    found, reference = (observed(scene.with_values({"body.modes": n})) for n in (modes, others))
    errors = errors_of(found, reference, scales_of(scene.with_values({"body.modes": others})))
    return math.inf if errors.failure else errors.worst()


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_the_fewest_modes_that_meet_a_tolerance_are_found(tolerance: float) -> None:
    scene = strip(**{"execution.tolerance": tolerance})
    found = prepared_scene(scene)
    assert found.body.size < 64
    assert error_of(scene, found.body.size) <= tolerance
    assert (
        error_of(scene, found.body.size - 1) + 1e-16 > 0.5 * tolerance
    )  # bisection: not far from the fewest
    assert error_of(scene, found.body.size) <= 1.5 * found.found["estimated_error"]  # type: ignore[operator]
    tried = json.loads(str(found.found["modes_tried"]))
    assert str(found.body.size) in tried
    assert int(found.found["modes_checked_with"]) > found.body.size


def test_what_was_found_is_in_the_dataset_and_the_same_each_time(tmp_path: Path, cluster: str) -> None:
    scene = strip()
    first, again = vi.run(scene), vi.campaign(scene, tmp_path / "campaign", scheduler=cluster, progress=False)
    for name in ("modes_found", "modes_checked_with", "estimated_error", "modes_tried", "tolerance"):
        assert first.attrs[name] == again.attrs[name]
    assert first.attrs["estimated_error"] <= 1e-3
    assert first.modes == first.attrs["modes_found"]
    repeated = vi.run(Scene.from_text(first.attrs["scene"]))  # the scene that ran names its number of modes
    np.testing.assert_array_equal(first.impact_time, repeated.impact_time)


def test_the_point_of_a_sweep_that_takes_most_modes_decides() -> None:
    swept = strip().with_sweep({"stop[1].stiffness": [1e3, 1e4]})
    alone = [prepared_scene(strip(**{"stop[1].stiffness": k})) for k in (1e3, 1e4)]
    found = prepared_scene(swept)
    assert found.body.size == max(one.body.size for one in alone)
    assert found.runs == 2
    assert "3 points" not in str(found.found["estimated_error_of"])
    assert "2 points" in str(found.found["estimated_error_of"])


def resonance(points: int, stiffness: float = 1e5) -> Scene:
    """Return a sweep through the second natural frequency, 1036 rad/s: the strip reaches its stop only near it."""
    scene = strip(
        **{"body.damping_ratio": 0.005, "record.recorded_periods": 5, "record.impacts": False},
        **{"stop[1].position": 1e-3, "stop[1].stiffness": stiffness, "execution.tolerance": 2e-2},
    )
    return scene.with_sweep({"forcing.angular_frequency": {"start": 800, "stop": 1600, "points": points}})


def test_a_resonance_between_the_ends_of_a_sweep_decides() -> None:
    swept = resonance(161)
    places = SweepPlaces(swept)
    ends = converged_modes([ModeRuns(places.scene_at(place), 2e-2) for place in places.ends()], 2e-2)
    found = prepared_scene(swept)
    assert found.body.size > ends.modes
    assert len(places.ends()) < int(found.found["modes_checked_points"]) <= 32 + 32 + 3
    assert "modes_unmet_points" not in found.found
    errors = {place: error_of(places.scene_at((place,)), found.body.size) for place in range(38, 58, 2)}
    assert max(errors.values()) <= 2e-2
    alone = {place: error_of(places.scene_at((place,)), ends.modes) for place in range(40, 56, 4)}
    assert max(alone.values()) > 2e-2  # the ends alone need fewer modes


def test_the_modes_of_a_sweep_follow_from_the_scene_alone(tmp_path: Path, cluster: str) -> None:
    small = resonance(7)
    assert prepared_scene(small).found == prepared_scene(small).found
    first = vi.campaign(small, tmp_path / "campaign", scheduler=cluster, progress=False)
    again = vi.campaign(small, tmp_path / "campaign", scheduler=cluster, progress=False)
    assert first.attrs["modes_checked_points"] == 7  # all points of the sweep
    assert first.identical(again)


def test_a_point_that_no_number_of_modes_meets_is_told_and_does_not_stop_the_sweep() -> None:
    notes: list[str] = []
    found = prepared_scene(resonance(801, stiffness=1e6), notes.append)
    assert str(found.found["modes_unmet_points"]).startswith("forcing.angular_frequency = 10")
    assert "no number of modes meets execution.tolerance = 0.02 at forcing.angular_frequency = 10" in notes[1]
    with pytest.raises(SceneError, match=r"tolerance = 0.02 at forcing.angular_frequency = 1014, got "):
        modes_of_sweep(
            resonance(3, stiffness=1e6).with_sweep({"forcing.angular_frequency": [1000.0, 1014.0]}), 2e-2
        )


def test_keys_that_move_together_are_looked_at_where_they_meet() -> None:
    together = {"values": [1e4, 1e3, 2e3], "zip": "stop"}, {"values": [1e-4, 3e-4, 2e-4], "zip": "stop"}
    swept = strip().with_sweep(dict(zip(("stop[1].stiffness", "stop[1].position"), together, strict=True)))
    places = SweepPlaces(swept)
    assert places.ends() == [(1,), (0,), (2,)]
    assert places.values_at((1,)) == {"stop[1].stiffness": 1e3, "stop[1].position": 3e-4}


def test_residual_vectors_are_found_with_the_modes_before_them() -> None:
    scene = strip(**{"body.residual": True, "stop[1].location": 0.6, "stop[1].stiffness": 1e5})
    assert with_found_modes(scene).body.size > 1
    assert with_found_modes(scene.with_values({"execution.tolerance": 0.4})).body.size >= 2


def test_names_that_a_scene_uses_bound_the_modes_from_below() -> None:
    series = {"rate": 1e4, "variables": ["modal_displacement[5]"]}
    found = prepared_scene(strip(**{"record.time_series": series, "execution.tolerance": 0.5}))
    assert found.body.size >= 5


def test_a_tolerance_that_no_number_of_modes_meets_says_what_was_reached() -> None:
    with pytest.raises(
        SceneError, match=r"body.modes: .* = 1e-09, got .* with 32 modes \(compared with 64\)"
    ):
        prepared_scene(strip(**{"execution.tolerance": 1e-9}))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"stop[1]": {"position": 1e-4, "restitution": 0.5}},
            "stop.1..law: expected a stop that yields beside modes",
        ),
        ({"execution.tolerance": 0.0}, "execution.tolerance: expected 0 < tolerance <= 0.5, got 0.0"),
        ({"body.damping_ratio": [0.1, 0.2]}, "body.damping_ratio: expected one number for all modes"),
    ],
)
def test_modes_that_cannot_be_found_are_one_clear_error(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        strip(**changes)


def test_modes_without_a_tolerance_are_refused() -> None:
    with pytest.raises(SceneError, match=r"execution\.tolerance: expected a number beside modes"):
        Scene.from_dict({**STRIP, "execution": {}})


def test_nothing_runs_before_its_modes_are_found() -> None:
    with pytest.raises(UsageError, match=r'body\.modes: expected a number of modes, got "auto"'):
        observed(strip())


def test_the_error_of_a_solution_is_estimated_where_a_scene_asks_for_it() -> None:
    tables = {
        "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.1},
        "forcing": {"amplitude": 1.0, "angular_frequency": 2.0},
        "stop": [{"law": "hertz", "position": 0.1, "stiffness": 1e3}],
        "record": {"transient_periods": 10, "recorded_periods": 5},
        "execution": {"tolerance": 1e-6, "contact_tolerance": 1e-4},
    }
    notes: list[str] = []
    rough = prepared_scene(Scene.from_dict(tables), notes.append).found["estimated_error"]
    assert 1e-6 < float(rough) < 1e-2
    assert "above execution.tolerance" in notes[0]
    exact = prepared_scene(Scene.from_dict(tables | {"execution": {"tolerance": 1e-6}})).found[
        "estimated_error"
    ]
    assert float(exact) < 1e-8


def test_a_scene_that_asks_for_no_tolerance_is_left_as_it_is() -> None:
    scene = strip(**{"body.modes": 4}).with_values({"execution": {}})
    assert prepared_scene(scene) is scene
    assert "estimated_error" not in vi.run(scene).attrs


def test_chaotic_motion_is_compared_by_its_statistics() -> None:
    scene = strip(
        **{"stop[1].position": 0.0, "stop[1].damping": 0.0, "forcing.angular_frequency": 130.0},
        **{"forcing.amplitude": 1.0, "body.damping_ratio": 0.005, "record.recorded_periods": 100},
    )
    found = converged_modes([ModeRuns(scene, 0.2)], 0.2)
    assert found.by == "statistics"
    assert found.error <= 0.2


def test_a_scene_that_does_not_run_says_so() -> None:
    with pytest.raises(
        SceneError, match=r"body\.modes: expected runs to compare, got one that failed: impact_limit"
    ):
        prepared_scene(strip(**{"execution.impact_limit": 1}))


def test_no_error_is_estimated_of_a_run_that_does_not_finish() -> None:
    notes: list[str] = []
    scene = strip(**{"body.modes": 4, "execution.impact_limit": 3})
    found = prepared_scene(scene, notes.append).found
    assert math.isnan(float(found["estimated_error"]))
    assert str(found["estimated_error_of"]).startswith("nothing: impact_limit")
    assert "chaotic" not in notes[0]


def test_points_of_a_sweep_that_are_chaotic_are_told_apart() -> None:
    tables = {
        "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.01},
        "forcing": {"amplitude": 1.0, "angular_frequency": 2.8},
        "stop": [{"position": 0.0, "restitution": 0.95}],
        "record": {"transient_periods": 100, "recorded_periods": 100},
        "execution": {"tolerance": 1e-6},
        "sweep": {"forcing.angular_frequency": {"values": [2.0, 2.8]}},
    }
    found = prepared_scene(Scene.from_dict(tables)).found
    assert float(found["estimated_error"]) < 1e-6 or math.isnan(float(found["estimated_error"]))
    assert "points of the sweep" in str(found["estimated_error_of"])


@settings(max_examples=4, deadline=None)
@given(
    stiffness=st.floats(1e2, 1e4),
    location=st.sampled_from([0.3, 0.6, 0.85, 1.0]),
    frequency=st.floats(50.0, 400.0),
    residual=st.booleans(),
)
def test_the_estimated_error_of_modes_holds_against_64(
    stiffness: float, location: float, frequency: float, residual: bool
) -> None:
    scene = strip(
        **{
            "stop[1].stiffness": stiffness,
            "stop[1].location": location,
            "forcing.angular_frequency": frequency,
        },
        **{"body.residual": residual, "record.impacts": False, "record.transient_periods": 5},
        **{"record.recorded_periods": 5},
    )
    try:
        found = converged_modes([ModeRuns(scene, 3e-3)], 3e-3)
    except SceneError as refused:
        assert "expected a number of modes that meets" in str(refused)  # noqa: PT017
        return
    if found.by == "motion":
        assert error_of(scene, found.modes) <= 2.0 * found.error


def test_effects_draw_how_the_modes_that_were_found_converge(monkeypatch: pytest.MonkeyPatch) -> None:
    stop_the_clock(monkeypatch)
    found = vi.effects(strip())
    figure = vi.draw(found)
    bars, convergence = figure.axes
    assert convergence.get_xlabel() == "number of modes"
    errors = dict(zip(*convergence.lines[1].get_data(), strict=True))
    assert errors[found.attrs["modes_found"]] <= found.attrs["tolerance"]
    assert bars.get_xlabel() == "share of the time of a run (%)"


def test_a_study_of_accuracy_tells_other_numbers_of_modes_by_the_most(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    stop_the_clock(monkeypatch)
    for slow in ("_coupled", "_revised", "_integrated"):  # ways without a role here
        monkeypatch.setattr(f"vibroimpact.orchestrator.study.ways.all_ways.{slow}", lambda scene: [])
    monkeypatch.setattr("vibroimpact.orchestrator.study.ways.all_ways.STEPS_A_PERIOD", (23,))
    found = vi.accuracy(strip(**{"record.recorded_periods": 5}), budget=NEVER_LATE)
    assert "32 modes, residual vectors among them" in found.attrs["modes_reference"]
    modes = found.where(found.name == "modes", drop=True)
    errors = dict(zip(modes.setting.values.tolist(), modes.error.values.tolist(), strict=True))
    assert errors[4] > errors[8] > errors[16]
    assert modes.is_model.all()


CHAIN: dict[str, Any] = {
    "body": {"kind": "chain", "masses": [1.0] * 12, "stiffnesses": 400.0, "dampings": 1.0, "modes": "auto"},
    "forcing": {"amplitude": [*([0.0] * 11), 1.0], "angular_frequency": 1.5},
    "stop": [{"law": "kelvin_voigt", "position": 0.01, "stiffness": 10.0, "damping": 0.5}],
    "record": {"transient_periods": 20, "recorded_periods": 5},
    "execution": {"tolerance": 0.05},
}


def test_a_chain_takes_the_fewest_modes_and_all_of_them_where_fewer_do_not_do() -> None:
    found = prepared_scene(Scene.from_dict(CHAIN))
    assert 1 <= int(found.found["modes_found"]) < 12
    exact = prepared_scene(Scene.from_dict(CHAIN | {"execution": {"tolerance": 1e-9}}))
    assert exact.found["modes_found"] == 12
    assert exact.found["estimated_error_of_modes"] == 0.0


def test_a_chain_with_a_rigid_stop_converges_too() -> None:
    rigid = CHAIN | {"stop": [{"position": 0.01, "restitution": 0.5}], "execution": {"tolerance": 0.5}}
    assert int(prepared_scene(Scene.from_dict(rigid)).found["modes_found"]) <= 12


def test_a_chain_with_all_its_modes_is_the_chain_bit_for_bit() -> None:
    body = {key: value for key, value in CHAIN["body"].items() if key != "modes"}
    plain = vi.run(CHAIN | {"body": body, "execution": {}})
    swept = vi.run(
        Scene.from_dict(CHAIN | {"body": body, "execution": {}}).with_sweep({"body.modes": [3, 12]})
    )
    np.testing.assert_array_equal(plain.final_state, swept.final_state.sel(modes=12))
    assert swept.final_state.shape[-1] == 24
    assert not np.array_equal(swept.final_state.sel(modes=3), swept.final_state.sel(modes=12))


def test_a_chain_has_no_more_modes_than_masses() -> None:
    with pytest.raises(
        SceneError, match=r"body\.modes: expected at most as many modes as masses, 12, got 13"
    ):
        Scene.from_dict(CHAIN | {"body": CHAIN["body"] | {"modes": 13}})
