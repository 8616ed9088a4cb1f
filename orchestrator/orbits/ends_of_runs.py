"""The motions on which long runs end along a range of one number: seeds of branches, and advice.

Runs go up the range and down again; each starts where the last one ended, so both branches of a hysteresis are met.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits import PeriodicOrbit
from vibroimpact.analysis.orbits.classify import RunClass
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import Argument, Either, Message, message
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.find import class_of_record, end_in_words, long_runs, orbit_of_impacts
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.run.runner import next_start
from vibroimpact.orchestrator.scene import Scene

NOTHING_TO_FOLLOW = (OrbitClass.no_impacts, OrbitClass.rest)
"""Classes of motions that are no branch of impacts."""


@dataclass(frozen=True, slots=True)
class RunEnd:
    """The motion on which a run ends.

    Attributes
    ----------
    value : float
        Value of the varied number.
    kind : RunClass
    orbit : PeriodicOrbit or None
        The orbit, refined from the last impacts; None for chaos, sticking, no impacts, and more than 16 periods.
    state : tuple of float or None
        State at the end, from which a run at a near value may start; None without one.
    """

    value: float
    kind: RunClass
    orbit: PeriodicOrbit | None
    state: State | None = None

    @property
    def name(self) -> str:
        """P(p,q) of its orbit, or its class in words."""
        if self.orbit is not None:
            return self.orbit.name
        return end_in_words(self.kind)


def ends_of_runs(
    scene: Scene,
    parameter: str,
    values: Sequence[float],
    looking: Callable[[float], None] = lambda value: None,
) -> Iterator[RunEnd]:
    """Yield the ends of runs over ascending values and back; values without a run are left out.

    `looking` is called with each value before its run.
    """
    with long_runs(scene) as record_of:
        start = None
        for value in [*values, *reversed(values)]:
            looking(value)
            try:
                body = impacting_body(scene.with_values({parameter: value}), all_kinds=True)
            except (SceneError, UsageError):
                continue  # the scene has no run there
            record = record_of({parameter: value}, start)
            start = next_start(record, start)
            yield RunEnd(value, class_of_record(record), orbit_of_impacts(body, record.impacts), start)


def where_runs_end(ends: Sequence[RunEnd], sought: tuple[int, int]) -> str:
    """Return advice for a range without orbits of some impacts and periods: the motions on which runs end there.

    There is at least one end.
    """
    counts = Counter(each.name for each in ends)
    orbits = Counter((each.orbit.phases.size, each.orbit.periods) for each in ends if each.orbit is not None)
    orbits.pop(sought, None)
    if orbits:
        (impacts, periods), count = orbits.most_common(1)[0]
        runs = f"{count} of {len(ends)} runs over the range end on P({impacts},{periods}): "
        return message(runs, _asking(impacts, periods), ".")
    others = ", ".join(f"{name} ({count})" for name, count in counts.most_common())
    return f"Runs over the range end on {others}. Try another range, or other impacts and periods."


def ends_in_words(ends: Sequence[RunEnd], followed: Callable[[RunEnd], bool]) -> list[str]:
    """Return a line on the motions on which runs end, and a line on the motions among them that are not followed."""
    left = [each for each in ends if each.kind.kind not in NOTHING_TO_FOLLOW and not followed(each)]
    rows = [f"{len(ends)} runs over the range, up and down, end on {_counted(ends)}."]
    if left:
        rows.append(f"Not followed: {_counted(left, with_ranges=True)}.")
    return rows


def _counted(ends: Sequence[RunEnd], *, with_ranges: bool = False) -> str:
    counts = Counter(each.name for each in ends)
    return ", ".join(
        f"{name} ({count}{_range(ends, name) if with_ranges else ''})" for name, count in counts.most_common()
    )


def _range(ends: Sequence[RunEnd], name: str) -> str:
    values = [each.value for each in ends if each.name == name]
    low, high = f"{min(values):.6g}", f"{max(values):.6g}"
    return f" at {low}" if low == high else f" from {low} to {high}"


def _asking(impacts: int, periods: int) -> Message:
    """Return the options that select orbits of some impacts and periods."""
    return message(Argument("impacts", impacts), Either(", ", " "), Argument("periods", periods))
