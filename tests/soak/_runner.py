"""Hands cases to child processes until all are tried or the time is up."""

from __future__ import annotations

import os
import selectors
import time
from collections.abc import Callable, Iterator, Sequence

from soak._child import Child
from soak._journal import Journal, Tried
from soak._kinds import Kind

LONGEST_BLOCK, BLOCKS = 50, 100
"""Most cases of one kind in a row, and fewest blocks of a kind: a process keeps one kind for a block."""
LOOK_SECONDS = 0.2
"""Time between looks at children that do not answer."""

Counts = dict[str, int]


def run(
    kinds: Sequence[Kind],
    counts: Counts,
    base: int,
    journal: Journal,
    seconds: float,
    *,
    processes: int | None = None,
    report: Callable[[Tried], None] = lambda entry: None,
) -> bool:
    """Try all cases of all kinds that the journal does not hold; return whether they are all tried.

    Parameters
    ----------
    kinds : sequence of Kind
        Kinds of one package; they advance side by side, by equal shares, after the kinds whose cases run alone.
    counts : dict
        Number of cases of each kind, by name.
    base : int
        Base seed.
    journal : Journal
        Finished cases; new ones are added.
    seconds : float
        Wall time after which no case starts; unfinished cases are given up.
    processes : int, optional
        Number of child processes; one for each core.
    tell : function of Tried, optional
        Called for every case.
    """
    end = time.monotonic() + seconds
    alone = [kind for kind in kinds if kind.is_alone]
    shared = [kind for kind in kinds if not kind.is_alone]
    parts = [(part, number) for part, number in ((alone, 1), (shared, processes)) if part]
    return all([_run(part, counts, base, journal, end, number, report) for part, number in parts])


def _run(
    kinds: Sequence[Kind],
    counts: Counts,
    base: int,
    journal: Journal,
    end: float,
    processes: int | None,
    report: Callable[[Tried], None],
) -> bool:
    """Try the cases of kinds side by side until an instant; return whether they are all tried."""
    waiting = _waiting(kinds, counts, base, journal)
    remaining = sum(counts[kind.name] for kind in kinds) - len(_tried(kinds, counts, journal))
    children = [Child(kinds[0].package) for _ in range(min(processes or os.cpu_count() or 1, remaining))]
    busy = [child for child in children if _hand_next(child, waiting)]
    try:
        while busy and time.monotonic() < end:
            for child, (taken, problem) in _answers(busy):
                assert child.at is not None
                kind, case, seed = child.at
                entry = Tried(kind.name, case, seed, round(taken, 4), problem)
                journal.add(entry)
                report(entry)
                if not _hand_next(child, waiting):
                    busy.remove(child)
    finally:
        for child in children:
            child.close()
    return not busy


def _tried(kinds: Sequence[Kind], counts: Counts, journal: Journal) -> set[tuple[str, int]]:
    names = {kind.name for kind in kinds}
    return {(name, case) for name, case in journal.tried if name in names and case < counts[name]}


def _waiting(
    kinds: Sequence[Kind], counts: Counts, base: int, journal: Journal
) -> Iterator[tuple[Kind, int, int]]:
    """Yield cases that are not yet tried, all kinds advancing by equal shares."""
    tried = _tried(kinds, counts, journal)
    order: list[tuple[float, str, int]] = []
    for kind in kinds:
        count = counts[kind.name]
        block = min(LONGEST_BLOCK, -(-count // BLOCKS))
        order += ((case // block * block / count, kind.name, case) for case in range(count))
    by_name = {kind.name: kind for kind in kinds}
    for _, name, case in sorted(order):
        if (name, case) not in tried:
            yield by_name[name], case, by_name[name].seed(base, case)


def _hand_next(child: Child, waiting: Iterator[tuple[Kind, int, int]]) -> bool:
    following = next(waiting, None)
    child.at = None
    if following is not None:
        child.hand(*following)
    return following is not None


def _answers(busy: Sequence[Child]) -> list[tuple[Child, tuple[float, str | None]]]:
    """Wait a moment for answers; return the answers, and the reports of children whose time is up."""
    with selectors.DefaultSelector() as selector:
        for child in busy:
            selector.register(child.answers, selectors.EVENT_READ, child)
        ready = [key.data for key, _ in selector.select(LOOK_SECONDS)]
    answers: list[tuple[Child, tuple[float, str | None]]] = [(child, child.answer()) for child in ready]
    late = ((child, child.overdue()) for child in busy if child not in ready)
    return answers + [(child, given) for child, given in late if given is not None]
