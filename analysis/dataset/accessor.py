"""The accessor `ds.vibroimpact`: impacts, sticks, samples and events of one run, by the dataset's coordinates."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.composed import part_of
from vibroimpact.analysis.dataset.schema import (
    RAGGED,
    Direction,
    Outcome,
    constant_names,
    names_list,
    swept_names,
)
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.html_view import html_table
from vibroimpact.fmus.printable import printable

_RECORD_KEYS = {
    "impact": "impacts = true under [record]",
    "stick": "impacts = true under [record]",
    "sample": "time_series (in a scene of components, variables and rate) under [record]",
    "event": "events = true under [record]",
    "chosen_step": 'macro_step = "auto" under [execution] and no sweep',
}

BLOCK_VALUES = 1 << 22
"""Number of values of neighbouring runs that are in memory together: 32 MiB."""
# Relative distance from the only value of a parameter within which a selection means that value.
_SAME_VALUE = 1e-6


class VibroimpactAccessor:
    """Questions to an opened dataset about its runs.

    Examples
    --------
    >>> ds.vibroimpact.impacts(direction="up", angular_frequency=0.9)     # doctest: +SKIP
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    @property
    def runs(self) -> xr.Dataset:
        """The per-run variables along one dimension `run`, in file order, with the sweep as coordinates."""
        dataset = self._dataset
        run_id = run_ids(dataset)
        kept = dataset.drop_vars([name for name, v in dataset.variables.items() if set(v.dims) & set(RAGGED)])
        if run_id.dims == ("run",):
            return kept
        if run_id.dims:
            flat = _stacked(kept, run_id)
        else:  # variables of the only run get the dimension `run` too
            said = {name for name, one in kept.coords.items() if not one.dims} - set(constant_names(kept))
            flat = kept.reset_coords(said).expand_dims("run").set_coords(said)
        flat = flat.isel(run=flat["run_id"].values >= 0)
        flat = flat.isel(run=np.argsort(flat["run_id"].values))
        return flat.transpose("run", ...)

    def part(self, name: str) -> xr.Dataset:
        """Return a part of a diagram: the dataset of its own study, with runs on the dimensions of their sweep.

        Parameters
        ----------
        name : str
            One of the names in the attribute `parts`.

        Raises
        ------
        DatasetError
            There is no such part.

        Examples
        --------
        >>> vi.diagram("scene.toml").vibroimpact.part("branches")                   # doctest: +SKIP
        """
        return part_of(self._dataset, name)

    def __repr__(self) -> str:
        facts = "; ".join(f"{name}: {value}" for name, value in self._facts())
        return printable(f"<vibroimpact: {facts}>")

    def _repr_html_(self) -> str:
        return html_table("vibroimpact", (), self._facts())

    def _facts(self) -> list[tuple[str, object]]:
        """Return the facts about the dataset, by name."""
        dataset, run_id = self._dataset, run_ids(self._dataset)
        outcomes = Counter(np.asarray(dataset["outcome"].values)[run_id.values >= 0].tolist())
        ends = ", ".join(f"{count} {Outcome(kind).name}" for kind, count in sorted(outcomes.items()))
        facts: list[tuple[str, object]] = [
            ("title", dataset.attrs.get("title", "none")),
            ("runs", f"{int((run_id.values >= 0).sum())} ({ends or 'none'})"),
        ]
        facts += [(name, _swept_in_words(dataset[name])) for name in swept_names(dataset)]
        return facts + [(f"{dim}s", dataset.sizes[dim]) for dim in _RECORD_KEYS if dim in dataset.dims]

    def impacts_table(self) -> xr.Dataset:
        """Return the impacts of all runs along `impact`, each with the parameters of its run.

        Returns
        -------
        xarray.Dataset
            Columns as in `impacts`; `run_id`, `run_index`, `direction` and the swept parameters are coordinates
            along `impact`. `to_dataframe()` makes it a table of pandas.

        Raises
        ------
        DatasetError
            If impacts were not recorded.

        Examples
        --------
        >>> table = ds.vibroimpact.impacts_table()                                  # doctest: +SKIP
        >>> table.plot.scatter("angular_frequency", "impact_velocity")              # doctest: +SKIP
        """
        dataset = self._dataset
        table = dataset[_rows_of(dataset, "impact")]
        run_id = run_ids(dataset)
        place = np.empty(run_id.size, dtype=np.intp)
        is_there = run_id.values.ravel() >= 0
        place[run_id.values.ravel()[is_there]] = np.flatnonzero(is_there)
        rows = place[_owners(dataset, "impact")]
        points = {}
        for name, values in _coordinates(dataset, run_id).items():
            attrs = dataset[name].attrs if name in dataset.variables else {}
            if name not in constant_names(dataset):
                points[name] = ("impact", values[rows], attrs)
        return table.drop_vars([name for name in table.coords if name not in points]).assign_coords(points)

    def impacts(self, *, exact: bool = False, **selection: Any) -> xr.Dataset:
        """Return the impacts of one run along `impact`.

        Parameters
        ----------
        exact : bool
            Demand the exact value of each swept parameter instead of the nearest, which is at most half a step away.
        **selection
            Values of coordinates (`direction="up"`, `angular_frequency=0.9`), or `run_id=`; coordinates without a
            value must be the same for all runs that are left.

        Raises
        ------
        DatasetError
            If impacts were not recorded, a name is unknown, a value lies beyond those computed, or the selection is
            not one run.
        """
        return self._rows("impact", exact, selection)

    def sticks(self, *, exact: bool = False, **selection: Any) -> xr.Dataset:
        """Return the sticking phases of one run along `stick`; parameters as for `impacts`."""
        return self._rows("stick", exact, selection)

    def samples(self, *, exact: bool = False, **selection: Any) -> xr.Dataset:
        """Return the time series of one run along `time`, s; parameters as for `impacts`.

        Examples
        --------
        >>> samples = ds.vibroimpact.samples(angular_frequency=0.9)            # doctest: +SKIP
        >>> samples.displacement.sel(time=slice(1.0, 2.0)).plot()              # doctest: +SKIP
        """
        return self._rows("sample", exact, selection).swap_dims(sample="time")

    def events(self, *, exact: bool = False, **selection: Any) -> xr.Dataset:
        """Return the events of one run along `event`; parameters as for `impacts`.

        The attribute `flag_meanings` of `event_component` names the components 1, 2, ...
        """
        return self._rows("event", exact, selection)

    def chosen_steps(self, *, exact: bool = False, **selection: Any) -> xr.Dataset:
        """Return the chosen communication steps of one run along `chosen_step`; parameters as for `impacts`."""
        return self._rows("chosen_step", exact, selection)

    def _rows(self, dimension: str, exact: bool, selection: dict[str, Any]) -> xr.Dataset:
        """Return the rows of one run of a ragged array, with the run's coordinates as scalars."""
        dataset = self._dataset
        names = _rows_of(dataset, dimension)
        number, point = _the_run(dataset, exact, selection)
        rows = np.flatnonzero(_owners(dataset, dimension) == number)
        found = dataset[names].drop_vars([c for c in dataset[names].coords if c not in names])
        return found.isel({dimension: rows}).assign_coords(point)


def _rows_of(dataset: xr.Dataset, dimension: str) -> list[Any]:
    """Return the names of the columns of a ragged array; DatasetError if it was not recorded."""
    if dimension not in dataset.dims:
        raise DatasetError(
            f"{dimension}s: expected them in the dataset, got none recorded. "
            f"Set {_RECORD_KEYS[dimension]} in the scene and run it again."
        )
    return [
        name
        for name, v in dataset.variables.items()
        if v.dims[:1] == (dimension,) and name != f"{dimension}_run"
    ]


def _swept_in_words(values: xr.DataArray) -> str:
    """Return the range of a swept parameter, its unit and its number of values."""
    unit = str(values.attrs.get("units", "1"))
    there = np.unique(values.values)
    span = f"{there[0]:g} to {there[-1]:g}" if there.size > 1 else ", ".join(f"{each:g}" for each in there)
    return f"{span}{'' if unit == '1' else f' {unit}'}, {there.size} values"


def run_ids(dataset: xr.Dataset) -> xr.DataArray:
    """Return the run_id of each point; in a dataset that is still one-dimensional the runs are in order."""
    if "run_id" in dataset.variables:
        return dataset["run_id"]
    return xr.DataArray(np.arange(dataset.sizes["run"], dtype=np.int32), dims="run")


def columns_of_runs(dataset: xr.Dataset, names: Sequence[str]) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the values of variables of neighbouring runs, shape (run, ...), in file order, block by block.

    Each block is read from the smallest box of cells around its runs.
    """
    run_id, own = run_ids(dataset), dataset[list(names)]
    dims, shape = run_id.dims, run_id.shape
    numbers = run_id.values.reshape(-1)
    if (np.diff(numbers, prepend=np.int32(-1)) == 1).all():
        cells: Any = range(numbers.size)
    else:
        cells = np.argsort(numbers, kind="stable")[np.count_nonzero(numbers < 0) :]
    values = sum(own[name].size for name in names) // max(numbers.size, 1)
    most = max(BLOCK_VALUES // max(values, 1), 1)
    for first in range(0, len(cells), most):
        at = np.unravel_index(np.asarray(cells[first : first + most]), shape) if shape else ()
        box = {dim: slice(int(one.min()), int(one.max()) + 1) for dim, one in zip(dims, at, strict=True)}
        sizes = tuple(cut.stop - cut.start for cut in box.values())
        inside = [one - cut.start for one, cut in zip(at, box.values(), strict=True)]
        places = np.ravel_multi_index(inside, sizes) if shape else np.zeros(1, dtype=np.intp)
        some = own.isel(box)
        found = {name: some[name].transpose(*dims, ...).values for name in names}
        yield {name: one.reshape(-1, *one.shape[len(dims) :])[places] for name, one in found.items()}


def _owners(dataset: xr.Dataset, dimension: str) -> NDArray[Any]:
    """Return the run_id of each row of a ragged array."""
    if f"{dimension}_run" in dataset.variables:
        return np.asarray(dataset[f"{dimension}_run"].values)
    return np.repeat(np.arange(dataset.sizes["run"]), dataset[RAGGED[dimension]].values)


def _the_run(dataset: xr.Dataset, exact: bool, selection: dict[str, Any]) -> tuple[int, dict[str, Any]]:
    """Return the run_id of the one run that a selection names, and its coordinates."""
    run_id = run_ids(dataset)
    columns = _coordinates(dataset, run_id)
    unknown = [name for name in selection if name not in columns]
    if unknown:
        raise DatasetError(
            f"selection: expected names among {names_list(sorted(columns))}, got {names_list(unknown)}."
        )
    left = run_id.values.ravel() >= 0
    for name, value in selection.items():
        left &= _matches(name, columns[name], left, value, exact)
    found = np.flatnonzero(left)
    if found.size != 1:
        raise DatasetError(_not_one(columns, found, selection, run_id.dims))
    point = {name: values[found[0]] for name, values in columns.items() if name != "run_id"}
    return int(run_id.values.ravel()[found[0]]), point


def _stacked(dataset: xr.Dataset, run_id: xr.DataArray) -> xr.Dataset:
    """Return a dataset with one dimension `run` in place of the dimensions of its runs, in any order."""
    runs = set(run_id.dims)
    # xarray cannot stack an empty variable: where every run failed there is no period
    nothing = {name: one for name, one in dataset.variables.items() if runs <= set(one.dims) and not one.size}
    if not run_id.size:
        return dataset.stack(run=run_id.dims, create_index=False)
    flat = dataset.drop_vars(nothing).stack(run=run_id.dims, create_index=False)
    for name, variable in nothing.items():
        rest = [dim for dim in variable.dims if dim not in runs]
        shape = (run_id.size, *(variable.sizes[dim] for dim in rest))
        flat[name] = (("run", *rest), np.empty(shape, variable.dtype), variable.attrs)
    return flat


def _coordinates(dataset: xr.Dataset, run_id: xr.DataArray) -> dict[str, NDArray[Any]]:
    """Return each coordinate of the runs as one flat column."""
    columns = {"run_id": run_id.values.reshape(-1)}
    for name, coordinate in dataset.coords.items():
        if name not in ("run", "period", "connection", "compared") and set(coordinate.dims) <= set(
            run_id.dims
        ):
            # the variable, not the coordinate: xarray copies all coordinates along with each coordinate
            values = coordinate.variable.set_dims(run_id.sizes).transpose(*run_id.dims).values
            columns[str(name)] = values.reshape(-1)  # no copy where all runs have the same value
    if "direction" in columns and columns["direction"].dtype.kind == "i":
        columns["direction"] = np.array([member.name for member in Direction])[columns["direction"]]
    return columns


def _matches(
    name: str, values: NDArray[Any], left: NDArray[np.bool_], value: Any, exact: bool
) -> NDArray[np.bool_]:
    """Return a mask of the runs with this value, or with the nearest value among the runs left."""
    if values.dtype.kind == "f" and not exact and left.any():
        if not np.isfinite(value):
            raise DatasetError(f"selection: {name}: expected a number, got {value}.")
        there = np.unique(values[left])
        nearest = there[np.argmin(np.abs(there - value))]
        if not abs(value - nearest) <= _half_step(there, value):
            raise DatasetError(
                f"selection: {name}: expected {_span(there)}, got {value:g}. "
                "Give a value that was computed, or near one."
            )
        value = nearest
    return np.asarray(values == value)


def _half_step(there: NDArray[Any], value: float) -> float:
    """Return the largest distance of a value from the nearest known one: half a step, also beyond the ends."""
    if there.size == 1:
        return float(_SAME_VALUE * abs(there[0]))
    if there[0] <= value <= there[-1]:
        return math.inf
    return float(0.5 * (there[1] - there[0] if value < there[0] else there[-1] - there[-2]))


def _span(there: NDArray[Any]) -> str:
    """Return the values that can be selected, in words."""
    if there.size == 1:
        return f"{there[0]:g}, the only value there is"
    return f"a value of {there[0]:g} to {there[-1]:g}"


def _not_one(
    columns: dict[str, NDArray[Any]],
    found: NDArray[np.intp],
    selection: dict[str, Any],
    dims: tuple[Any, ...],
) -> str:
    """Return the message for a selection that names no run or several."""
    given = names_list([f"{name}={value!r}" for name, value in selection.items()])
    if found.size == 0:
        return f"selection: expected one run, got none for {given}. Leave out exact=True to take the nearest."
    several = [
        n for n, v in columns.items() if n not in ("run_id", "run_index") and np.unique(v[found]).size > 1
    ]
    # one value along a dimension is enough, even if several parameters move along it
    axes = [name for name in several if name in dims]
    return (
        f"selection: expected one run, got {found.size} for {given}. "
        f"Give a value for {names_list(axes or several or ['run_id'])} too."
    )
