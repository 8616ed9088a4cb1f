"""What `vibroimpact resonances` does: peaks of a frequency sweep, printed, written and drawn."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import dataset_file
from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.energies import runs_of, write_found
from vibroimpact.orchestrator.orbits.resonances import resonances


def show_resonances(
    path: Path, output: Path | None, figure: Path | None, changes: Sequence[str], force: bool
) -> None:
    """Find the peaks of a frequency sweep of a scene or a dataset; print, write and draw them."""
    refuse_outputs([dataset_file(path)], output, figure)
    same = ("resonances", str(path))
    refuse_overwriting(
        output, force, lambda there: (there.get("results_kind"), there.get("scene_file")) == same
    )
    with runs_of(path, changes) as dataset:
        try:
            found = resonances(dataset)
        except (DatasetError, UsageError) as problem:
            raise type(problem)(f"{path}: {problem}") from problem
    found = found.assign_attrs(scene_file=str(path))
    unit = "" if found.attrs.get("units_system") == "nondimensional" else ", rad/s"
    headings = (
        "<of",
        "<branch",
        f">at{unit}",
        ">height",
        "<motion",
        ">stop ratio",
        ">nearest natural",
        ">nearest shifted",
    )
    wide_terminal().print(table(f"Peaks: {found.attrs.get('title', '')}", *headings, rows=_rows(found)))
    natural = ", ".join(f"{each:.6g}" for each in found["natural_frequency"].values)
    say(
        f"Natural frequencies{unit}: {natural}. A shift is that of one elastic, undamped, unforced mode: a guess."
    )
    write_found(found, "resonances", output, figure)


def _rows(found: xr.Dataset) -> Iterator[tuple[str, ...]]:
    for place in range(found.sizes["peak"]):
        own = found.isel(peak=place)
        at = float(own.peak_frequency)
        ratio = f"{float(own.stop_ratio):.4f}" if np.isfinite(own.stop_ratio) else "-"
        quantity = str(own.quantity.item()).replace("_", " ")
        branch = str(found["branch"].values[int(own.peak_branch)])
        numbers = f"{at:.5g}", f"{float(own.peak_height):.5g}"
        near = [_nearest(at, own[name].values) for name in ("natural_frequency", "shifted_frequency")]
        yield quantity, branch, *numbers, str(own.motion.item()), ratio, *near


def _nearest(at: float, frequencies: NDArray[np.float64]) -> str:
    """Return the mode whose frequency is nearest to a peak, and how far off the peak is."""
    if not np.isfinite(frequencies).all():
        return "-"
    mode = int(np.argmin(np.abs(np.log(frequencies / at))))
    return f"{mode + 1}: {frequencies[mode]:.5g} ({100.0 * (at / frequencies[mode] - 1.0):+.1f} %)"
