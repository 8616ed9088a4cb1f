"""Observed points of several bodies: their motion in time series, and the extremes of the first."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import POINT_COLUMNS
from vibroimpact.analysis.figures.sweep.diagrams import drawable_variables
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.session import Session
from vibroimpact.orchestrator.run.summary import out_of_lanes
from vibroimpact.orchestrator.scene import Scene

OBSERVED: list[Any] = [["frame", "ball"], "ball", "arm.1"]
TABLES: dict[str, Any] = {
    "body": [
        {"name": "frame", "mass": 1.0, "stiffness": 1.0, "damping": 0.05},
        {"name": "ball", "mass": 0.1, "stiffness": 0.0},
        {
            "name": "arm",
            "kind": "chain",
            "masses": [0.5, 0.3],
            "stiffnesses": [1.0, 0.6],
            "dampings": [0.01, 0.006],
        },
    ],
    "link": [{"between": ["frame", "arm.1"], "stiffness": 0.2, "damping": 0.01}],
    "contact": [
        {"between": ["frame", "ball"], "restitution": 0.8, "clearance": 0.1},
        {"between": ["ball", "frame"], "restitution": 0.8, "clearance": 0.1},
    ],
    "forcing": {"at": "frame", "amplitude": 0.3, "angular_frequency": 0.9},
    "record": {"transient_periods": 2, "recorded_periods": 6},
}


def scene(observed: Any, **record: Any) -> Scene:
    own = {"observed": observed} if observed else {}
    return Scene.from_dict(TABLES | {"record": TABLES["record"] | own | record})


def sampled(dataset: xr.Dataset, name: str) -> Any:
    return dataset[name].values


def test_an_observed_point_moves_as_where_it_is_observed_alone() -> None:
    found = vi.run(scene(OBSERVED, time_series={"rate": 20.0}))
    for observed, name in zip(OBSERVED, ("frame_ball", "ball", "arm_1"), strict=True):
        series = {"rate": 20.0, "variables": ["displacement", "velocity"]}
        alone = vi.run(scene([observed], time_series=series))
        for motion in ("displacement", "velocity"):
            ours = sampled(found, f"{motion}_{name}")
            assert ours == pytest.approx(sampled(alone, motion), abs=1e-13), name
        assert (alone.impact_time.values == found.impact_time.values).all()
    assert found.displacement_frame_ball.attrs["long_name"] == "displacement of frame relative to ball"


def test_extremes_are_of_the_first_observed_point() -> None:
    found = vi.run(scene(OBSERVED, time_series={"rate": 500.0}))
    highest, lowest = found.displacement_max.values.max(), found.displacement_min.values.min()
    assert [highest, lowest] == pytest.approx([0.1, -0.1], abs=1e-12)
    way = sampled(found, "displacement_frame_ball")
    assert lowest - 1e-12 <= way.min() < way.max() <= highest + 1e-12


LAWS: list[dict[str, Any]] = [
    {"restitution": 0.8},
    {"restitution": 0.0},
    {"law": "kelvin_voigt", "stiffness": 40.0, "damping": 0.5},
    {"law": "hertz", "stiffness": 300.0},
    {"law": "hunt_crossley", "stiffness": 300.0, "damping": 0.3},
]


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_each_observed_point_has_the_extremes_that_it_has_alone(law: dict[str, Any]) -> None:
    """Flights, rests, and contacts that yield: each has its own search for extremes."""
    pair = {"clearance": 0.1, **law}
    tables = {"contact": [pair | {"between": ["frame", "ball"]}, pair | {"between": ["ball", "frame"]}]}
    power = law.get("law") in ("hertz", "hunt_crossley")
    record = TABLES["record"] | {"recorded_periods": 2}
    whole = vi.run(Scene.from_dict(TABLES | tables | {"record": record | {"observed": OBSERVED}}))
    for observed, name in zip(OBSERVED[1:], ("ball", "arm_1"), strict=True):
        alone = vi.run(Scene.from_dict(TABLES | tables | {"record": record | {"observed": [observed]}}))
        for column in POINT_COLUMNS:
            ours, theirs = whole[f"{column}_{name}"].values, alone[column].values
            assert ours == pytest.approx(theirs, abs=1e-6 if power else 1e-12), (column, name)
    assert whole.displacement_max_ball.attrs["long_name"] == "ball: largest displacement in a period"
    assert whole.displacement_max_ball.dims == ("period",)


def test_one_value_stands_for_all_periods_of_each_observed_point() -> None:
    each, one = vi.run(scene(OBSERVED)), vi.run(scene(OBSERVED, each_period=False))
    assert one.sizes["period"] == 1
    assert one.displacement_max_arm_1.item() == each.displacement_max_arm_1.values.max()
    assert one.displacement_min_arm_1.item() == each.displacement_min_arm_1.values.min()
    assert one.strobe_velocity_ball.item() == each.strobe_velocity_ball.values[-1]


def test_observed_points_are_recorded_without_impacts_or_strobe() -> None:
    found = vi.run(scene(OBSERVED, strobe=False, impacts=False))
    assert {"displacement_max_ball", "displacement_min_arm_1"} <= set(found.variables)
    assert "strobe_velocity_ball" not in found.variables


def test_a_pair_moves_as_its_contact_does() -> None:
    names = ["displacement[frame - ball]", "contact_displacement[1]", "contact_velocity[1]", "velocity"]
    found = vi.run(scene(OBSERVED, time_series={"rate": 20.0, "variables": names}))
    assert found.displacement_frame_ball.values == pytest.approx(
        found.contact_displacement_1.values, abs=1e-14
    )
    assert found.velocity.values == pytest.approx(found.contact_velocity_1.values, abs=1e-14)
    assert found.contact_displacement_1.attrs["long_name"] == "displacement of frame relative to ball"


def test_each_point_of_a_sweep_has_the_shapes_of_its_own_modes() -> None:
    base = scene(OBSERVED, time_series={"rate": 20.0})
    swept = vi.run(base.with_sweep({"body[2].mass": [0.1, 0.4]}))
    for run, mass in enumerate((0.1, 0.4)):
        alone = vi.run(base.with_values({"body[2].mass": mass}))
        own = swept.displacement_ball.values[swept.sample_run.values == run]
        assert own.tolist() == alone.displacement_ball.values.tolist()


def test_more_observed_points_and_their_series_keep_a_sweep_out_of_lanes() -> None:
    sweep = {"forcing.angular_frequency": [0.9, 1.0]}
    assert goes_by_lanes(scene(OBSERVED[:1]).with_sweep(sweep))
    assert not goes_by_lanes(scene(OBSERVED).with_sweep(sweep))
    assert out_of_lanes(scene(OBSERVED).with_sweep(sweep)).startswith("none, as record.observed has more")
    assert not out_of_lanes(scene(OBSERVED[:1]).with_sweep(sweep))
    assert not goes_by_lanes(scene(OBSERVED[:1], time_series={"rate": 5.0}).with_sweep(sweep))


def test_a_session_has_observed_points_as_outputs() -> None:
    outputs = ("displacement[frame - ball]", "displacement")
    with Session(scene(OBSERVED), outputs) as session:
        session.begin({"body[2].mass": 0.3})
        found = session.advance(2.0)
    assert found[outputs[0]] == pytest.approx(found[outputs[1]], abs=1e-14)
    assert found[outputs[0]] != 0.0


def test_a_scene_without_observed_points_keeps_its_identity() -> None:
    assert "observed" not in scene(None).model_dump()["record"]
    assert scene(OBSERVED).model_dump()["record"]["observed"][1] == "ball"


def test_the_text_of_a_scene_keeps_its_observed_points() -> None:
    found = Scene.from_text(scene(OBSERVED, time_series={"rate": 20.0}).to_toml())
    assert found.record.observed == (("frame", "ball"), "ball", "arm.1")
    assert found.sampled[:2] == ("displacement[frame - ball]", "velocity[frame - ball]")


@pytest.mark.parametrize(
    ("observed", "expected"),
    [
        (["wall"], "record.observed[1]: expected a point of a body of this scene"),
        ([["frame"]], "record.observed[1]: expected a point of a body, or an array of two points"),
        ([["frame", "frame"]], "record.observed[1]: expected two points that are not the same"),
        (["ball", "ball"], 'record.observed: expected each point once, got "ball" 2 times'),
        ([["ball", "ground"]], 'record.observed[1][2]: expected a point of a body, got "ground"'),
        ([["ball", "arm.3"]], "record.observed[1][2]: expected"),
        ([f"arm.{i}" for i in range(1, 41)], "record.observed: expected an array of at most 32 points"),
        ([1.0], "record.observed[1]: expected a point of a body, or an array of two points, got 1.0"),
    ],
)
def test_a_mistake_in_observed_points_is_one_line(observed: list[Any], expected: str) -> None:
    with pytest.raises(SceneError) as refused:
        scene(observed)
    (line,) = str(refused.value).splitlines()
    assert line.removeprefix("scene: ").startswith(expected)


def test_one_body_has_no_observed_points() -> None:
    text = '[body]\nmass = 1\nstiffness = 1\n[record]\nrecorded_time = 1\nobserved = ["a"]'
    with pytest.raises(
        SceneError, match=r"record\.observed: expected several bodies beside it, got one body"
    ):
        Scene.from_text(text)


def test_sampled_motion_is_a_sum_of_modes() -> None:
    body = scene(OBSERVED).body
    weights = body.weights_of("velocity[arm.1]")
    assert list(weights) == [f"modal_velocity[{i}]" for i in range(1, 5)]
    assert np.square(list(weights.values())).sum() == pytest.approx(1.0 / 0.5)


@pytest.mark.parametrize("layout", ["netcdf", "zarr"])
def test_a_campaign_stores_each_observed_point_and_goes_on(layout: Any, tmp_path: Path) -> None:
    swept = scene(OBSERVED, recorded_periods=2).with_sweep({"body[2].mass": [0.1, 0.2, 0.3]})
    found = vi.campaign(swept, tmp_path / "map", format=layout)
    alone = vi.run(swept)
    for name in ("displacement_max_ball", "strobe_velocity_arm_1"):
        assert found[name].values.tolist() == alone[name].values.tolist()
        assert found[name].attrs["long_name"] == alone[name].attrs["long_name"]


def test_a_figure_draws_the_extremes_of_an_observed_point(tmp_path: Path) -> None:
    found = vi.run(scene(OBSERVED, recorded_periods=2).with_sweep({"body[2].mass": [0.1, 0.2]}))
    assert "displacement_max_ball" in drawable_variables(found)
    vi.draw(found, variable="displacement_max_ball").savefig(tmp_path / "ball.png")
    series = vi.draw(vi.run(scene(OBSERVED, recorded_periods=2, time_series={"rate": 9.0})))
    assert [axis.get_ylabel() for axis in series.axes] == ["displacement (m)", "velocity (m/s)"]


def test_an_export_is_the_scene_with_its_first_observed_point(tmp_path: Path) -> None:
    files = [
        export_scene(scene(each), tmp_path / f"{len(each)}.fmu", fmi="2.0")
        for each in (OBSERVED, OBSERVED[:1])
    ]
    one, other = (zipfile.ZipFile(file).read("resources/structure.bin") for file in files)
    assert one == other
