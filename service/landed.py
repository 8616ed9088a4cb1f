"""Finished points of a campaign: one variable of all points, from its parts while it runs, then from its dataset."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

import netCDF4
import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import RULES, dataset_place, read_runs
from vibroimpact.analysis.dataset.derived import DERIVED
from vibroimpact.analysis.dataset.schema import SCATTERED, SWEPT_ALONG
from vibroimpact.analysis.dataset.writing import image_of
from vibroimpact.analysis.files.open_files import netcdf_lock
from vibroimpact.analysis.files.opening import opened_netcdf
from vibroimpact.analysis.files.stores import is_store
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.service.run_classes import ClassColumns, can_be_classified

READING = threading.Lock()
"""Lock for reading or drawing a file: neither the NetCDF library nor the page's style is safe for threads."""
CLASS = "class"
"""Derived variable: the class of a run, as `vibroimpact classify` names it."""
ALONG = ("period", "impact", "stick", "comparison", "interface")
"""Dimensions, besides that of runs, whose values are shown run by run."""
_NO_VALUES = ("run_index", "direction", "message", "final_state", "connection", "compared")
MOST_CACHED = 2**27
"""Largest size of the cache of read values, byte."""
FAILURE_BYTES = 512
"""Estimated memory of a failure, byte."""
Found = TypeVar("Found")
Later: TypeAlias = Callable[[], Found]
"""The rest of an answer, which does not need the file any more."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A variable, or a swept parameter."""

    name: str
    label: str
    units: str
    along: str = ""
    """Second dimension of a variable, or dimension that a swept parameter shares with others; or empty."""


@dataclass(frozen=True, slots=True)
class Landed:
    """One variable of some runs, a value per row: a run with several periods or impacts has several rows."""

    quantities: tuple[Quantity, ...]
    """All variables that can be requested."""
    axes: tuple[Quantity, ...]
    """The swept parameters, in the order of the scene."""
    runs: NDArray[np.int64]
    """Index of each run in its campaign, shape (run,); directions and outcomes have the same shape."""
    directions: NDArray[np.int8]
    outcomes: NDArray[np.int8]
    coordinates: NDArray[np.float64]
    """Values of the swept parameters, shape (axis, run)."""
    owners: NDArray[np.int64]
    """Place of the run that each row belongs to, shape (row,)."""
    values: NDArray[np.float64]
    """Values of the variable, shape (row,)."""
    is_class: bool = False
    """Whether the values are codes of classes (`run_classes.ClassColumns.codes`)."""

    @property
    def size(self) -> int:
        """Size in memory, byte."""
        arrays = (
            self.runs,
            self.directions,
            self.outcomes,
            self.coordinates,
            self.owners,
            self.values,
        )
        return sum(array.nbytes for array in arrays)


@dataclass(frozen=True, slots=True)
class Failure:
    """A run that did not reach its end."""

    run: int
    outcome: int
    message: str
    coordinates: dict[str, float]


class LandedReader:
    """Reader of finished points, with a cache of the last answers by file.

    >>> LandedReader().read([Path("campaign/dataset.nc")], "displacement_range")     # doctest: +SKIP
    """

    def __init__(self) -> None:
        self._known: OrderedDict[Hashable, tuple[Any, int]] = OrderedDict()

    def read(self, files: Sequence[Path], variable: str) -> Landed | None:
        """Return a variable from files of the same campaign; None if there are no files yet.

        Raise KeyError for an unknown variable, DatasetError for a damaged file.
        """

        def piece(file: netCDF4.Dataset) -> Later[tuple[Landed | None, int]]:
            make = _read(file, variable)

            def made() -> tuple[Landed | None, int]:
                found = make()
                return found, 0 if found is None else found.size

            return made

        found = self._from_each(files, variable, piece)
        pieces = [one for one in found if one is not None]
        if len(pieces) < len(found):
            raise KeyError(variable)
        return _joined(pieces) if pieces else None

    def failures(self, files: Sequence[Path], outcomes: Sequence[int]) -> list[Failure]:
        """Return the runs of a campaign with one of these outcomes, in the order of their index.

        Raise DatasetError for a damaged file.
        """

        def failed(file: netCDF4.Dataset) -> Later[tuple[list[Failure], int]]:
            found = _failures(file, outcomes)
            return lambda: (found, FAILURE_BYTES * (1 + len(found)))

        each = self._from_each(files, tuple(outcomes), failed)
        return sorted((one for found in each for one in found), key=lambda one: one.run)

    def _from_each(
        self,
        files: Sequence[Path],
        question: Hashable,
        read: Callable[[netCDF4.Dataset], Later[tuple[Found, int]]],
    ) -> list[Found]:
        """Return the answer for each file that still exists; `read` also returns the size of an answer in bytes."""
        answers = []
        for path in files:
            try:
                answers.append(self._remembered(path, question, read))
            except (FileNotFoundError, DatasetError):
                if path.exists():
                    raise
                # the campaign has merged its parts into one dataset meanwhile; the next request will find it
        return answers

    def _remembered(
        self, path: Path, question: Hashable, read: Callable[[netCDF4.Dataset], Later[tuple[Found, int]]]
    ) -> Found:
        # an object of a store is replaced only before this one, which is written last
        state = (path / "zarr.json" if is_store(path) else path).stat()
        key = (path, state.st_mtime_ns, state.st_size, question)
        with READING:
            if key in self._known:
                self._known.move_to_end(key)
                known: Found = self._known[key][0]
                return known
            with opened_runs(path) as file:
                make = read(file)
        answer = make()
        with READING:
            self._known[key] = answer
            while sum(size for _, size in self._known.values()) > MOST_CACHED and len(self._known) > 1:
                self._known.popitem(last=False)
        return answer[0]


def files_of(campaign: Path) -> list[Path]:
    """Return the files with finished points of a campaign: file or store of its dataset, else its parts in order."""
    dataset = Path(dataset_place(campaign))
    if dataset.is_file() or is_store(dataset):
        return [dataset]
    return sorted((campaign / "parts").glob("*.nc"), key=lambda path: path.name.partition("_runs-")[2])


@contextmanager
def opened_runs(path: Path) -> Iterator[netCDF4.Dataset]:
    """Open a file of runs, or a store of them, which becomes a file in memory."""
    if not is_store(path):
        with opened_netcdf(path) as file:
            yield file
        return
    content = bytes(image_of(read_runs(path)))
    with netcdf_lock(), netCDF4.Dataset("runs.nc", memory=content) as file:
        file.set_auto_maskandscale(False)
        yield file


def axes_of(file: netCDF4.Dataset) -> list[str]:
    """Return the names of the swept parameters of an open file, in the order of its scene."""
    linked = getattr(file["outcome"], "coordinates", "").split()
    return [name for name in linked if name not in RULES and file[name].dimensions == ("run",)]


def _failures(file: netCDF4.Dataset, outcomes: Sequence[int]) -> list[Failure]:
    """Return the runs of an open file with one of these outcomes."""
    names = axes_of(file)
    all_outcomes, runs = file["outcome"][:], file["run_index"][:]
    columns = {name: file[name][:] for name in names}
    return [
        Failure(
            int(runs[place]),
            int(all_outcomes[place]),
            str(file["message"][place]),
            {name: float(column[place]) for name, column in columns.items()},
        )
        for place in np.flatnonzero(np.isin(all_outcomes, outcomes))
    ]


def _read(file: netCDF4.Dataset, variable: str) -> Later[Landed | None]:
    axes = axes_of(file)
    quantities = tuple(_quantities(file, axes))
    found = next((one for one in quantities if one.name == variable), None)
    if found is None:
        return lambda: None
    runs = file["run_index"][:].astype(np.int64)
    landed = Landed(
        quantities,
        tuple(_axis(file[name]) for name in axes),
        runs,
        file["direction"][:],
        file["outcome"][:],
        np.array([file[name][:] for name in axes], dtype=np.float64).reshape(len(axes), runs.size),
        np.arange(runs.size, dtype=np.int64),
        np.empty(runs.size),
        variable == CLASS,
    )
    if variable == CLASS:
        # classifying many runs takes seconds, in which other requests may read files
        columns = ClassColumns.of(file)
        return lambda: replace(landed, values=columns.codes())
    owners, values = _rows(file, found, runs.size)
    return lambda: replace(landed, owners=owners, values=values)


def _axis(variable: netCDF4.Variable[Any]) -> Quantity:
    along = str(getattr(variable, SWEPT_ALONG, ""))
    # scattered points have two parameters without a common grid
    return replace(_quantity(variable), along="" if along == SCATTERED else along)


def _quantities(file: netCDF4.Dataset, axes: Sequence[str]) -> list[Quantity]:
    shown = [
        _quantity(variable)
        for name, variable in file.variables.items()
        if name not in (*_NO_VALUES, *axes)
        and variable.dimensions
        and variable.dtype is not str
        and (variable.dimensions == ("run",) or variable.dimensions[-1] in ALONG)
    ]
    shown += [
        Quantity(derived.name, derived.label, _quantity(file[derived.sources[0]]).units)
        for derived in DERIVED
        if derived.is_from(file.variables)
    ]
    if can_be_classified(file):
        shown.append(Quantity(CLASS, "class of the motion", "1"))
    return sorted(shown, key=lambda one: one.name)


def _quantity(variable: netCDF4.Variable[Any]) -> Quantity:
    name, last = variable.name, variable.dimensions[-1]
    label = str(getattr(variable, "long_name", name))
    return Quantity(name, label, str(getattr(variable, "units", "1")), "" if last == "run" else last)


def _rows(
    file: netCDF4.Dataset, quantity: Quantity, count: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the run of each value of a variable, and the values."""
    places = np.arange(count, dtype=np.int64)
    for derived in DERIVED:
        if derived.name == quantity.name:
            return places, derived.values({name: np.asarray(file[name][:]) for name in derived.sources})
    variable = file[quantity.name]
    values = np.asarray(variable[...], dtype=np.float64)
    if variable.dimensions[0] == "run":
        width = 1 if values.ndim == 1 else values.shape[1]
        return np.repeat(places, width), values.reshape(-1)
    counts = file[f"{quantity.along}_count"][:]
    return np.repeat(places, counts), values


def _joined(pieces: Sequence[Landed]) -> Landed:
    first = pieces[0]
    offsets = np.cumsum([0, *(piece.runs.size for piece in pieces[:-1])])
    join = partial(np.concatenate, axis=-1)
    return Landed(
        first.quantities,
        first.axes,
        join([piece.runs for piece in pieces]),
        join([piece.directions for piece in pieces]),
        join([piece.outcomes for piece in pieces]),
        join([piece.coordinates for piece in pieces]),
        join([piece.owners + offset for piece, offset in zip(pieces, offsets, strict=True)]),
        join([piece.values for piece in pieces]),
        first.is_class,
    )
