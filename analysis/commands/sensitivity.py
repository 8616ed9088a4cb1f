"""What `vibroimpact sensitivity` does: Sobol indices of a campaign, printed, written and drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset import dataset_file, open_dataset
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.sensitivity import sensitivity_report
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import Terminal, wide_terminal


def show_sensitivity(
    path: Path,
    output: Path | None,
    figure: Path | None,
    of: Sequence[str],
    level: float,
    resamples: int,
    seed: int,
    force: bool,
) -> None:
    """Estimate the Sobol indices of a campaign; print, write and draw them."""
    file = dataset_file(path)
    refuse_outputs([file], output, figure)
    same = ("sensitivity", str(path))
    refuse_overwriting(output, force, lambda there: (there.get("results_kind"), there.get("source")) == same)
    with open_dataset(file) as dataset:
        try:
            found = sensitivity_report(dataset, of, level=level, resamples=resamples, seed=seed)
        except (DatasetError, UsageError) as problem:
            raise type(problem)(f"{file}: {problem}") from problem
    found = found.assign_attrs(source=str(path))
    _print(wide_terminal(), found)
    if output is not None:
        with writing(output):
            write_results(found, output, kind="sensitivity")
        Terminal().print(f"Dataset written to {output}.")
    if figure is not None:
        from vibroimpact.analysis import figures  # half a second, which a table needs not

        drawn = figures.draw(found.assign_attrs(results_kind="sensitivity"))
        with writing(figure):
            figures.save(drawn, figure)
        Terminal().print(f"Figure written to {figure}.")


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
