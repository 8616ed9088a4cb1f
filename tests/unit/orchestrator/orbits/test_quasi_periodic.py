"""Quasi-periodic motion: after a torus point, under two frequencies, and on the edges of basins."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits.classify import RunClass, classify
from vibroimpact.analysis.orbits.rotation import rotation_of
from vibroimpact.orchestrator.orbits.basins import BasinsOfScene
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow
from vibroimpact.orchestrator.orbits.further_sines import FurtherSines
from vibroimpact.orchestrator.orbits.planes import Plane
from vibroimpact.orchestrator.scene import Scene

CHAIN: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0], "dampings": [0.063, 0.063]},
    "forcing": {"amplitude": [0.42, 0.0], "angular_frequency": 0.885},
    "stop": [{"position": 0.327, "restitution": 0.77, "mass": 2}],
    "record": {"transient_periods": 4000, "recorded_periods": 500, "strobe": True, "extrema": True},
}
RATIO = np.sqrt(2.0)
TWO: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": [
        {"amplitude": 0.5, "angular_frequency": 0.8, "phase": 1.1},
        {"amplitude": 0.05, "angular_frequency": 0.8 * RATIO, "phase": -0.7},
    ],
    "stop": [{"position": 0.6, "restitution": 0.7}],
    "record": {"transient_periods": 300, "recorded_periods": 200, "strobe": True, "extrema": True},
}


def classes(document: dict[str, Any]) -> list[RunClass]:
    return classify(vi.run(document))


def test_after_a_torus_point_the_rotation_number_is_the_angle_of_the_multipliers() -> None:
    runs = vi.follow(CHAIN, "forcing.angular_frequency", 0.88, 0.89, doublings=0, grazes=0).vibroimpact.runs
    torus = runs.isel(run=np.flatnonzero(runs["orbit_special"].values == SpecialOrbit.torus)[:1])
    multiplier = complex(torus["orbit_multiplier_real"].item(), torus["orbit_multiplier_imaginary"].item())
    angle = abs(np.angle(multiplier)) / (2.0 * np.pi)
    at = torus["angular_frequency"].item()
    away = np.array([-2e-3, -1e-3])
    found = classes({**CHAIN, "sweep": {"forcing.angular_frequency": {"values": (at + away).tolist()}}})
    assert [each.name for each in found] == ["quasi-periodic"] * 2
    numbers = [each.rotation.number for each in found if each.rotation is not None]
    # the number varies smoothly with the frequency: its line through both meets the torus point
    assert 2.0 * numbers[1] - numbers[0] == pytest.approx(angle, abs=1e-5)
    assert numbers[1] == pytest.approx(angle, abs=2e-3)
    beyond = classes({**CHAIN, "forcing": {**CHAIN["forcing"], "angular_frequency": at + 2e-3}})
    assert beyond[0].name == "P(1,1)"


def test_under_two_frequencies_the_rotation_number_is_their_ratio() -> None:
    swept = {**TWO, "sweep": {"forcing[2].angular_frequency": {"values": [0.8 * RATIO, 0.8 * 1.618034]}}}
    for document, ratios in ((TWO, [RATIO]), (swept, [RATIO, 1.618034])):
        dataset = classify(vi.run(document)).dataset
        runs = dataset.vibroimpact.runs
        assert (runs["class_kind"].values == 6).all()
        turns = np.mod(ratios, 1.0)
        assert runs["class_rotation_number"].values == pytest.approx(np.minimum(turns, 1.0 - turns), abs=1e-9)


def test_forces_that_never_repeat_are_still_refused() -> None:
    chirp = {"signal": "random", "amplitude": 0.1, "band": [0.5, 2.0], "seed": 1}
    with pytest.raises(vi.VibroimpactError, match="classify: expected forces with a common period"):
        classes({**TWO, "forcing": [TWO["forcing"][0], chirp]})


@pytest.mark.parametrize("how", ["auto", "fused"])
@pytest.mark.parametrize("restitution", [0.7, 0.0])
def test_phases_of_further_sines_go_on_from_one_run_to_the_next(how: str, restitution: float) -> None:
    scene = Scene.from_dict(
        {
            **TWO,
            "forcing": [*TWO["forcing"], {"amplitude": 0.1, "angular_frequency": 0.51, "phase": 0.3}],
            "stop": [{"position": 0.6, "restitution": restitution}],
            "execution": {"how": how},
        }
    )
    sines = FurtherSines.of(scene)
    starts = np.random.default_rng(2).uniform(-0.5, 0.5, (4, 2))
    states = np.concatenate([starts, np.tile(sines.start, (4, 1))], axis=1)
    flow = BodyFlow(scene, workers=1)
    try:
        begun = flow.follow(states, 7, first=True).states
        on, whole = flow.follow(begun, 5).states, flow.follow(states, 12, first=True).states
    finally:
        flow.close()
    assert on == pytest.approx(whole, abs=1e-11)
    single = {"record.transient_periods": 0, "record.recorded_periods": 13}
    for start, end in zip(starts, whole, strict=True):
        own = dict(zip(("body.displacement_start", "body.velocity_start"), start.tolist(), strict=True))
        last = vi.run(scene.with_values(single | own))
        assert last["strobe_displacement"].values.ravel()[-1] == pytest.approx(end[0], abs=1e-11)


def test_basins_under_two_frequencies_name_the_curves_on_which_starts_end() -> None:
    scene = Scene.from_dict(TWO)
    found = vi.basins(scene, (-0.6, 0.6), (-1.0, 1.0), (3, 3))
    assert found.attrs["decided"] == 1.0
    place = int(np.argmax(found["basin_fraction"].values))
    assert str(found["attractor_name"].values[place]).startswith(
        "quasi-periodic, rotation number 0.4142135624"
    )
    assert found["attractor_rotation_number"].values[place] == pytest.approx(RATIO - 1.0, abs=1e-9)
    assert found["attractor_exponent"].values[place] < 0.0, "it attracts"
    section = np.column_stack(
        [found[f"section_{what}"].values[place] for what in ("displacement", "velocity")]
    )
    assert rotation_of(section, RATIO) is not None, "the curve that is drawn"


def test_planes_of_an_oscillator_under_several_forces_are_displacements_of_its_mass() -> None:
    # four times the mass, spring and force is the same motion
    heavy = {
        **TWO,
        "body": {"mass": 4.0, "stiffness": 4.0, "damping_ratio": 0.05},
        "forcing": [{**force, "amplitude": 4.0 * force["amplitude"]} for force in TWO["forcing"]],
    }
    one, other = (BasinsOfScene(Scene.from_dict(each), Plane(points=(3, 3))) for each in (TWO, heavy))
    assert other.x == pytest.approx(one.x)
    assert other.y == pytest.approx(one.y)
    assert one.x[-1] == pytest.approx(0.6), "the stop"
    found = vi.basins(heavy, (-0.9, 0.9), (-1.0, 1.0), (3, 2))
    assert found["displacement_start"].attrs["long_name"] == "displacement at the start"
    assert (found["basin"].values[:, -1] == -2).all(), "0.9 is beyond the stop at 0.6"
    drawn = found["section_displacement"].values[int(np.argmax(found["basin_fraction"].values))]
    assert 0.55 < drawn.max() <= 0.6 + 1e-12


def test_a_stop_that_moves_with_another_frequency_is_refused_by_basins() -> None:
    moving = {**TWO["stop"][0], "motion_amplitude": 0.1, "motion_angular_frequency": 0.3}
    with pytest.raises(
        vi.VibroimpactError, match="expected stops that stand still under sines without a common"
    ):
        vi.basins({**TWO, "stop": [moving]}, points=(4, 4))
