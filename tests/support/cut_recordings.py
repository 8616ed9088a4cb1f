"""Runs that are recorded whole and in parts: the places of cuts, and the sum of the parts' events."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.point import driver_of
from vibroimpact.orchestrator.run.record import RecordedBody
from vibroimpact.orchestrator.scene import Scene

Floats = NDArray[np.float64]

AGREEMENT = {"fused": 1e-5, "coupled": 1e-3}
"""Largest difference of one event's time in two runs, relative to the duration. Impacts multiply rounding; with the
stop of another FMU, a cut also changes the steps of a contact."""
ROOM = 1e-12
"""Time from a border within which an event counts as on it, s: `body/landing.c` for coupled runs, else rounding."""
EARLIEST = 1e-3
"""Earliest cut, s: a touch without speed at the start is a row where its contact goes on at the cut."""
MOST_EVENTS = 40
"""Number of events of a run beyond which chaos may have multiplied rounding by any factor."""
FAINT = 1e-5
"""Impact velocity after time 0, m/s, below which rounding decides whether it is an impact; motions have .1 to 3 m/s."""
TIME, VELOCITY, CONTACT_OF_IMPACT, DURATION, CONTACT_OF_STICK = 0, 2, 4, 6, 2
"""Columns of impacts and sticks."""


class Events(NamedTuple):
    """Events of a recording: impacts, shape (n, 7), and sticks, shape (n, 3), of `RecordedBody`."""

    impacts: Floats
    sticks: Floats


def recorded(driver: RecordedBody, scene: Scene, begin: float, end: float) -> Events:
    """Return the events of a recording from `begin` to `end`, s, of a run that starts at time 0."""
    driver.begin(float_parameters(scene, None), None)
    driver.advance(begin)
    driver.record(impacts=True, extrema=False, periods=False)
    driver.advance(end)
    return Events(driver.impacts(), driver.sticks())


def is_faint(events: Events) -> bool:
    """Whether an impact of a run is a graze, which may vanish in the same run with other steps."""
    later = events.impacts[events.impacts[:, TIME] > 0.0, VELOCITY]
    return bool((later < FAINT).any())


def in_one_run(driver: RecordedBody, scene: Scene, edges: Sequence[float]) -> list[Events]:
    """Return the events of successive recordings of one run, between instants, s; the first instant is 0."""
    driver.begin(float_parameters(scene, None), None)
    parts: list[Events] = []
    for end in edges[1:]:
        driver.record(impacts=True, extrema=False, periods=False)
        driver.advance(end)
        parts.append(Events(driver.impacts(), driver.sticks()))
        driver.rows.blocks = []
    return parts


def cuts_of(whole: Events, end: float, share: float) -> list[float]:
    """Return cuts of a run: at a share of it, and at, in and after one of its contacts and one of its rests."""
    cuts = [share * end]
    if len(whole.impacts):
        row = whole.impacts[int(share * len(whole.impacts))]
        duration = row[DURATION] if row[DURATION] > 0.0 else 1e-3
        cuts += [row[TIME], row[TIME] + 0.5 * duration, row[TIME] + duration]
    if len(whole.sticks):
        row = whole.sticks[int(share * len(whole.sticks))]
        last = row[1] if np.isfinite(row[1]) else end
        cuts += [row[TIME], 0.5 * (row[TIME] + last), last]
    return [float(cut) for cut in cuts if EARLIEST < cut < end]


def problem_of_cuts(
    scene: Scene, how: str, share: float, end: float, *, all_at_once: bool = False
) -> str | None:
    """Return the first difference between a run and its parts, cut by `cuts_of`; None without one.

    Parameters
    ----------
    scene : Scene
        A scene of the short form.
    how : str
        `fused` or `coupled`.
    share : float
        Place of the cut, as a part of the run, 0 to 1.
    end : float
        End of the run, s.
    all_at_once : bool
        Whether one more run is cut at all these instants; each instant alone has two runs.
    """
    driver = driver_of(scene, how)
    driver.watch(contacts=len(scene.stops))
    try:
        whole = recorded(driver, scene, 0.0, end)
        times = np.sort(np.concatenate([rows[:, TIME] for rows in whole]))[:MOST_EVENTS]
        if len(times) == MOST_EVENTS:
            # the end is moved between two events: rounding may move an event at the end beyond it
            longest = int(np.diff(times).argmax())
            end = float(times[longest : longest + 2].mean())
            whole = recorded(driver, scene, 0.0, end)
        cuts = cuts_of(whole, end, share)
        for edges in [[0.0, cut, end] for cut in cuts] + (
            [[0.0, *sorted(set(cuts)), end]] if all_at_once else []
        ):
            # several cuts are made in one run: two later recordings would both have, or lose, an event at their border
            is_one_run = len(edges) > 3
            windows = pairwise(edges)
            parts = (
                in_one_run(driver, scene, edges)
                if is_one_run
                else [recorded(driver, scene, *w) for w in windows]
            )
            problem = difference(parts, edges, whole, AGREEMENT[how] * end)
            if problem is not None and not any(map(is_faint, [whole, *parts])):
                return f"cut at {edges[1:-1]} of {end:.17g} s: {problem}"
    finally:
        driver.close()
    return None


def difference(parts: Sequence[Events], edges: Sequence[float], whole: Events, allowed: float) -> str | None:
    """Return the difference between the events of successive recordings and of the whole; None without one.

    Parameters
    ----------
    parts : sequence of Events
    edges : sequence of float
        Borders of the parts, s; one more than there are parts.
    whole : Events
    allowed : float
        Largest difference of times, s.
    """
    joints = _joints(parts, edges[1:]) | _joints([whole], edges[-1:])
    whole, *parts = (_joined(each, joints, allowed) for each in (whole, *parts))
    for name, rows_of, number in (("impacts", 0, CONTACT_OF_IMPACT), ("sticks", 1, CONTACT_OF_STICK)):
        for part, (begin, end) in zip(parts, pairwise(edges), strict=True):
            times = part[rows_of][:, TIME]
            if not ((times >= begin - ROOM) & (times <= end + ROOM)).all():
                return f"{name} at {times.tolist()} of a recording from {begin:.17g} to {end:.17g} s"
        both, all_rows = (
            rows[np.lexsort((rows[:, number], rows[:, TIME]))]  # events at one instant have no order
            for rows in (np.concatenate([part[rows_of] for part in parts]), whole[rows_of])
        )
        if len(both) != len(all_rows):
            counts = " + ".join(str(len(part[rows_of])) for part in parts)
            return f"{name}: {counts} for {len(all_rows)}"
        if (both[:, number] != all_rows[:, number]).any():
            return f"{name} of other stops: {both[:, number].tolist()} for {all_rows[:, number].tolist()}"
        apart = float(np.abs(both[:, TIME] - all_rows[:, TIME]).max(initial=0.0))
        if not apart <= allowed:
            return f"{name} are {apart:.2g} s apart, allowed {allowed:.2g} s"
    return _wrongly_open(parts, edges, whole, allowed)


def _joints(parts: Sequence[Events], ends: Sequence[float]) -> set[tuple[float, float]]:
    """Return contacts and instants at which a rest ends and begins again: rounding parts a rest without load."""
    found: set[tuple[float, float]] = set()
    last: dict[float, float] = {}
    for part, end in zip(parts, ends, strict=True):
        for start, until, contact in part.sticks[np.argsort(part.sticks[:, TIME], kind="stable")].tolist():
            if abs(start - last.get(contact, -np.inf)) <= ROOM:
                found.add((contact, start))
            last[contact] = end if np.isnan(until) else until
    return found


def _joined(events: Events, joints: set[tuple[float, float]], allowed: float) -> Events:
    """Return a recording whose rests go on where another rest of the contact begins at such an instant."""
    rows: list[Floats] = []
    for row in events.sticks[np.argsort(events.sticks[:, TIME], kind="stable")].copy():
        own = [at for contact, at in joints if contact == row[CONTACT_OF_STICK]]
        if not any(abs(row[TIME] - at) <= allowed for at in own):
            rows.append(row)
            continue
        for before in rows:
            if before[CONTACT_OF_STICK] == row[CONTACT_OF_STICK] and abs(before[1] - row[TIME]) <= allowed:
                before[1] = row[1]
    return Events(events.impacts, np.array(rows).reshape(-1, events.sticks.shape[1]))


def _wrongly_open(
    parts: Sequence[Events], edges: Sequence[float], whole: Events, allowed: float
) -> str | None:
    """Return contacts or rests that are open at the end of their recording although over, or closed although open."""
    ends = np.concatenate(
        [np.full(len(part.impacts), end) for part, end in zip(parts, edges[1:], strict=True)]
    )
    is_open = np.isnan(np.concatenate([part.impacts for part in parts])[:, DURATION])
    last = whole.impacts[:, TIME] + whole.impacts[:, DURATION]
    lasts = ~(last < ends - allowed)  # open at the end of the whole run, too
    over = ~np.isnan(last) & (last < ends + allowed)
    if (wrong := (is_open & ~lasts) | (~is_open & ~over)).any():
        return f"contacts at {whole.impacts[wrong, TIME].tolist()} s are open, or not, though they are not, or are"
    ends = np.concatenate(
        [np.full(len(part.sticks), end) for part, end in zip(parts, edges[1:], strict=True)]
    )
    is_open, last = np.isnan(np.concatenate([part.sticks for part in parts])[:, 1]), whole.sticks[:, 1]
    lasts, over = ~(last < ends - allowed), ~np.isnan(last) & (last < ends + allowed)
    if (wrong := (is_open & ~lasts) | (~is_open & ~over)).any():
        return (
            f"rests at {whole.sticks[wrong, TIME].tolist()} s are open, or not, though they are not, or are"
        )
    return None


def counts_differ(parts: Sequence[Sequence[int]], whole: Sequence[int]) -> str | None:
    """Return the difference between the counts of successive recordings and of the whole, for several points.

    Examples
    --------
    >>> counts_differ([[1, 2], [3, 4]], [4, 7])
    'point 2: 2 + 4 impacts for 7'
    """
    for point, counts in enumerate(zip(*parts, strict=True)):
        if math.fsum(counts) != whole[point]:
            return f"point {point + 1}: {' + '.join(map(str, counts))} impacts for {whole[point]}"
    return None
