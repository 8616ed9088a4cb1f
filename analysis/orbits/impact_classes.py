"""Classes of runs from impacts alone, for example of components that hit each other.

With one known forcing frequency, the state of a period is its strongest impact: its time and its speed. Otherwise a
motion has its own period, and repeats if its last impacts do.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr
from numpy.typing import NDArray

Floats = NDArray[np.float64]

FREQUENCY = "angular_frequency"
"""Ending of the name of a forcing frequency."""
LEAST_SPEED = 1e-2
"""Speed of the last impacts, over the fastest, below which a motion without forcing dies away."""


def has_named_contacts(dataset: xr.Dataset) -> bool:
    """Tell whether impacts are those of components that hit each other."""
    return "impact_contact" in dataset.variables and "flag_meanings" in dataset["impact_contact"].attrs


def impacts_of_runs(dataset: xr.Dataset) -> Iterator[tuple[xr.Dataset, float | None]]:
    """Yield the impacts of each run, in the order of the file, and its forcing frequency, rad/s.

    The frequency is 0 if the dataset names none, and None if there are several.
    """
    runs, table = dataset.vibroimpact.runs, dataset.vibroimpact.impacts_table()
    names = [name for name in map(str, runs.variables) if name.endswith(FREQUENCY)]
    for run in range(runs.sizes["run"]):
        values = {float(runs[name].values[run] if runs[name].ndim else runs[name]) for name in names} - {0.0}
        frequency = None if len(values) > 1 else next(iter(values), 0.0)
        yield table.isel(impact=np.flatnonzero(table["run_id"].values == run)), frequency


def states_of_periods(impacts: xr.Dataset, frequency: float) -> tuple[Floats, Floats]:
    """Return the state and the number of impacts of whole forcing periods, which are cut where no impact is near.

    States, shape (period, 2): time from the cut to the strongest impact in forcing periods, and its speed, m/s; 0
    without an impact. Counts, shape (period,), are infinite if bodies come to rest on each other.
    """
    turns = impacts["impact_time"].values * abs(frequency) / (2.0 * np.pi)
    if not turns.size:
        return np.empty((0, 2)), np.empty(0)
    turns = turns - _cut(turns[turns.size // 2 :] % 1.0)
    period = np.floor(turns).astype(np.int64)
    speed = impacts["impact_velocity"].values
    states, counts = [], []
    for each in range(period[0] + 1, period[-1]):
        rows = np.flatnonzero(period == each)
        strongest = rows[np.argmax(speed[rows])] if rows.size else None
        states.append((0.0, 0.0) if strongest is None else (turns[strongest] - each, speed[strongest]))
        sticks = (impacts["impact_restitution"].values[rows] == 0.0).any()
        counts.append(np.inf if sticks else float(rows.size))
    return np.array(states, dtype=float).reshape(-1, 2), np.array(counts, dtype=float)


def _cut(phases: Floats) -> float:
    """Return the middle of the widest gap of phases, in turns."""
    ordered = np.sort(phases)
    gaps = np.diff(np.append(ordered, ordered[0] + 1.0))
    widest = int(np.argmax(gaps))
    return float(ordered[widest] + 0.5 * gaps[widest])


def has_no_force(dataset: xr.Dataset) -> bool:
    """Tell whether runs of bodies without a force have recorded impacts."""
    names = map(str, dataset.variables)
    return "impact_time" in dataset.variables and not any(name.endswith(FREQUENCY) for name in names)


def states_of_section(impacts: xr.Dataset) -> tuple[Floats, Floats]:
    """Return the state at each impact on the first contact that is hit, and the number of impacts up to the next.

    States, shape (impact, 2): time to the next impact on this contact, s, and speed, m/s. Without a force this contact
    takes the place of the clock.
    """
    contact = impacts["impact_contact"].values
    section = np.flatnonzero(contact == contact.min())
    time, speed = impacts["impact_time"].values[section], impacts["impact_velocity"].values[section]
    return np.column_stack([np.diff(time), speed[:-1]]), np.diff(section).astype(float)


def own_period(impacts: xr.Dataset, same: float) -> tuple[int, str]:
    """Return the number of impacts after which a motion without forcing repeats, or 0, and the reason for 0."""
    speed = impacts["impact_velocity"].values
    if speed[-1] <= LEAST_SPEED * speed.max() or (impacts["impact_restitution"].values == 0.0).any():
        return 0, "no forcing, and its impacts die away"
    time = impacts["impact_time"].values
    rows = np.column_stack([np.diff(time), speed[1:], impacts["impact_contact"].values[1:]])
    rows /= np.fmax(np.abs(rows).max(axis=0), np.finfo(float).tiny)
    for count in range(1, len(rows) // 2 + 1):
        if np.abs(rows[count:] - rows[:-count])[-count - 1 :].max() <= same:
            return count, ""
    return 0, f"no forcing, and no period up to {len(rows) // 2} impacts"
