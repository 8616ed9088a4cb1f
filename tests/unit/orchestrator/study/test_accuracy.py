"""Studies of accuracy: the right reference, settings that converge at their order, failures that show as failures."""

from __future__ import annotations

import io
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from support.fmu_factory import mass
from support.places import EXAMPLES
from support.still_clock import let_nothing_run
from support.studied_scenes import COARSE, P11, SOFT, STRIP, ladder, studied_once

import vibroimpact as vi
from vibroimpact.analysis.landmarks import ImpactOscillator, observed_order
from vibroimpact.analysis.study import whole
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.orchestrator.study.accuracy import AccuracyOfScene, Comparison, advice, dataset_of
from vibroimpact.orchestrator.study.accuracy.choice import cheapest, error_of_reference, refuse_unreached
from vibroimpact.orchestrator.study.accuracy.printed import table_of
from vibroimpact.orchestrator.study.accuracy.study import studied_scene
from vibroimpact.orchestrator.study.memory import IS_MEASURED, memory_of_ways
from vibroimpact.orchestrator.study.references import reference_of
from vibroimpact.orchestrator.study.ways import all_ways
from vibroimpact.orchestrator.study.ways.revision import RevisedTrial

HERTZ: dict[str, Any] = P11 | {
    "stop": [{"law": "hertz", "position": 1.0, "stiffness": 100.0}],
    "record": {"transient_periods": 2, "recorded_periods": 1},
}
FREE: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 4.0, "displacement_start": 1.0},
    "record": {"recorded_time": 3.0},
}


@pytest.fixture(scope="module")
def rigid() -> Comparison:
    return studied_once(Scene.from_dict(P11), {}, tolerance=1e-6)


@pytest.fixture(scope="module")
def yielding() -> Comparison:
    plain = {"STEPS_A_PERIOD": COARSE["STEPS_A_PERIOD"]}
    return studied_once(Scene.from_dict(HERTZ), plain, tolerance=1e-7)


def test_a_periodic_motion_is_compared_with_its_closed_form(rigid: Comparison) -> None:
    assert rigid.orbit == "P(1,1)"
    assert rigid.reference.name == "the closed form of the P(1,1) motion"
    assert not rigid.reference.chaotic
    by_name = {one.way.name: one for one in rigid.measured}
    for name in ("fused", "coupled, FMI 3.0", "coupled, FMI 2.0"):
        assert by_name[name].error("all") < 1e-11, name
    assert rigid.chosen is by_name["fused"]
    assert advice(rigid).startswith("Take fused: a relative error of < ")


def test_plain_steps_are_of_first_order_and_an_integrator_follows_its_tolerance(rigid: Comparison) -> None:
    steps, errors = ladder(rigid, "plain steps")
    assert len(steps) >= 3
    assert 0.5 < observed_order(steps, errors) < 1.6
    tolerances, errors = ladder(rigid, "model exchange, CVode")
    assert len(tolerances) >= 3
    assert np.all(np.diff(errors) < 0.0)
    assert np.all(errors < 1e3 * tolerances)


@pytest.mark.parametrize("law", ["Kelvin-Voigt", "Hunt-Crossley"])
def test_another_law_of_equal_restitution_is_an_error_of_the_model_and_never_chosen(
    rigid: Comparison, law: str
) -> None:
    times, errors = ladder(rigid, f"{law} stops of equal restitution")
    assert observed_order(times, errors) == pytest.approx(1.0, abs=0.2)
    dataset = dataset_of(rigid)
    assert not (dataset.is_model & dataset.on_front).any()


def test_a_tolerance_of_integrated_contacts_buys_what_it_says(yielding: Comparison) -> None:
    tolerances, errors = ladder(yielding, "fused")
    assert list(tolerances) == [1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12]
    assert np.all(errors <= np.maximum(10.0 * tolerances, 1e-11))
    assert np.all(np.diff(errors) < 0.0)
    assert yielding.chosen is not None
    assert yielding.chosen.error("all") <= 1e-7


def test_step_revision_finds_rigid_stops_to_rounding_and_follows_yielding_ones_at_second_order(
    rigid: Comparison, yielding: Comparison
) -> None:
    _, errors = ladder(rigid, "step revision")
    assert len(errors) == 2
    assert np.all(errors < 1e-10)
    steps, errors = ladder(yielding, "step revision")
    assert observed_order(1.0 / steps, errors) == pytest.approx(2.0, abs=0.2)


def test_step_revision_follows_a_body_that_is_pressed_on_its_stop_from_the_start() -> None:
    tables = {
        "body": {"mass": 1.0, "stiffness": 0.5, "damping_ratio": 0.1},
        "forcing": {"amplitude": 0.5, "angular_frequency": 2.3},
        "stop": [{"position": 0.0, "restitution": 0.9}],
        "record": {"recorded_periods": 2},
    }
    scene = studied_scene(Scene.from_dict(tables))
    assert scene.period is not None
    found, expected = RevisedTrial(scene, 0.02 * scene.period).run(), reference_of(scene).observation
    assert found.final == pytest.approx(expected.final, rel=1e-4)


def test_step_revision_gives_an_impulse_that_is_small_beside_the_speed_of_the_other_mass() -> None:
    scene = studied_scene(load_scene(EXAMPLES / "thesis" / "figure_6_5b.toml"))
    assert scene.period is not None
    end = reference_of(scene).scales.window[1]
    found = RevisedTrial(scene, 0.2 * scene.period, part=30.5 / end).run()  # after an impact at 30.09
    assert found.failure == ""


def test_samples_tell_impacts_as_late_as_they_are_apart() -> None:
    tables = P11 | {"record": P11["record"] | {"time_series": {"rate": 20.0}}}
    study = studied_once(Scene.from_dict(tables))
    its = [one for one in study.measured if one.way.name == "read off samples"]
    assert [one.way.setting for one in its] == [5.0, 20.0, 80.0, 320.0]
    assert all(one.way.model for one in its)
    for one in its:
        assert one.errors.of["impact_time"] <= 1.0 / one.way.setting / (2.0 * math.pi)


def test_the_energy_that_held_forces_add_is_an_error_too() -> None:
    tables = P11 | {
        "stop": [{"law": "kelvin_voigt", "position": 1.0, "stiffness": 1e3, "damping": 3.0}],
        "record": {"transient_periods": 2, "recorded_periods": 1},
    }
    study = studied_once(Scene.from_dict(tables))
    energies = {
        one.way.name: one.errors.of["interface_energy"] for one in study.measured if not one.errors.failure
    }
    assert math.isnan(energies["fused"])  # nothing is exchanged
    assert 0.0 <= energies["coupled, FMI 3.0"] < 1e-5


def test_what_it_costs_is_counted_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vibroimpact.orchestrator.study.accuracy.study.MOST_ROUNDS", 3)
    for name, values in COARSE.items():
        monkeypatch.setattr(all_ways, name, values)
    short = Scene.from_dict(P11 | {"record": {"recorded_periods": 2}})
    study = whole(AccuracyOfScene(short, tolerance=1e-6, budget=20.0)).comparison
    fused, coupled = study.measured[:2]
    able = [one for one in study.measured if not one.way.model and one.error("all") <= 1e-7]
    assert study.chosen is min(
        able, key=lambda one: one.cost
    )  # by the measured costs, not by an expected winner
    assert fused in able
    assert coupled in able
    assert 0 < fused.calls < coupled.calls
    assert {one.calls for one in study.measured if "CVode" in one.way.name} == {-1}  # FMPy calls it
    assert all(len(one.seconds) >= 3 for one in (fused, coupled))
    assert all(one.cost > 0.0 for one in able)
    assert all(one.memory > 0 for one in (fused, coupled)) or not IS_MEASURED
    assert 0.0 < study.effort.processor < 1.5 * 20.0


@pytest.mark.parametrize(("width", "has_all"), [(80, False), (140, True)])
def test_a_narrow_terminal_has_fewer_columns_and_the_names_of_all_ways(
    rigid: Comparison, width: int, has_all: bool
) -> None:
    console = Console(width=width, record=True, file=io.StringIO())
    console.print(table_of("one", rigid.measured, "all", 0.0, width, 40.0))
    text = console.export_text()
    assert "coupled," in text
    assert "value" in text
    assert ("memory" in text) == has_all
    assert "\N{HORIZONTAL ELLIPSIS}" not in text


def test_the_dataset_says_what_was_found(rigid: Comparison) -> None:
    dataset = dataset_of(rigid)
    assert dataset.attrs["chosen"] == "fused"
    assert dataset.attrs["motion"] == "not chaotic"
    assert set(np.unique(dataset["name"].values)) >= {"fused", "plain steps", "model exchange, CVode"}
    assert np.all(np.isfinite(dataset.error.values) == (dataset.failure.values == ""))


def test_a_chaotic_motion_is_found_out_and_compared_by_its_first_impacts_and_its_statistics() -> None:
    scene = load_scene(
        EXAMPLES / "thesis" / "figure_2_11.toml",
        ["record.transient_periods=50", "record.recorded_periods=250"],
    )
    study = studied_once(scene)
    assert study.reference.chaotic
    assert study.orbit == "chaotic"
    coupled = study.measured[1]
    assert coupled.way.name == "coupled, FMI 3.0"
    growth = coupled.errors.growth
    assert len(growth) >= 10
    assert growth[0] < 1e-13
    assert growth.max() > 10.0 * growth[0]
    assert coupled.statistics is not None
    assert coupled.statistics.distribution_distance < 4.0 * coupled.statistics.distribution_sampling + 1e-12
    assert "chaotic" in advice(study)


@pytest.mark.parametrize("frequency", [0.8, 1.0, 1.05, 2.6])
def test_the_closed_form_is_the_orbit_to_what_the_reference_says_of_itself(frequency: float) -> None:
    tables = P11 | {"forcing": {"amplitude": 0.5, "angular_frequency": frequency}}
    tables |= {"record": {"transient_periods": 400, "recorded_periods": 3}}
    scene = studied_scene(Scene.from_dict(tables))
    reference = reference_of(scene)
    motions = ImpactOscillator.from_scene(scene.text).single_impact_motions(frequency)
    impacts = vi.run(scene, progress=False).vibroimpact.impacts()
    if len(impacts.impact) != 3 or not motions:
        assert "closed form" not in reference.name
        return
    velocity = float(impacts.impact_velocity[0])
    nearest = min(motions, key=lambda motion: abs(motion[0] - velocity))
    assert abs(nearest[0] - velocity) / velocity <= reference.error["impact_velocity"]
    assert abs(nearest[1] - float(impacts.impact_phase[0])) <= 2.0 * math.pi * reference.error["impact_time"]


@pytest.mark.parametrize(
    ("damping", "frequency"), [(0.0, 1.0), (0.0, 0.5), (0.0, 1.0 / 3.0), (2.0, 1.0), (4.0, 1.0)]
)
def test_motions_without_a_closed_form_have_a_reference_all_the_same(
    damping: float, frequency: float
) -> None:
    # a scene that the service received: undamped, in resonance, with a tolerance
    scene = Scene.from_dict(
        {
            "body": {"mass": 1.0, "stiffness": 1.0, "damping": damping},
            "forcing": {"amplitude": 1.0, "angular_frequency": frequency},
            "stop": [{"position": 0.2, "restitution": 0.5}],
            "record": {"transient_periods": 1, "recorded_periods": 2},
        }
    )
    assert reference_of(studied_scene(scene)).name == "the fused run, exact between events"


def test_a_general_scene_is_studied_over_exchanges_and_steps() -> None:
    scene = load_scene(
        EXAMPLES / "two_oscillators.toml", ["record.recorded_time=2", "execution.macro_step=0.05"]
    )
    study = studied_once(scene)
    assert "iterated exchange" in study.reference.name
    for exchange, order in (("jacobi", 1.0), ("gauss_seidel", 1.0), ("iterated", 2.0)):
        steps, errors = ladder(study, f"coupled, {exchange}")
        assert observed_order(steps, errors) == pytest.approx(order, abs=0.2), exchange
        tolerances, errors = ladder(study, f"chosen steps, {exchange}")
        assert observed_order(tolerances, errors) == pytest.approx(order / (order + 1.0), abs=0.2), exchange


def test_a_component_of_another_tool_that_restores_no_state_is_named(tmp_path: Path) -> None:
    theirs = mass(tmp_path, states=False)
    tables = {
        "component": {
            "theirs": {"fmu": str(theirs), "parameters": {"x": 0.5, "k": 4.0}},
            "ours": {"fmu": "Oscillator", "parameters": {"mass": 1.0, "stiffness": 1.0, "damping": 0.1}},
        },
        "connection": [
            {"from": "theirs.x", "to": "ours.force", "gain": 0.5, "gain_unit": "N/m"},
            {"from": "ours.displacement", "to": "theirs.f", "gain": 0.5, "gain_unit": "N/m"},
        ],
        "record": {"recorded_time": 2.0, "variables": ["ours.displacement", "theirs.x"], "rate": 20.0},
        "execution": {"macro_step": 0.1, "guard": False},
    }
    study = studied_once(Scene.from_dict(tables))
    assert study.remarks[0].startswith("iterated exchange with theirs: steps cannot be repeated")
    steps, errors = ladder(study, "coupled, gauss_seidel")
    assert observed_order(steps, errors) == pytest.approx(1.0, abs=0.2)
    np.testing.assert_array_equal(errors, ladder(study, "coupled, iterated")[1])
    assert study.chosen is not None
    assert memory_of_ways(study.scene, {}, [(0, 1.0)]).get(0, 0) > 0 or not IS_MEASURED


CHAOTIC_COMPONENTS: dict[str, Any] = {
    "component": {
        "body": {
            "fmu": "Oscillator",
            "parameters": {
                **{"mass": 1.0, "stiffness": 1.0, "damping": 0.1},
                **{"forcing.amplitude": 1.0, "forcing.angular_frequency": 2.8},
                **{"contact[1].law": "external", "contact[1].position": 0.0},
            },
        },
        "stop": {"fmu": "ImpactStop", "parameters": {"law": "restitution", "restitution": 0.8}},
    },
    "connection": [
        {"from": f"body.contact[1].{name}", "to": f"stop.{name}"} for name in ("displacement", "velocity")
    ]
    + [
        {"from": f"stop.{name}", "to": f"body.contact[1].{name}"}
        for name in ("applied_restitution", "applied_force")
    ],
    "record": {"recorded_time": 200.0, "variables": ["body.displacement"], "rate": 5.0},
    "execution": {"macro_step": 1.0},
}


def test_chaos_of_a_general_scene_is_compared_from_its_start_and_then_by_what_it_samples() -> None:
    study = studied_once(Scene.from_dict(CHAOTIC_COMPONENTS))
    assert study.reference.chaotic
    assert study.scene.record.recorded_time < 100.0
    assert all(one.error("all") < 1e-10 for one in study.measured)
    compared = [one.statistics for one in study.measured if one.statistics is not None]
    assert len(compared) > 10
    assert all(one.distribution_distance < 3.0 * one.distribution_sampling for one in compared)
    assert "only statistics compare" in advice(study)


def test_a_free_motion_without_stops_is_compared_by_its_end() -> None:
    free = {
        "body": {"mass": 1.0, "stiffness": 4.0, "displacement_start": 1.0},
        "record": {"recorded_time": 7.0},
    }
    tolerances, errors = ladder(studied_once(Scene.from_dict(free)), "model exchange, CVode")
    assert len(tolerances) >= 3
    assert np.all(np.diff(errors) < 0.0)


def test_what_cannot_be_compared_is_said(rigid: Comparison) -> None:
    still = {"body": {"mass": 1.0, "stiffness": 4.0}, "record": {"recorded_time": 1.0}}
    assert advice(studied_once(Scene.from_dict(still))).startswith("Nothing that is recorded moves")
    vague = replace(rigid.reference, error=dict.fromkeys(rigid.reference.error, 1.0))
    assert cheapest(rigid.measured, None, "all", vague) is None
    assert "the reference is known to 1e+00 only" in advice(replace(rigid, reference=vague, chosen=None))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"of": "phase"}, "of: expected all, impact_time, impact_velocity"),
        *(
            ({"tolerance": given}, f"tolerance: expected a relative error > 0, got {given!r}")
            for given in (0.0, math.nan, math.inf, "1e-6")
        ),
        (
            {"tolerance": 1e-20},
            r"tolerance: expected a relative error of 1\.4e-14 or more, as double precision has it, got 1e-20",
        ),
        *(
            ({"budget": given}, f"budget: expected a finite processor time of 10 s or more, got {given!r}")
            for given in (0.0, -1.0, 9.9, math.nan, math.inf, None)
        ),
        ({"path": "nowhere/study.nc"}, "expected a place where a file can be written, got no folder"),
        ({"path": "."}, "expected a place where a file can be written, got a folder"),
    ],
)
def test_what_the_arguments_alone_show_is_refused_before_anything_runs(
    monkeypatch: pytest.MonkeyPatch, arguments: dict[str, Any], message: str
) -> None:
    let_nothing_run(monkeypatch)
    modes = STRIP | {"body": STRIP["body"] | {"modes": "auto"}, "execution": {"tolerance": 1e-3}}
    with pytest.raises(UsageError, match=message):
        vi.accuracy(modes | {"stop": [SOFT]}, **arguments)


def test_a_tolerance_below_what_the_reference_is_known_to_is_refused_before_any_way_runs() -> None:
    scene = Scene.from_dict(FREE)
    known = error_of_reference(reference_of(studied_scene(scene)), "all")
    study = AccuracyOfScene(scene, tolerance=0.9 * known)
    with pytest.raises(
        UsageError, match=r"expected a relative error of .*e-14 or more, to which the reference"
    ):
        whole(study)
    assert study.is_empty


def test_a_tolerance_that_no_way_reaches_says_what_was_reached(rigid: Comparison) -> None:
    missed = replace(rigid, tolerance=1e-15, chosen=None)
    with pytest.raises(
        UsageError, match=r"got 1e-15; reached was .*e-1.* by .*, the reference known to .e-1"
    ):
        refuse_unreached(missed)


def test_misuse_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    let_nothing_run(monkeypatch)
    stop = {"law": "kelvin_voigt", "position": 1.0, "stiffness": 1e3, "damping": 1.0, "relaxation_time": 0.1}
    body = {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0]}
    alone = P11 | {
        "body": body,
        "stop": [stop],
        "forcing": {"amplitude": [0.0, 0.5], "angular_frequency": 1.0},
    }
    with pytest.raises(UsageError, match="expected all, impact_time, impact_velocity"):
        vi.accuracy(P11, of="phase")
    with pytest.raises(UsageError, match="expected a relative error > 0, got -1"):
        vi.accuracy(P11, tolerance=-1.0)
    with pytest.raises(UsageError, match="expected a scene with something to vary"):
        vi.accuracy(alone)


def test_a_body_that_starts_on_its_stop_is_disturbed_to_the_free_side() -> None:
    scene = Scene.from_dict(
        {
            "body": {"mass": 1.0, "stiffness": 1.0, "displacement_start": 0.2},
            "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
            "stop": [{"position": 0.2, "restitution": 0.7}],
            "record": {"recorded_periods": 2},
        }
    )
    assert len(reference_of(studied_scene(scene)).observation.impacts)
