"""Constants of a scene in its dataset: they keep datasets of two scenes apart after a join."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.campaign_scenes import assert_same_rows, scene_of
from support.dataset_examples import dataset_of, record
from support.serial_pool import campaign_here

from vibroimpact.analysis import open_dataset
from vibroimpact.analysis.dataset import constant_names, merge_datasets, with_constants, write_dataset
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER

SCENE = """
[body]
mass = 1.0
stiffness = 4.0
damping_ratio = 0.05
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = {position}
restitution = 0.7
[record]
transient_periods = 5
recorded_periods = 2
{sweep}
"""
FREQUENCIES = """
[sweep]
"stop[1].restitution" = { values = [0.5, 0.8] }
"forcing.angular_frequency" = { values = [0.7, 0.9, 1.1] }
"""


def opened(folder: Path, text: str) -> xr.Dataset:
    run_scene(scene_of(text), folder / "run.nc")
    with open_dataset(folder / "run.nc") as dataset:
        return dataset.load()


def constants(dataset: xr.Dataset) -> dict[str, float]:
    return {name: float(dataset[name]) for name in constant_names(dataset)}


def test_two_campaigns_are_joined_along_what_neither_sweeps(tmp_path: Path) -> None:
    near, far = (opened(tmp_path, SCENE.format(position=p, sweep=FREQUENCIES)) for p in (0.1, 0.2))
    joined = xr.concat([near.displacement_range, far.displacement_range], dim="position")
    assert joined.position.values.tolist() == [0.1, 0.2]
    xr.testing.assert_equal(joined.sel(position=0.2, drop=True), far.displacement_range.drop_vars("position"))
    whole = xr.concat([one.drop_dims(["impact", "stick"]) for one in (near, far)], dim="position")
    assert whole.impact_count.sel(position=0.1).equals(near.impact_count)
    assert float(joined.damping_ratio) == 0.05


def test_what_is_swept_is_not_beside_itself(tmp_path: Path) -> None:
    dataset = opened(tmp_path, SCENE.format(position=0.1, sweep=FREQUENCIES))
    assert constants(dataset) == {
        **dict.fromkeys(("displacement_start", "velocity_start", "phase", "yield_velocity"), 0.0),
        **dict.fromkeys(("frequency_slope", "damping_slope", "damping_reciprocal"), 0.0),
        **{"mass": 1.0, "stiffness": 4.0, "damping_ratio": 0.05, "amplitude": 0.5, "position": 0.1},
    }
    assert dataset.position.attrs["units"] == "m"
    assert dataset.damping_reciprocal.attrs["long_name"] == "damping reciprocal"
    assert {"restitution", "angular_frequency"} <= set(dataset.dims)


def test_two_stops_are_named_as_a_sweep_of_both_would_name_them(tmp_path: Path) -> None:
    lower = '[[stop]]\nlaw = "hertz"\nposition = -1.0\nside = "lower"\nstiffness = 9.0\n'
    sweep = '[sweep]\n"body.stiffness" = { values = [4.0, 5.0] }'
    text = SCENE.replace("[record]", lower + "[record]").format(position=0.1, sweep=sweep)
    found = opened(tmp_path, text)
    assert constants(found).items() >= {"stop_1_position": 0.1, "stop_2_position": -1.0}.items()
    # the swept stiffness has the short name, so the other one names its stop
    assert found.stiffness.values.tolist() == [4.0, 5.0]
    assert float(found.stop_2_stiffness) == 9.0
    assert found.stop_2_stiffness.attrs["units"] == "1"
    assert "N/m^1.5" in found.stop_2_stiffness.attrs["long_name"]


def test_a_number_with_the_name_of_a_dimension_has_another_name(tmp_path: Path) -> None:
    for dimension, value in {"amplitude": 0.5, "damping_ratio": 0.05}.items():
        sweep = f'[sweep]\n"body.mass" = {{ values = [1.0, 2.0], zip = "{dimension}" }}'
        dataset = opened(tmp_path, SCENE.format(position=0.1, sweep=sweep))
        assert dataset.displacement_range.dims == dataset.mass.dims == (dimension,)
        assert constants(dataset)[f"{dimension}_2"] == value
        assert dataset[dimension].values.tolist() == [1.0, 2.0]


def test_of_two_keys_for_one_thing_the_one_that_counts_is_there(tmp_path: Path) -> None:
    text = SCENE.format(position=0.1, sweep="").replace("angular_frequency = 0.8", "frequency = 0.2")
    found = constants(opened(tmp_path, text.replace("damping_ratio = 0.05", "damping = 0.1")))
    assert (found["damping"], found["frequency"]) == (0.1, 0.2)
    assert found.keys().isdisjoint({"damping_ratio", "angular_frequency"})


def test_the_masses_of_a_chain_are_told_one_by_one(tmp_path: Path) -> None:
    text = """
    [scene]
    units = "nondimensional"
    [body]
    kind = "chain"
    masses = [1.0, 2.0]
    stiffnesses = 3.0
    displacement_start = [0.5, 0.0]
    [record]
    recorded_time = 1.0
    [sweep]
    "body.masses[2]" = { values = [2.0, 4.0] }
    """
    dataset = opened(tmp_path, text)
    expected = {"masses_1": 1.0, "stiffnesses": 3.0, "displacement_start_1": 0.5}
    assert constants(dataset).items() >= expected.items()
    assert dataset.masses_2.values.tolist() == [2.0, 4.0]
    assert dataset.masses_1.attrs["units"] == "1"


def test_a_sampled_variable_keeps_its_name_beside_a_number_of_the_same(tmp_path: Path) -> None:
    text = """
    [component.a]
    fmu = "Oscillator"
    parameters = { mass = 2.0, stiffness = 1.0, "displacement_start" = 0.1 }
    [component.b]
    fmu = "Oscillator"
    parameters = { mass = 3.0, stiffness = 1.0 }
    [[connection]]
    from = "a.displacement"
    to = "b.force"
    gain = 0.5
    gain_unit = "N/m"
    [record]
    recorded_time = 1.0
    variables = ["a.mass", "b.displacement"]
    rate = 10
    [execution]
    macro_step = 0.1
    [sweep]
    "b.stiffness" = { values = [1.0, 2.0] }
    """
    dataset = opened(tmp_path, text)
    assert (dataset.a_mass.dims, dataset.a_mass.attrs["component_variable"]) == (("sample",), "a.mass")
    assert constants(dataset) == {
        **{"a_mass_2": 2.0, "b_mass": 3.0, "a_stiffness": 1.0, "displacement_start": 0.1, "gain": 0.5}
    }
    assert dataset.gain.attrs["units"] == "N/m"
    assert dataset.b_mass.attrs["units"] == "kg"


def test_numbers_of_components_need_no_name_that_tells_their_unit(tmp_path: Path) -> None:
    text = """
    [scene]
    units = "nondimensional"
    [component.a]
    fmu = "Oscillator"
    parameters = { mass = 1.0, stiffness = 1.0, "contact[1].law" = "restitution", "contact[1].position" = 0.5 }
    [record]
    recorded_time = 1.0
    [sweep]
    "a.contact[1].side" = { values = [1, 2] }
    """
    dataset = opened(tmp_path, text)
    assert constants(dataset).items() >= {"law": 1.0, "position": 0.5}.items()
    assert {dataset[name].attrs["units"] for name in ("law", "position", "side", "mass")} == {"1"}


@pytest.mark.parametrize("key", ["frequency_slope", "damping_slope", "damping_reciprocal"])
def test_what_depends_on_the_amplitude_is_swept_like_any_number(key: str, tmp_path: Path) -> None:
    sweep = f'[sweep]\n"body.{key}" = {{ values = [0.0, 0.01] }}'
    dataset = opened(tmp_path, SCENE.format(position=0.1, sweep=sweep))
    assert dataset[key].attrs["units"] == ("m" if key == "damping_reciprocal" else "m-1")


def test_dimensions_are_in_the_order_of_the_scene(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = SCENE.format(position=0.1, sweep=FREQUENCIES)
    assert opened(tmp_path, text).displacement_range.dims == ("restitution", "angular_frequency")
    campaign_here(monkeypatch, text, tmp_path / "campaign", runner=DEFAULT_RUNNER)
    with open_dataset(tmp_path / "campaign") as campaign:
        assert campaign.displacement_range.dims == ("restitution", "angular_frequency")
    assert_same_rows(tmp_path / "run.nc", tmp_path / "campaign" / "dataset.nc")


def test_a_campaign_that_goes_on_along_what_it_had_not_swept_has_it_as_an_axis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = SCENE.format(position=0.1, sweep=FREQUENCIES)
    campaign_here(monkeypatch, text, tmp_path)
    longer = text + '"stop[1].position" = { values = [0.1, 0.3] }\n'
    campaign_here(monkeypatch, longer, tmp_path)
    with open_dataset(tmp_path) as campaign:
        assert campaign.outcome.dims == ("restitution", "angular_frequency", "position")
        assert "position" not in constants(campaign)
    campaign_here(monkeypatch, text.replace("0.9, 1.1", "0.9"), tmp_path)
    with open_dataset(tmp_path) as campaign:
        assert float(campaign.position) == 0.1
    [earlier] = tmp_path.glob("earlier-*.nc")
    with open_dataset(earlier) as left:
        assert constants(left)["mass"] == 1.0
        assert "position" in left.dims


def test_files_of_two_scenes_are_not_merged(tmp_path: Path) -> None:
    for place, restitution in enumerate((0.7, 0.8)):
        dataset = dataset_of([record(1.0)], run_index=[place])
        constant = with_constants(dataset, {"restitution": restitution}, unit_of={"restitution": "1"})
        write_dataset(constant, tmp_path / f"{place}.nc")
    with pytest.raises(DatasetError, match=r"restitution: expected those of .* \(0.7\), got 0.8"):
        merge_datasets([tmp_path / "0.nc", tmp_path / "1.nc"])


def test_one_run_is_chosen_by_what_is_not_swept_too(tmp_path: Path) -> None:
    dataset = opened(tmp_path, SCENE.format(position=0.1, sweep=FREQUENCIES))
    impacts = dataset.vibroimpact.impacts(position=0.1, restitution=0.5, angular_frequency=0.9)
    assert float(impacts.mass) == 1.0
    with pytest.raises(DatasetError, match=r"position: expected 0.1, the only value there is, got 0.3"):
        dataset.vibroimpact.impacts(position=0.3)
    flat = dataset.vibroimpact.runs
    assert flat.position.ndim == 0
    assert np.array_equal(flat.restitution, [0.5, 0.5, 0.5, 0.8, 0.8, 0.8])
