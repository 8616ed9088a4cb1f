"""The points of a campaign whose dataset is a store: the page gets the values that the file of it gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.dataset_examples import up_down

from vibroimpact.analysis.dataset import Outcome, write_dataset
from vibroimpact.analysis.dataset.stores.converting import convert_dataset
from vibroimpact.service.landed import LandedReader, files_of


def test_a_store_gives_the_page_what_its_file_gives(tmp_path: Path) -> None:
    for name in ("file", "store"):
        (tmp_path / name).mkdir()
    write_dataset(up_down(), tmp_path / "file" / "dataset.nc")
    convert_dataset(tmp_path / "file" / "dataset.nc", tmp_path / "store" / "dataset.zarr")
    file, store = (files_of(tmp_path / name) for name in ("file", "store"))
    assert store == [tmp_path / "store" / "dataset.zarr"]
    reader = LandedReader()
    for variable in ("displacement_range", "impact_velocity", "class", "largest_impact_velocity"):
        expected, found = reader.read(file, variable), reader.read(store, variable)
        assert expected is not None
        assert found is not None
        assert found.quantities == expected.quantities
        assert found.axes == expected.axes
        np.testing.assert_array_equal(found.values, expected.values)
        np.testing.assert_array_equal(found.owners, expected.owners)
        np.testing.assert_array_equal(found.coordinates, expected.coordinates)
    assert reader.failures(store, [Outcome.ok]) == reader.failures(file, [Outcome.ok])
