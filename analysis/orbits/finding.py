"""The orbit near given phases of impacts, by Newton's method: equations.md 4.7."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import CLOSE, TURN, OrbitError, PeriodicOrbit, evaluated, ordered
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.core.orbits import MOST_IMPACTS, Evaluation
from vibroimpact.fmus.errors import UsageError

MOST_STEPS = 60
"""Number of Newton steps after which the search for an orbit fails."""
MOST_HALVINGS = 12
"""Largest number of halvings of a Newton step until it leads nearer to the orbit."""


def find_orbit(
    body: ImpactingBody,
    phases: Sequence[float] | Floats,
    contacts: Sequence[int] | None = None,
    periods: int = 1,
    *,
    start: Floats | None = None,
) -> PeriodicOrbit:
    """Find the orbit near given phases of impacts, stable or not, by Newton's method: equations.md 4.7.

    Parameters
    ----------
    body : ImpactingBody
    phases : array, shape (p,)
        Forcing phases near those of the impacts, rad, ascending, within 2 pi `periods`.
    contacts : sequence of int, shape (p,), optional
        Contact of each impact, from 0; by default the first contact.
    periods : int
        q.
    start : array, shape (2 modes,), optional
        Where stops yield, a state near to that before the first impact.

    Raises
    ------
    UsageError
        The phases or contacts are no impacts.
    OrbitError
        There is no orbit near the phases.
    """
    at: Floats = np.array(phases, dtype=np.float64)
    hit = np.zeros(at.size, np.int32) if contacts is None else np.array(contacts, dtype=np.int32)
    _refuse_no_train(body, at, hit, periods)
    found = evaluated(body, hit, at, periods, start)
    for _ in range(MOST_STEPS):
        error = float(np.abs(found.distances).max())
        if body.yields and error <= CLOSE * body.scale:
            break  # rounding decides nothing more
        step = np.linalg.lstsq(found.distance_slopes, found.distances, rcond=None)[0].astype(np.float64)
        nearer = _damped_step(body, hit, at, shortened(step, at, periods), periods, found)
        if nearer is None:
            break
        at, found = nearer
    # next to a fold, phases are known only to the square root of rounding
    error = float(np.abs(found.distances).max())
    if error <= 1e3 * CLOSE * body.scale:
        return ordered(PeriodicOrbit(body, periods, at, hit, found.velocities, found.start))
    raise OrbitError(
        f"orbit: expected an orbit P({at.size},{periods}) near to the phases "
        f"{np.round(np.asarray(phases, dtype=float), 6).tolist()}, got none: Newton's method ends {error:.2g} m "
        "from the stops."
    )


def _damped_step(
    body: ImpactingBody,
    contacts: NDArray[np.int32],
    phases: Floats,
    step: Floats,
    periods: int,
    now: Evaluation,
) -> tuple[Floats, Evaluation] | None:
    """Return phases nearer to an orbit, a part of a step away; None if there are none."""
    error = float(np.abs(now.distances).max())
    for _ in range(MOST_HALVINGS):
        tried = phases - step
        found = evaluated(body, contacts, tried, periods, now.start)
        if float(np.abs(found.distances).max()) < error:
            return tried, found
        step = 0.5 * step
    return None


def shortened(step: Floats, phases: Floats, periods: int) -> Floats:
    """Return a step of the phases, or a part of it that keeps the impacts in their order and within their train."""
    gaps = np.append(phases[1:], phases[0] + TURN * periods) - phases
    if not gaps.min() > 0.0:
        raise OrbitError(
            f"orbit: expected impacts one after the other, got two at one phase of {np.round(phases, 6).tolist()}."
        )
    closing = step - np.append(step[1:], step[0])
    most = float(np.max(-closing / gaps, initial=0.0))
    part = min(1.0, 0.5 / most if most > 0.0 else 1.0, 0.5 / max(float(np.abs(step).max()), 0.5))
    return part * step


def _refuse_no_train(body: ImpactingBody, phases: Floats, contacts: NDArray[np.int32], periods: int) -> None:
    most = f"1 to {MOST_IMPACTS} impacts"
    if not (1 <= phases.size <= MOST_IMPACTS and contacts.shape == phases.shape and periods >= 1):
        raise UsageError(f"orbit: expected {most} in 1 or more periods, got {phases.size} in {periods}.")
    if not (np.isfinite(phases).all() and (np.diff(phases) > 0.0).all() and np.ptp(phases) < TURN * periods):
        raise UsageError(
            f"orbit: phases: expected ascending ones within {periods} turns, got {phases.tolist()}."
        )
    if not ((contacts >= 0) & (contacts < len(body.contacts))).all():
        raise UsageError(f"orbit: contacts: expected 0 to {len(body.contacts) - 1}, got {contacts.tolist()}.")
