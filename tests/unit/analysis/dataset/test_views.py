"""`ds.vibroimpact` in a notebook, the table of all impacts, and the entry point of xarray."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.dataset_examples import dataset_of, record, up_down
from support.places import ROOT

from vibroimpact.analysis.dataset import open_dataset, write_dataset
from vibroimpact.analysis.dataset.backend import VibroimpactBackend
from vibroimpact.analysis.dataset.results import ResultTable, write_results
from vibroimpact.fmus.errors import DatasetError


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_dataset(up_down(), tmp_path / "runs.nc")
    return tmp_path / "runs.nc"


def test_the_table_has_the_impacts_of_each_run_with_its_parameters(file: Path) -> None:
    with open_dataset(file) as opened:
        table = opened.vibroimpact.impacts_table()
        assert table.sizes["impact"] == opened.sizes["impact"]
        assert table.angular_frequency.attrs["units"] == "rad s-1"
        runs = opened.vibroimpact.runs
        for place in range(runs.sizes["run"]):
            one = opened.vibroimpact.impacts(run_id=place)
            own = table.isel(impact=table.run_id.values == place)
            np.testing.assert_array_equal(own.impact_velocity, one.impact_velocity)
            assert set(own.angular_frequency.values) <= {float(runs.angular_frequency[place])}
            assert set(own.direction.values) <= {str(runs.direction[place].values)}


def test_the_table_is_the_same_in_one_dimension(file: Path) -> None:
    with open_dataset(file) as opened, xr.open_dataset(file, decode_timedelta=False) as flat:
        table, other = (one.vibroimpact.impacts_table() for one in (opened, flat))
        for name in (*table.data_vars, "run_index", "angular_frequency"):
            np.testing.assert_array_equal(table[name], other[name])


def test_a_dataset_without_impacts_has_no_table() -> None:
    dataset = dataset_of([record(1.0)]).drop_dims("impact")
    with pytest.raises(DatasetError, match="impacts: expected them in the dataset, got none recorded"):
        dataset.vibroimpact.impacts_table()


def test_the_accessor_says_what_there_is(file: Path) -> None:
    with open_dataset(file) as opened:
        named = opened.assign_attrs(title="<b>x</b>\x07")
        text, page = repr(named.vibroimpact), named.vibroimpact._repr_html_()
    assert "runs: 6 (6 ok); angular_frequency: 0 to 2 rad s-1, 3 values" in text
    assert "\x07" not in text + page
    assert "&lt;b&gt;x&lt;/b&gt;" in page


def test_the_engine_opens_runs_as_open_dataset_does(file: Path) -> None:
    with xr.open_dataset(file, engine=VibroimpactBackend) as opened, open_dataset(file) as ours:
        xr.testing.assert_identical(opened, ours)
    with xr.open_dataset(file, engine=VibroimpactBackend, drop_variables=["message", "other"]) as opened:
        assert "message" not in opened


def test_the_engine_opens_results_and_refuses_what_is_foreign(tmp_path: Path) -> None:
    table = ResultTable("peaks", ("at_#", "peak", "m", "place {of} #"))
    write_results(table.dataset({"at_2": [1.0]}, of="of"), tmp_path / "peaks.nc", kind="peaks")
    with xr.open_dataset(tmp_path / "peaks.nc", engine=VibroimpactBackend) as opened:
        assert opened.at_2.attrs["long_name"] == "place of 2"
    xr.Dataset({"x": 1.0}).to_netcdf(tmp_path / "foreign.nc")
    with pytest.raises(DatasetError, match=r"foreign.nc"):
        xr.open_dataset(tmp_path / "foreign.nc", engine=VibroimpactBackend)
    with pytest.raises(DatasetError, match="expected the path of a file or folder, got bytes"):
        xr.open_dataset(b"CDF", engine=VibroimpactBackend)
    assert not VibroimpactBackend().guess_can_open(tmp_path / "foreign.nc")


def test_xarray_loads_the_engine_and_nothing_heavy_with_it() -> None:
    entry = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["entry-points"]
    module, _, name = entry["xarray.backends"]["vibroimpact"].partition(":")
    script = f"""
import sys, xarray
from xarray.backends import BackendEntrypoint
there = set(sys.modules)
from {module} import {name}
print(sorted(each for each in set(sys.modules) - there if not each.startswith("vibroimpact")))
print(sum(each.startswith("vibroimpact") for each in sys.modules), xarray.Dataset.vibroimpact is not None)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == ["[]", "5 True"]
