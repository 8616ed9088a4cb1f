"""What `vibroimpact sensitivity` does: Sobol indices of a campaign, printed, written and drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset import dataset_file, open_dataset
from vibroimpact.analysis.operations.sensitivity import Sensitivity
from vibroimpact.analysis.sensitivity import sensitivity_report
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, wide_terminal


def show_sensitivity(options: Sensitivity) -> None:
    """Estimate the Sobol indices of a campaign; print, write and draw them."""
    path, file = options.file, dataset_file(options.file)
    refuse_places(options, [file], results_kind="sensitivity", source=str(path))
    with open_dataset(file) as dataset:
        try:
            found = sensitivity_report(
                *(dataset, options.of or ()),
                level=options.level,
                resamples=options.resamples,
                seed=options.seed,
            )
        except (DatasetError, UsageError) as problem:
            raise problem.named(file) from problem
    found = found.assign_attrs(source=str(path))
    _print(wide_terminal(), found)
    write_found(found, "sensitivity", options)


def _print(console: Terminal, found: xr.Dataset) -> None:
    """Print a table: of indices along other keys their mean, lowest and highest value."""
    along = [str(dim) for dim in found.total_order.dims if dim not in ("quantity", "parameter")]
    interval = f"{100.0 * found.attrs['level']:g} %"
    beside = "lowest to highest" if along else interval
    first, total = ("first order, mean", "total, mean") if along else ("first order", "total")
    headings = ("<quantity", "<parameter", f">{first}", f">{beside}", f">{total}", f">{beside}")
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
