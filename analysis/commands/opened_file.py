"""Any file of this package, opened by its kind: a dataset of runs, a recording, or results of an analysis."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import xarray as xr

from vibroimpact.analysis.dataset import open_dataset, open_measured
from vibroimpact.analysis.files.fingerprints import matches_recorded_hash
from vibroimpact.analysis.files.opening import DAMAGE, file_attributes, unreadable
from vibroimpact.analysis.files.stores import Place, is_store
from vibroimpact.analysis.recording import Recording, open_recording


@contextmanager
def opened_file(file: Place) -> Iterator[xr.Dataset | Recording]:
    """Open a file or a store; values are read when first used, so that damage may show only then.

    Raises
    ------
    DatasetError
        The file is missing, damaged or foreign.
    """
    try:
        with _opened(file) as data:
            yield data
    except DAMAGE as problem:
        # A file with the hash of its writer is as it was written: the fault is not the file's then.
        if is_store(file) or isinstance(problem, OSError | RuntimeError) or not matches_recorded_hash(file):
            raise unreadable(file, problem) from problem
        raise


def _opened(file: Place) -> AbstractContextManager[xr.Dataset | Recording]:
    if is_store(file):
        return open_dataset(file)
    attributes = file_attributes(file)
    if "recording_schema" in attributes:
        return nullcontext(open_recording(file))
    if "results_kind" in attributes:
        return open_measured(file)
    if "dataset_schema" not in attributes:
        measured = open_measured(file)
        # a benchmark writes no schema
        if "error" in measured:
            return measured
        measured.close()
    return open_dataset(file)
