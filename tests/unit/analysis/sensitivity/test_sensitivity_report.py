"""Sobol indices of campaigns: real campaigns, failed runs, and datasets without a whole design."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process

import vibroimpact as vi
from vibroimpact.analysis.dataset import Outcome, open_measured
from vibroimpact.analysis.operations import sensitivity as declared
from vibroimpact.analysis.sensitivity import LEVEL, RESAMPLES, sensitivity_report

SCENE = """
[body]
mass = 1.0
stiffness = 1.0
[forcing]
amplitude = 1.0
angular_frequency = 1.0
[[stop]]
position = 100.0
restitution = 0.7
[record]
transient_periods = 100
recorded_periods = 2
time_series = { rate = 10, variables = ["velocity"] }
[sweep]
sample = { design = "saltelli", points = 128, seed = 2 }
"forcing.amplitude" = { distribution = "uniform", low = 1.0, high = 3.0 }
"body.damping" = { distribution = "uniform", low = 0.1, high = 0.3 }
"""


def exact() -> tuple[list[float], list[float]]:
    """Return first-order and total indices of the range 2 F / (c w) at resonance, a product of two random numbers."""
    force, force_squared = 2.0, 13.0 / 3.0
    flexible, flexible_squared = math.log(0.3 / 0.1) / 0.2, 1.0 / (0.1 * 0.3)
    variance = force_squared * flexible_squared - (force * flexible) ** 2
    of_force, of_damping = force_squared - force**2, flexible_squared - flexible**2
    first = [of_force * flexible**2 / variance, of_damping * force**2 / variance]
    total = [of_force * flexible_squared / variance, of_damping * force_squared / variance]
    return first, total


def ran(text: str) -> xr.Dataset:
    return vi.run(vi.Scene.from_text(text), progress=False)


@pytest.fixture(scope="module")
def dataset() -> xr.Dataset:
    return ran(SCENE)


@pytest.fixture(scope="module")
def file(dataset: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("runs") / "runs.nc"
    dataset.to_netcdf(path)
    return path


def test_the_range_at_resonance_has_the_indices_of_force_over_damping(dataset: xr.Dataset) -> None:
    found = sensitivity_report(dataset, seed=1)
    assert found.parameter.values.tolist() == ["amplitude", "damping"]
    for quantity in ("displacement_range", "velocity_rms"):
        for order, truth in zip(("first_order", "total_order"), exact(), strict=True):
            assert found[order].sel(quantity=quantity).values == pytest.approx(truth, abs=0.06)
            ends = found[f"{order}_interval"].sel(quantity=quantity)
            assert (ends.sel(bound="lower") <= truth).all()
            assert (truth <= ends.sel(bound="upper")).all()


def test_the_order_of_keys_in_the_scene_is_that_of_their_indices() -> None:
    lines = SCENE.strip().splitlines()
    turned = sensitivity_report(ran("\n".join([*lines[:-2], lines[-1], lines[-2]])), ["displacement_range"])
    assert turned.parameter.values.tolist() == ["damping", "amplitude"]
    assert turned.total_order.values[0] == pytest.approx(exact()[1][::-1], abs=0.06)


def test_a_key_beside_the_drawn_ones_stays_a_dimension():
    text = SCENE.replace("128", "16") + '"body.stiffness" = { values = [4.0, 1.0, 9.0] }\n'
    found = sensitivity_report(ran(text), ["displacement_range"])
    assert found.total_order.dims == ("quantity", "stiffness", "parameter")
    alone = sensitivity_report(ran(text.replace("[4.0, 1.0, 9.0]", "[9.0]")), ["displacement_range"])
    np.testing.assert_allclose(
        found.total_order.sel(stiffness=9.0), alone.total_order.squeeze("stiffness"), rtol=1e-9
    )


def test_indices_along_a_path_are_drawn_as_lines_up_and_down_apart() -> None:
    path = '"forcing.angular_frequency" = { start = 0.9, stop = 1.1, points = 3, path = "up-down" }\n'
    text = SCENE.replace("128", "8").replace("transient_periods = 100", "transient_periods = 10")
    found = vi.sensitivity(ran(text + path), of="displacement_range")
    assert found.total_order.dims == ("quantity", "direction", "angular_frequency", "parameter")
    (axis,) = vi.draw(found).axes
    assert [line.get_label() for line in axis.lines] == [
        f"{name}, {way}" for name in ("amplitude", "damping") for way in ("up", "down")
    ]
    assert [line.get_linestyle() for line in axis.lines] == ["-", "--"] * 2
    np.testing.assert_array_equal(axis.lines[0].get_ydata(), found.total_order[0, 0, :, 0])
    two = found.expand_dims(gap=[1.0, 2.0], axis=1)
    with pytest.raises(
        vi.VibroimpactError, match="expected indices along one other key at most, got gap, direction"
    ):
        vi.draw(two)


def test_bars_are_the_indices_of_what_varies(dataset: xr.Dataset) -> None:
    found = vi.sensitivity(dataset)
    axes = vi.draw(found).axes
    assert [axis.get_title() for axis in axes] == ["displacement range", "velocity rms"]
    for quantity, axis in zip(("displacement_range", "velocity_rms"), axes, strict=True):
        first, total = (
            [bar.get_width() for bar in group] for group in axis.containers if hasattr(group, "patches")
        )
        assert first == found.first_order.sel(quantity=quantity).values.tolist()
        assert total == found.total_order.sel(quantity=quantity).values.tolist()


def test_a_dimension_with_a_name_of_the_report_is_refused() -> None:
    found = ran(SCENE.replace("128", "8") + '"body.stiffness" = { values = [1.0, 2.0], zip = "bound" }\n')
    with pytest.raises(vi.VibroimpactError, match="bound: expected a dimension of another name"):
        sensitivity_report(found)


def test_runs_that_failed_are_left_out_with_their_blocks_and_told(dataset: xr.Dataset):
    outcome = dataset.outcome.copy(data=dataset.outcome.values.copy())
    outcome[[3, 17, 18]] = [Outcome.error, Outcome.crash, Outcome.timeout]
    found = sensitivity_report(dataset.assign(outcome=outcome))
    assert set(found.blocks.values.tolist()) == {126}
    assert "displacement_range: 2 of 128 blocks are left out, for runs that failed" in found.remarks
    whole = sensitivity_report(dataset)
    np.testing.assert_allclose(found.total_order, whole.total_order, atol=0.1)


def test_quantities_that_do_not_vary_are_told(dataset: xr.Dataset):
    found = sensitivity_report(dataset)
    assert "impact_velocity is the same for all draws: it has no indices." in found.remarks
    assert np.isnan(found.total_order.sel(quantity="impact_velocity")).all()
    with pytest.raises(
        vi.VibroimpactError, match="expected a quantity that varies, got none: impact_velocity is"
    ):
        sensitivity_report(dataset, ["impact_velocity"])


def test_where_all_runs_failed_there_is_one_line(dataset: xr.Dataset):
    failed = dataset.assign(outcome=dataset.outcome * 0 + int(Outcome.error))
    with pytest.raises(
        vi.VibroimpactError, match="got none: displacement_range has fewer than 8 whole blocks"
    ):
        sensitivity_report(failed, ["displacement_range"])


OTHER = {
    "a sweep of mass": SCENE.partition("sample")[0] + '"body.mass" = { values = [1.0, 2.0] }',
    "no sweep": SCENE.partition("[sweep]")[0],
    'a design "sobol"': SCENE.replace("saltelli", "sobol"),
    'a design "random"': SCENE.replace('saltelli", points = 128', 'random", points = 127'),
}


@pytest.mark.parametrize("got", OTHER)
def test_points_that_are_drawn_in_another_way_are_refused_in_one_line(got: str):
    with pytest.raises(
        vi.VibroimpactError, match=f"of a Saltelli design|a Saltelli design, got {got}"
    ) as caught:
        sensitivity_report(ran(OTHER[got]))
    assert got in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "chosen",
    [
        {"draw": slice(2, None)},
        {"draw": slice(None, 101)},
        {"draw": slice(1, 509)},
        {"draw": [2, 0, 1, 3]},
        {"draw": slice(None, None, 4)},
        {"draw": 0},
        {"draw": slice(0, 0)},
    ],
    ids=str,
)
def test_blocks_that_are_not_whole_are_refused_in_one_line(dataset: xr.Dataset, chosen: dict[str, object]):
    with pytest.raises(
        vi.VibroimpactError, match="expected whole blocks of 4 runs of a Saltelli design"
    ) as caught:
        sensitivity_report(dataset.isel(chosen))
    assert "\n" not in str(caught.value)


def test_whole_blocks_of_a_design_are_a_design(dataset: xr.Dataset):
    found = sensitivity_report(dataset.isel(draw=slice(0, 4 * 32)))
    assert found.attrs["blocks_drawn"] == 32
    assert found.total_order.sel(quantity="displacement_range").values == pytest.approx(exact()[1], abs=0.2)


def test_what_was_not_recorded_is_no_quantity(dataset: xr.Dataset):
    with pytest.raises(
        vi.VibroimpactError, match=r"quantity: expected one of displacement_range, .*, got 'range'"
    ):
        sensitivity_report(dataset, ["range"])
    nothing = SCENE.replace(
        "recorded_periods = 2", "recorded_periods = 2\nextrema = false\nimpacts = false\nstrobe = false"
    )
    bare = ran(nothing.replace('time_series = { rate = 10, variables = ["velocity"] }', ""))
    with pytest.raises(vi.VibroimpactError, match="expected something recorded of each run, got nothing"):
        sensitivity_report(bare)


def test_the_command_prints_writes_and_draws(dataset: xr.Dataset, tmp_path: Path):
    vi.run(vi.Scene.from_text(SCENE), tmp_path / "runs.nc", progress=False)
    words = ("sensitivity", tmp_path / "runs.nc", "-o", tmp_path / "s.nc", "--figure", tmp_path / "s.png")
    result = in_this_process(*words)
    assert result.returncode == 0
    assert "damping" in result.stdout
    assert "impact_velocity is the same for all draws" in result.stdout
    written = open_measured(tmp_path / "s.nc")
    np.testing.assert_array_equal(written.total_order, vi.sensitivity(dataset).total_order)
    np.testing.assert_array_equal(written.total_order, vi.sensitivity(tmp_path / "runs.nc").total_order)
    assert (tmp_path / "s.png").stat().st_size > 1000
    assert in_this_process(*words).returncode == 0
    assert in_this_process("plot", tmp_path / "s.nc", "-o", tmp_path / "again.png").returncode == 0
    assert in_this_process("describe", tmp_path / "s.nc").returncode == 0


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--of", "speed"], "quantity: expected one of"),
        (["--level", "2"], "level: expected a number between 0 and 1, got 2.0"),
        (["-o", "s.txt"], "expected a name ending in .nc"),
        (["--figure", "s.gif"], "expected a name ending in .png"),
    ],
)
def test_a_wrong_option_is_one_line_and_exit_code_2(file: Path, options: list[str], text: str):
    result = in_this_process("sensitivity", file, *options)
    assert result.returncode == 2
    assert text in result.stderr


def test_a_file_that_is_no_campaign_is_one_line(tmp_path: Path):
    (tmp_path / "a.nc").write_text("no")
    for file in (tmp_path / "a.nc", tmp_path / "absent.nc", tmp_path):
        result = in_this_process("sensitivity", file)
        assert result.returncode == 2
        assert len(result.stderr.splitlines()) == 1


def test_the_command_has_the_defaults_of_the_function() -> None:
    assert (declared.LEVEL, declared.RESAMPLES) == (LEVEL, RESAMPLES)
