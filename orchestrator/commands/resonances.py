"""What `vibroimpact resonances` does: peaks of a frequency sweep, printed, written and drawn."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.commands.found import refuse_places, write_found
from vibroimpact.analysis.dataset import dataset_file
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import say, wide_terminal
from vibroimpact.orchestrator.commands.energies import runs_of
from vibroimpact.orchestrator.operations.resonances import Resonances
from vibroimpact.orchestrator.orbits.resonances import resonances


def show_resonances(options: Resonances) -> None:
    """Find the peaks of a frequency sweep of a scene or a dataset; print, write and draw them."""
    path = options.file
    refuse_places(options, [dataset_file(path)], results_kind="resonances", scene_file=str(path))
    with runs_of(path, options.changes or ()) as dataset:
        try:
            found = resonances(dataset)
        except (DatasetError, UsageError) as problem:
            raise problem.named(path) from problem
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
    write_found(found, "resonances", options)


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
