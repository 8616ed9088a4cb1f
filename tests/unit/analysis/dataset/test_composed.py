"""A composed dataset gives its parts back as they were, from memory and from a file."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from support.scenes import FORCED

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_measured
from vibroimpact.analysis.dataset.composed import composed, part_of
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.fmus.errors import DatasetError

TABLE = ResultTable(
    "peaks",
    ("at", "peak", "rad s-1", "frequency of the peak"),
    ("peak", "peak", "1", "number"),
    ("name", "peak", "1", "what it is", "text"),
    ("width", "", "rad s-1", "width of all peaks"),
)


def _peaks(values: list[float], width: float) -> xr.Dataset:
    names = [f"peak {number}" for number in range(len(values))]
    return TABLE.dataset(
        {"at": values, "peak": np.arange(len(values)), "name": names, "width": width}, {"seen": len(values)}
    )


numbers = st.floats(-1e6, 1e6)
parts = st.dictionaries(
    st.sampled_from(["first", "second", "third"]),
    st.builds(_peaks, st.lists(numbers, min_size=1, max_size=4), numbers),
    min_size=1,
)


@given(parts)
def test_parts_come_back_with_their_variables_dimensions_and_attributes(parts: dict[str, xr.Dataset]) -> None:
    whole = composed("several", parts, {"title": "all"})
    assert (whole.attrs["results_kind"], whole.attrs["title"]) == ("several", "all")
    for name, part in parts.items():
        xr.testing.assert_identical(part_of(whole, name), part)


def test_runs_come_back_from_a_file_as_they_are_opened(tmp_path: Path) -> None:
    scene = vi.Scene.from_text(FORCED).with_sweep(
        {
            "body.mass": {"values": [1.0, 1.1], "zip": "size"},
            "body.stiffness": {"values": [1.0, 1.2], "zip": "size"},
        }
    )
    runs = vi.run(scene, tmp_path / "runs.nc")
    with xr.open_dataset(tmp_path / "runs.nc", engine="netcdf4", decode_times=False) as flat:
        stored = flat.load().drop_encoding()
    for variable in stored.variables.values():
        variable.attrs.pop("_FillValue", None)
    whole = composed("several", {"runs": stored, "peaks": _peaks([1.0], 2.0)}, {})
    vi.write_results(whole, tmp_path / "all.nc")
    with open_measured(tmp_path / "all.nc") as read:
        found = part_of(read, "runs")
        assert found.sizes == runs.sizes
        assert dict(found.run_id.sizes) == dict(runs.run_id.sizes)
        for name in ("displacement_max", "displacement_range", "impact_velocity", "mass", "restitution"):
            xr.testing.assert_equal(found[name], runs[name].load())
        assert found.vibroimpact.impacts(mass=1.1).sizes == runs.vibroimpact.impacts(mass=1.1).sizes


def test_an_unknown_part_is_named_with_those_there_are() -> None:
    whole = composed("several", {"peaks": _peaks([1.0], 2.0)}, {})
    with pytest.raises(DatasetError, match=r"expected one of those there are \(peaks\), got 'runs'"):
        part_of(whole, "runs")
    with pytest.raises(DatasetError, match=r"\(none\)"):
        part_of(_peaks([1.0], 2.0), "peaks")


def test_large_results_are_stored_compressed(tmp_path: Path) -> None:
    many = _peaks([1.0] * 10_000, 2.0)
    vi.write_results(many, tmp_path / "many.nc")
    with netCDF4.Dataset(tmp_path / "many.nc") as file:
        assert file["at"].filters()["zlib"]
        assert not file["width"].filters()["zlib"]
    with open_measured(tmp_path / "many.nc") as read:
        assert (read["at"].values == many["at"].values).all()
