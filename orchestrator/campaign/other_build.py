"""The comparison of other builds of the components with a campaign, by its points, not by hashes.

FMUs of another version or another compiler have other hashes, whether their results differ or not. A few stored
points, spread evenly over the files, are computed again: a campaign goes on only if they are equal bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, read_flat, refuse_unlike, take_runs
from vibroimpact.analysis.dataset.schema import swept_names
from vibroimpact.analysis.files.object_paths import AnyPath
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.campaign.extension import final_states, without_empty_periods
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, Work, compute_again
from vibroimpact.orchestrator.run.runner import CARRYING
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.workers.pool import WorkerPool

MOST_POINTS = 8
"""Largest number of points that are computed again."""
MOST_SECONDS = 60.0
"""Largest sum of the stored wall times of these points, s; the first point is always computed again."""
COMPARABLE = (Outcome.ok, Outcome.stuck, Outcome.impact_limit, Outcome.unbounded)
"""Outcomes that the same components always give; a crash or a timeout may depend on the machine."""
OF_THE_MACHINE = ("point_seconds",)
"""Variables that differ between two computations of a point."""


def compare_with_stored(
    pool: WorkerPool,
    work: Work,
    scene: Scene,
    stored: Sequence[AnyPath],
    read: Callable[[AnyPath], xr.Dataset] = read_flat,
) -> tuple[int, str]:
    """Compute a few stored points again; return their number, and the reason why they do not prove equal results.

    `read` returns the rows of a file. The reason is empty if all points are equal bit for bit.
    """
    chosen = list(_chosen(scene, stored, read))
    if not chosen:
        return 0, "It has no point that could be computed again to show whether results are the same"
    tickets = {pool.submit(compute_again, work, chunk): row for chunk, row in chosen}
    different = {}
    for _ in chosen:
        ended = pool.next_finished()
        row = tickets[ended.ticket]
        if ended.worker_lost:
            different[ended.ticket] = f"{_name(row)} kills the process that computes it again"
        elif ended.error is not None:
            raise ended.error
        else:
            different[ended.ticket] = _difference(row, ended.result)
    return len(chosen), next(filter(None, (different[ticket] for ticket in tickets)), "")


def _chosen(
    scene: Scene, stored: Sequence[AnyPath], read: Callable[[AnyPath], xr.Dataset]
) -> Iterator[tuple[Chunk, xr.Dataset]]:
    """Yield points that can be computed again, spread evenly over the files, each with its stored row."""
    branches = expand(scene)
    # Independent points and first points of branches begin at the scene's own start state.
    length = 1 if branches[0].direction == "independent" else len(branches[0].points)
    files = _spread(len(stored), MOST_POINTS)
    seconds = 0.0
    for place in files:
        rows = read(stored[place])
        run, states = rows.run_index.values, final_states(rows, slice(None))
        carries = np.isin(rows.outcome.values, CARRYING) & np.isfinite(states).all(axis=1)
        # the row of a refined point of an adaptive path does not have its start state
        first_round = run < run_count(scene.sweep)
        begins, follows = run % length == 0, np.append(False, (np.diff(run) == 1) & carries[:-1])
        known = np.flatnonzero(np.isin(rows.outcome.values, COMPARABLE) & (begins | follows) & first_round)
        for row in known[_spread(known.size, max(MOST_POINTS // files.size, 1))]:
            taken = float(rows.point_seconds.values[row])
            if seconds and seconds + taken > MOST_SECONDS:
                return
            seconds += taken
            start = None if begins[row] else tuple(states[row - 1].tolist())
            yield Chunk(0, int(run[row]), int(run[row]) + 1, start), take_runs(rows, np.array([row]))


def _spread(size: int, most: int) -> NDArray[np.intp]:
    """Return at most `most` of the first `size` numbers, evenly spread from the first to the last."""
    return np.unique(np.linspace(0, size - 1, min(size, most)).astype(np.intp))


def _name(row: xr.Dataset) -> str:
    swept = ", ".join(f"{name} = {row[name].values[0]}" for name in swept_names(row))
    return f"point {row.run_index.values[0]}" + (f" ({swept})" if swept else "")


def _difference(stored: xr.Dataset, again: xr.Dataset) -> str:
    """Return the first difference between two rows of a point, in words; empty if they are equal bit for bit."""
    try:
        refuse_unlike("computed again", again, _name(stored), stored)
    except DatasetError as error:
        return str(error).rstrip(".")
    stored, again = without_empty_periods(stored), without_empty_periods(again)
    for name in stored.variables:
        if name in OF_THE_MACHINE or name not in again.variables:
            continue
        was, now = (rows.variables[name].values.reshape(-1) for rows in (stored, again))
        if _bits(was) != _bits(now):
            return f"{name} of {_name(stored)}{_shown(was, now)}"
    return ""


def _bits(values: NDArray[Any]) -> Any:
    return values.astype(np.float64).tobytes() if values.dtype.kind == "f" else values.tolist()


def _shown(was: NDArray[Any], now: NDArray[Any]) -> str:
    if was.size != now.size:
        return f": {was.size} values are stored, {now.size} are computed again"
    place = next(k for k in range(was.size) if _bits(was[k : k + 1]) != _bits(now[k : k + 1]))
    return f" is stored as {was[place]}, computed again as {now[place]}"
