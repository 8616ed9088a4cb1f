"""Sobol indices of the quantities of a campaign, as a dataset."""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import dataset_place, open_dataset
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import DRAW
from vibroimpact.analysis.files.stores import Place
from vibroimpact.analysis.operations.sensitivity import LEVEL, RESAMPLES, Sensitivity
from vibroimpact.analysis.sensitivity.design import design_of
from vibroimpact.analysis.sensitivity.indices import FEWEST_BLOCKS, SobolEstimation
from vibroimpact.analysis.sensitivity.quantities import quantities_of
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, wide_terminal

TABLE = ResultTable(
    "sensitivity",
    ("first_order", "quantity ... parameter", "1", "first-order Sobol index"),
    ("total_order", "quantity ... parameter", "1", "total Sobol index"),
    (
        "first_order_interval",
        "quantity ... parameter bound",
        "1",
        "{level} bootstrap interval of the first-order Sobol index",
    ),
    (
        "total_order_interval",
        "quantity ... parameter bound",
        "1",
        "{level} bootstrap interval of the total Sobol index",
    ),
    ("blocks", "quantity ...", "1", "blocks of the design that were used"),
    ("quantity", "quantity", "1", "quantity whose variance is shared out", "text"),
    ("parameter", "parameter", "1", "parameter that was drawn", "text"),
    ("bound", "bound", "1", "end of an interval", "text"),
    ("quantity_name", "quantity", "1", "quantity in words", "text"),
)


@dataclass(eq=False)
class SensitivityOfCampaign(Study[int]):
    """Sobol indices of a campaign: see `sensitivity_report`. A row of the study counts the resamples of one batch."""

    name = "sensitivity"
    nothing = "an index"
    named = (DatasetError, UsageError)
    mark = "source"

    campaign: xr.Dataset
    of: Sequence[str] = ()
    level: float = LEVEL
    resamples: int = RESAMPLES
    seed: int = 0
    source: str = ""

    @classmethod
    def reads(cls, options: Sensitivity) -> Sequence[Place]:
        """Return the file of the dataset."""
        return [dataset_place(options.file)]

    @classmethod
    def marks(cls, options: Sensitivity) -> Mapping[str, Any]:
        """Return the path of the dataset."""
        return {cls.mark: str(options.file)}

    @classmethod
    def prepare(cls, options: Sensitivity, stack: ExitStack) -> Self:
        """Open the dataset."""
        campaign = stack.enter_context(open_dataset(dataset_place(options.file)))
        settings = options.of or (), options.level, options.resamples, options.seed
        return cls(campaign, *settings, str(options.file))

    def rows(self) -> Generator[int, None, None]:
        """Estimate the indices, then resample the blocks batch after batch.

        DatasetError: the dataset has no Saltelli design, or nothing that varies over it. UsageError: the quantity is
        unknown, or the level, the number of resamples or the seed is out of range.
        """
        dataset, self._design = self.campaign, design_of(self.campaign)
        if taken := sorted({"quantity", "parameter", "bound"} & set(map(str, dataset["outcome"].dims))):
            raise DatasetError(
                f"sensitivity: {taken[0]}: expected a dimension of another name. Rename it in Python."
            )
        self._quantities = quantities_of(dataset)
        self._names = _chosen([str(name) for name in self._quantities.data_vars], self.of)
        self._others = [str(dim) for dim in dataset["outcome"].dims if dim != DRAW]
        columns = [self._quantities[name].transpose(DRAW, *self._others).values for name in self._names]
        self._shape = (len(self._names), *columns[0].shape[1:])
        runs = np.stack(columns, axis=1).reshape(columns[0].shape[0], -1)
        self._estimation = SobolEstimation(
            *self._design.parts(runs), level=self.level, resamples=self.resamples, seed=self.seed
        )
        yield from self._estimation.batches()

    def made(self) -> xr.Dataset:
        """Return the indices with their intervals; DatasetError where nothing varies."""
        coordinates = {
            str(name): c.variable.copy(deep=False)
            for name, c in self.campaign.coords.items()
            if c.dims and set(c.dims) <= set(self._others)
        }
        for coordinate in coordinates.values():
            coordinate.attrs.setdefault("units", "1")  # the words of a direction have none
        level = f"{100.0 * self.level:g} %"
        report = TABLE.dataset(self._values(), over=tuple(self._others), coords=coordinates, level=level)
        remarks = list(_remarks(report, self._design.blocks))
        if not np.isfinite(report.total_order.values).any():
            raise DatasetError(f"sensitivity: expected a quantity that varies, got none: {' '.join(remarks)}")
        kept = {name: self.campaign.attrs[name] for name in ("title", "scene") if name in self.campaign.attrs}
        attributes = {
            "blocks_drawn": self._design.blocks,
            "level": self.level,
            "resamples": self.resamples,
            "seed": self.seed,
            "remarks": "\n".join(remarks),
        }
        return report.assign_attrs(kept | attributes)

    def _values(self) -> dict[str, Any]:
        indices, keys = self._estimation.indices(), len(self._design.names)
        return {
            "first_order": indices.first_order.reshape(*self._shape, keys),
            "total_order": indices.total_order.reshape(*self._shape, keys),
            "first_order_interval": indices.first_interval.reshape(*self._shape, keys, 2),
            "total_order_interval": indices.total_interval.reshape(*self._shape, keys, 2),
            "blocks": indices.blocks.reshape(self._shape),
            "quantity": self._names,
            "parameter": list(self._design.names),
            "bound": ["lower", "upper"],
            "quantity_name": [self._quantities[name].attrs["long_name"] for name in self._names],
        }

    def print_results(self) -> None:
        """Print a row for each quantity and parameter."""
        _print(wide_terminal(), self.dataset.assign_attrs(source=self.source))


def sensitivity_report(
    dataset: xr.Dataset,
    of: Sequence[str] = (),
    *,
    level: float = LEVEL,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> xr.Dataset:
    """Return the Sobol indices of an opened campaign: see `vibroimpact.sensitivity`."""
    return whole(SensitivityOfCampaign(dataset, of, level, resamples, seed)).dataset


def _chosen(there: Sequence[str], of: Sequence[str]) -> list[str]:
    """Return the chosen quantities, or all of them."""
    if not there:
        raise DatasetError(
            "sensitivity: expected something recorded of each run, got nothing. Set extrema, impacts or a time "
            "series in [record]."
        )
    for name in of:
        if name not in there:
            raise UsageError(f"sensitivity: quantity: expected one of {', '.join(there)}, got {name!r}.")
    return list(dict.fromkeys(of)) or list(there)


def _remarks(report: xr.Dataset, drawn: int) -> list[str]:
    """Return remarks on quantities that are constant, or that lost blocks to failed runs."""
    remarks = []
    for name in report["quantity"].values.tolist():
        own = report.sel(quantity=name)
        blocks = own["blocks"].values
        unknown = np.isnan(own["total_order"].values).all(axis=-1)
        few = blocks < FEWEST_BLOCKS
        where = (
            ""
            if unknown.all() or not unknown.ndim
            else f" at {int((unknown & ~few).sum())} of {unknown.size} points"
        )
        if (unknown & ~few).any():
            remarks.append(f"{name} is the same for all draws{where}: it has no indices.")
        if few.any():
            remarks.append(f"{name} has fewer than {FEWEST_BLOCKS} whole blocks of runs: it has no indices.")
        elif blocks.min() < drawn:
            dropped = drawn - int(blocks.min())
            remarks.append(
                f"{name}: {dropped} of {drawn} blocks are left out, for runs that failed or have no such number; "
                "indices are those of what is left."
            )
    return remarks


def _print(console: Terminal, found: xr.Dataset) -> None:
    """Print a table of the indices; along other keys their mean, lowest and highest value."""
    along = [str(dim) for dim in found.total_order.dims if dim not in ("quantity", "parameter")]
    interval = f"{100.0 * found.attrs['level']:g} %"
    heading = "lowest to highest" if along else interval
    first, total = ("first order, mean", "total, mean") if along else ("first order", "total")
    headings = ("<quantity", "<parameter", f">{first}", f">{heading}", f">{total}", f">{heading}")
    where = f" (along {', '.join(along)})" if along else ""
    title = f"Shares of variance: {found.attrs.get('title') or found.attrs['source']}{where}"
    console.print(table(title, *headings, rows=_rows(found, bool(along))))
    for line in found.attrs["remarks"].splitlines():
        console.print(line, style="yellow", soft_wrap=True)


def _rows(found: xr.Dataset, are_many: bool) -> Iterator[tuple[str, ...]]:
    for quantity in found["quantity"].values.tolist():
        for parameter in found["parameter"].values.tolist():
            own = found.sel(quantity=quantity, parameter=parameter)
            if not bool(own.total_order.notnull().any()):
                continue
            cells: list[str] = []
            for name in ("first_order", "total_order"):
                values = own[name].values
                ends = values if are_many else own[f"{name}_interval"].values
                there, known = values[np.isfinite(values)], ends[np.isfinite(ends)]
                cells.append(f"{there.mean():.3f}" if there.size else "-")
                cells.append(f"{known.min():.3f} to {known.max():.3f}" if known.size else "-")
            yield quantity, parameter, *cells
