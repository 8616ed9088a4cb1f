"""Laws that each run keeps: energy balances, and no point is beyond a rigid stop."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from support.drawn_forces import stop_motion
from support.drawn_structures import ENERGIES
from vibroimpact.orchestrator.scene import Scene

#: Largest error of the energy over the energy turned over; the second for power laws, each solved to 1e-10.
TURNOVER, TURNOVER_POWER = 1e-9, 1e-7
#: Largest way beyond a rigid stop, over the displacements and the clearance.
BEYOND = 1e-11
POWER = ("hertz", "hunt_crossley")


def limits_of(tables: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the tables of the stops and the contacts of a scene."""
    return [*tables.get("stop", []), *tables.get("contact", [])]


def energy_problem(tables: dict[str, Any], found: xr.Dataset, least: float = 1e-14) -> str | None:
    """Return the error of the balance of energy in a time series; errors below `least`, J, are rounding."""
    kinetic, potential, work, loss, contact = (found[f"energy_{name}"].values for name in ENERGIES)
    if not len(kinetic):
        return None
    energy = kinetic + potential
    balance = energy - energy[0] - (work - work[0]) + (loss - loss[0]) + (contact - contact[0])
    ways = (np.abs(np.diff(each)).sum() for each in (energy, work, loss, contact))
    power = any(each.get("law") in POWER for each in limits_of(tables))
    size = float((kinetic + np.abs(potential)).max())
    allowed = (TURNOVER_POWER if power else TURNOVER) * (size + sum(ways)) + least
    worst = float(np.abs(balance).max())
    return None if worst <= allowed else f"energy off by {worst:.3g}, of {allowed:.3g} allowed"


def room_problem(tables: dict[str, Any], scene: Scene, found: xr.Dataset, length: float = 1.0) -> str | None:
    """Return the way of a point beyond a rigid stop; `length`, m, is the size of the clearances."""
    for k, (stop, table) in enumerate(zip(scene.stops, limits_of(tables), strict=True), start=1):
        way = found[f"contact_displacement_{k}"].values
        sign = 1.0 if stop.side == "upper" else -1.0
        place = stop.position + stop_motion(table, found.time.values)
        beyond = float((sign * (way - place)).max(initial=0.0))
        if stop.law == "restitution" and beyond > BEYOND * (length + np.abs(way).max(initial=0.0)):
            return f"{beyond:.3g} beyond {scene.stop_keys[k - 1]}"
    return None
