"""The entry point of xarray into this package: `engine="vibroimpact"`, and `ds.vibroimpact` of every dataset.

xarray imports this module with all its engines when it opens its first file. So it imports nothing that takes time.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from typing import Any

import xarray as xr
from xarray.backends import BackendEntrypoint

from vibroimpact.analysis.dataset.registering import accessor  # noqa: F401  # for `ds.vibroimpact`


class VibroimpactBackend(BackendEntrypoint):
    """Opens datasets of runs and results of analyses with all checks, runs on the dimensions of their sweep."""

    description = "Open datasets of vibroimpact: files (.nc) and folders of campaigns"
    url = "https://docs.xarray.dev/en/stable/internals/how-to-add-new-backend.html"
    open_dataset_parameters = ("filename_or_obj", "drop_variables")

    def open_dataset(
        self, filename_or_obj: Any, *, drop_variables: str | Iterable[str] | None = None
    ) -> xr.Dataset:
        """Open a dataset of runs as `vi.open_dataset` does, results as `vi.open_measured` does.

        Raises
        ------
        DatasetError
            The file is missing, damaged or foreign, or the dataset is open already.
        """
        from vibroimpact.analysis.dataset.places import dataset_place
        from vibroimpact.analysis.dataset.reading import open_dataset, open_measured
        from vibroimpact.analysis.files.opening import file_attributes
        from vibroimpact.fmus.errors import DatasetError

        if not isinstance(filename_or_obj, str | os.PathLike):
            kind = type(filename_or_obj).__name__
            raise DatasetError(f"dataset: expected the path of a file or folder, got {kind}.")
        file = dataset_place(filename_or_obj)
        is_result = "results_kind" in file_attributes(file)
        opened = open_measured(file) if is_result else open_dataset(file)
        kept = opened.drop_vars([] if drop_variables is None else drop_variables, errors="ignore")
        kept.set_close(opened.close)
        return kept

    def guess_can_open(self, filename_or_obj: Any) -> bool:
        """Return False: a file that names no engine opens as it does without this package."""
        return False
