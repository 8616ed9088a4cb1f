"""The study `classify`: each run is P(p,q), quasi-periodic, chaos, rest, no impacts, or unknown with a reason.

A run shows its state once in each forcing period. A motion repeats after q periods if the distance between states q
periods apart is 0, or tends to 0. A slow transient with a multiplier near -1 alternates for long, but its distances
shrink by a constant factor. The distances of a doubled period do not.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import dataset_place, open_dataset, read_runs
from vibroimpact.analysis.dataset.accessor import columns_of_runs, run_ids
from vibroimpact.analysis.dataset.clock import turns_of_sines
from vibroimpact.analysis.dataset.columns import OF_ALL_PERIODS
from vibroimpact.analysis.dataset.schema import RULES, OrbitClass, Outcome, UnitSystem, attributes_of
from vibroimpact.analysis.files.stores import Place
from vibroimpact.analysis.operations.classify import Classify
from vibroimpact.analysis.orbits.impact_classes import (
    has_named_contacts,
    has_no_force,
    impacts_of_runs,
    own_period,
    states_of_periods,
    states_of_section,
)
from vibroimpact.analysis.orbits.rotation import FEWEST_STATES, Rotation, rotation_of, rotations_in_words
from vibroimpact.analysis.study import Study, whole
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.html_view import html_table
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.terminal import wide_terminal

Floats = NDArray[np.float64]

SAME = 1e-6
"""Distance of two states, over the size of the motion, below which they are equal."""
NEAR_ZERO = 0.1
"""Limit of shrinking distances, over the last distance, below which the limit counts as 0."""
LEAST_DECAY = 1e-4
"""Smallest relative decrease of the distances in a turn that reveals a transient."""
FEWEST, FEWEST_OF_CHAOS = 6, 40
"""Recorded periods below which the class is unknown, and below which no run is called chaos."""
GROWTH, PERIODS_AHEAD = 0.05, 6
"""Rate, 1 / period, above which the separation of neighbouring states is chaos; number of periods ahead."""
GROWTH_BESIDE_SINES = 0.1
"""The same rate under sines without a common period, where a motion that is not chaotic may have a rate of 0.08."""
LEAST_FALL = 5.0
"""Fall of the distance of two rounds over a run, over a round's change, above which the rounds may be equal."""
_MOST_SHOWN = 6
"""Largest number of classes listed in one line."""
_STATES = ("strobe_displacement", "strobe_velocity", "displacement_max", "displacement_min")
_BESIDE = ("impacts_per_period", "stick_count")
_OPEN = "rests are not recorded: p may stand for infinitely many"


@dataclass(frozen=True, slots=True)
class RunClass:
    """The class of a run.

    Attributes
    ----------
    kind : OrbitClass
    impacts, periods : int
        p and q of a repeating motion; otherwise 0; p is -1 for infinitely many impacts. The q of a quasi-periodic
        motion is the number of its curves in the strobe section.
    reason : str
        Reason why the class is unknown, or what the dataset leaves open.
    rotation : Rotation or None
        Rotation number of a quasi-periodic motion.
    """

    kind: OrbitClass
    impacts: int = 0
    periods: int = 0
    reason: str = ""
    rotation: Rotation | None = None

    @property
    def name(self) -> str:
        """The class in words: `P(1,1)`, `P(inf,2)`, `no impacts`, `quasi-periodic`, `chaos`, `rest`, `unknown`."""
        if self.kind in (OrbitClass.periodic, OrbitClass.sticking):
            return f"P({self.impacts if self.impacts >= 0 else 'inf'},{self.periods})"
        return self.kind.words


class ClassesOfRuns(list[RunClass]):
    """The classes of the runs of a dataset, in the order of its file.

    Parameters
    ----------
    classes : iterable of RunClass
    runs : xarray.Dataset
        The classified dataset.
    """

    def __init__(self, classes: Iterable[RunClass], runs: xr.Dataset) -> None:
        super().__init__(classes)
        self._runs = runs

    @property
    def dataset(self) -> xr.Dataset:
        """The classified dataset, with `class_kind`, `class_impacts`, `class_periods`, `class_reason`.

        Quasi-periodic runs have `class_rotation_number` and `class_rotation_error`.
        """
        units: UnitSystem = self._runs.attrs.get("units_system", "SI")
        run_id = run_ids(self._runs)
        columns = {}
        for name, values in _columns(self).items():
            fill = {"O": "", "f": np.nan}.get(values.dtype.kind, -1)
            missing = np.array([fill], dtype=values.dtype)
            placed = np.asarray(np.concatenate([values, missing])[run_id.values])
            columns[name] = (run_id.dims, placed, attributes_of(name, units))
        return self._runs.assign(columns)

    def __repr__(self) -> str:
        counts = Counter(each.name for each in self).most_common(_MOST_SHOWN + 1)
        listed = [f"{count} {name}" for name, count in counts[:_MOST_SHOWN]]
        return f"<classes of {len(self)} runs: {', '.join(listed + ['...'] * (len(counts) > _MOST_SHOWN))}>"

    def _repr_html_(self) -> str:
        return html_table(f"Classes of {len(self)} runs", ("class", "runs", "why"), self.counted())

    def counted(self) -> list[tuple[str, int, str]]:
        """Return each class with its number of runs, and the reason or the range of the rotation numbers."""
        counts = Counter((each.name, each.reason) for each in self).most_common()
        numbers = rotations_in_words([each.rotation for each in self if each.rotation is not None])
        is_turning = OrbitClass.quasi_periodic.words
        return [(name, count, numbers if name == is_turning else why) for (name, why), count in counts]


@dataclass(eq=False)
class ClassesOfDataset(Study[RunClass]):
    """The classes of the runs of a dataset; a row is the class of a run."""

    name = "classify"
    nothing = "a class"
    named = (DatasetError,)
    mark = "classified_from"
    figure = "classes"

    runs: xr.Dataset
    """Dataset from `open_dataset`."""
    file: Place | None = None

    @classmethod
    def reads(cls, options: Classify) -> Sequence[Place]:
        """Return the file of the dataset."""
        return [dataset_place(options.file)]

    @classmethod
    def marks(cls, options: Classify) -> Mapping[str, Any]:
        """Return the path of the dataset."""
        return {cls.mark: str(options.file)}

    @classmethod
    def same(cls, options: Classify) -> Mapping[str, Any]:
        """Return the path of the dataset: a dataset with classes is a dataset of runs."""
        return cls.marks(options)

    @classmethod
    def prepare(cls, options: Classify, stack: ExitStack) -> Self:
        """Open the dataset."""
        file = dataset_place(options.file)
        return cls(stack.enter_context(open_dataset(file)), file)

    def rows(self) -> Generator[RunClass, None, None]:
        """Classify run after run.

        A dataset of one value for all periods, or without strobe and extrema, raises DatasetError.
        """
        runs = self.runs
        turns = turns_of_sines(runs, "classify")
        columns = [name for name in _STATES if name in runs.variables]
        own = not columns and not has_named_contacts(runs) and has_no_force(runs)
        if not columns and (own or has_named_contacts(runs)):
            ends = runs.vibroimpact.runs["outcome"].values
            for each, end in zip(impacts_of_runs(runs), ends, strict=True):
                yield _by_impacts(*each, Outcome(int(end)), by_section=own)
            return
        if not columns:
            raise DatasetError(
                "classify: expected strobe or extrema in the dataset, got neither. Record them."
            )
        for name in columns:
            if runs[name].attrs.get("long_name") == OF_ALL_PERIODS.get(name, ""):
                raise DatasetError(
                    "classify: expected values of each period, got one for all. Run with each_period."
                )
        known: dict[RunClass, RunClass] = {}  # millions of runs have few classes
        further, place = [name for name in _BESIDE if name in runs.variables], -1
        open_count = "stick_count" not in runs.variables and _may_rest(runs)
        for block in columns_of_runs(runs, [*columns, *further, "outcome"]):
            states = np.stack([block[name] for name in columns], axis=-1)
            counts, sticks = (block.get(name) for name in _BESIDE)
            for run, outcome in enumerate(block["outcome"]):
                place += 1
                beside = (
                    None if counts is None else counts[run],
                    Outcome(int(outcome)),
                    sticks is not None and bool(sticks[run] > 0),
                )
                found = class_of(states[run], *beside, None if turns is None else turns[place])
                if found.kind in (OrbitClass.unknown, OrbitClass.chaos):
                    found = _up_to_shift(states[run], columns, *beside) or found
                if open_count and found.kind is OrbitClass.periodic:
                    found = replace(found, reason=_OPEN)
                yield known.setdefault(found, found)

    @property
    def classes(self) -> ClassesOfRuns:
        """The class of each run; runs that were not studied are unknown."""
        left = self.runs.vibroimpact.runs.sizes["run"] - len(self.found)
        unknown = RunClass(OrbitClass.unknown, reason=f"not looked at: {self.incomplete}")
        return ClassesOfRuns([*self.found, *[unknown] * left], self.runs)

    def made(self) -> xr.Dataset:
        """Return the runs of the file with their classes, one-dimensional."""
        assert self.file is not None
        return with_classes(read_runs(self.file), self.classes, self.runs.attrs["units_system"])

    def print_results(self) -> None:
        """Print the number of runs of each class."""
        rows = table("Classes of the runs", "<class", ">runs", "<why")
        for name, count, reason in self.classes.counted():
            rows.add_row(name, f"{count}", reason)
        wide_terminal().print(rows)


def classify(dataset: xr.Dataset) -> ClassesOfRuns:
    """Return the class of each run, in the order of the file.

    Parameters
    ----------
    dataset : xarray.Dataset
        A dataset from `open_dataset`, with the strobe or the extrema of each recorded period. Impacts, or their number
        in each period, are needed too; without them a motion may be periodic, but with an unknown number of impacts.
        For components that hit each other impacts are enough, but do not show chaos. For a body without a force impacts
        are enough: those on the first contact take the place of the forcing periods.

    Returns
    -------
    list of RunClass
        The classes. Their `dataset` has the same runs, in the shape of their sweep, for `draw`.

    Raises
    ------
    DatasetError
        The dataset has one value for all periods, or neither strobe nor extrema.
    """
    return whole(ClassesOfDataset(dataset)).classes


def _may_rest(runs: xr.Dataset) -> bool:
    """Tell whether a body may come to rest on a rigid stop."""
    return any(name.endswith("restitution") for name in map(str, runs.variables))


def _by_impacts(
    impacts: xr.Dataset, frequency: float | None, outcome: Outcome, *, by_section: bool
) -> RunClass:
    """Return the class of a run from its impacts alone; a section of them shows the chaos of a body without a force."""
    if outcome is not Outcome.ok:
        return class_of(np.empty((0, 1)), None, outcome)
    if not impacts.sizes["impact"]:
        return RunClass(OrbitClass.no_impacts)
    if frequency is None:
        return RunClass(OrbitClass.unknown, reason="several forcing frequencies")
    if not frequency:
        if impacts.sizes["impact"] < FEWEST:
            return RunClass(OrbitClass.unknown, reason=f"fewer than {FEWEST} recorded impacts")
        count, why = own_period(impacts, SAME)
        if count:
            return RunClass(OrbitClass.periodic, count, 1)
        found = _of_section(impacts) if by_section and "die away" not in why else None
        return RunClass(OrbitClass.unknown, reason=why) if found is None else found
    states, counts = states_of_periods(impacts, frequency)
    found = class_of(states, counts, has_stuck=bool(np.isinf(counts).any()))
    if found.kind is not OrbitClass.chaos:
        return found
    reason = f"no period up to {len(states) // 2}; impacts alone do not tell chaos"
    return RunClass(OrbitClass.unknown, reason=reason)


def _of_section(impacts: xr.Dataset) -> RunClass | None:
    """Return the class of a motion without a force by the impacts on one contact; None where they do not show it."""
    states, counts = states_of_section(impacts)
    found = class_of(states, counts)
    if found.kind is OrbitClass.periodic:
        return RunClass(OrbitClass.periodic, found.impacts, 1)
    return found if found.kind is OrbitClass.chaos else None


def with_classes(flat: xr.Dataset, classes: Sequence[RunClass], units: UnitSystem) -> xr.Dataset:
    """Return a one-dimensional dataset with the classes of its runs, as it is written to a file.

    The dataset comes from `read_runs`; the classes are in the order of its runs.
    """
    columns = _columns(classes).items()
    return flat.assign({name: ("run", values, attributes_of(name, units)) for name, values in columns})


def _columns(classes: Sequence[RunClass]) -> dict[str, NDArray[Any]]:
    """Return the variables of classes, run by run."""
    rotations = [each.rotation for each in classes]
    columns = {
        "class_kind": [each.kind for each in classes],
        "class_impacts": [each.impacts for each in classes],
        "class_periods": [each.periods for each in classes],
        "class_reason": [each.reason for each in classes],
        "class_rotation_number": [np.nan if each is None else each.number for each in rotations],
        "class_rotation_error": [np.nan if each is None else each.error for each in rotations],
    }
    return {name: np.array(values, dtype=RULES[name].dtype) for name, values in columns.items()}


def class_of(
    states: Floats,
    impacts: Floats | None,
    outcome: Outcome = Outcome.ok,
    has_stuck: bool = False,
    turns: Floats | None = None,
) -> RunClass:
    """Return the class of one run.

    Parameters
    ----------
    states : array, shape (period, quantity)
        Observed state of each forcing period; rows with NaN are left out.
    impacts : array, shape (period,), or None
        Impacts in each period; infinite for a complete chatter; None: not recorded.
    outcome : Outcome
    has_stuck : bool
        Whether the run has rested on a stop.
    turns : array, shape (sine,), or None
        Turns of sines without a common period in a forcing period; their phases are part of the state. Chaos then
        needs as many periods as quasi-periodic motion. None: all forces repeat with the forcing period.

    Examples
    --------
    >>> class_of(np.tile([[1.0], [2.0]], (10, 1)), np.tile([1.0, 0.0], 10)).name
    'P(1,2)'
    """
    if outcome is Outcome.stuck:
        return RunClass(OrbitClass.rest)
    if outcome is not Outcome.ok:
        return RunClass(OrbitClass.unknown, reason=f"the run ended by {outcome.name}")
    there = np.isfinite(states).all(axis=1)
    if impacts is not None:
        there &= ~np.isnan(impacts)
    states, impacts = states[there], None if impacts is None else impacts[there]
    if len(states) < FEWEST:
        return RunClass(OrbitClass.unknown, reason=f"fewer than {FEWEST} recorded periods")
    size = float(np.abs(states).max())
    scale = np.fmax(np.abs(states).max(axis=0), 1e-3 * size)
    scaled = states / np.where(scale > 0.0, scale, 1.0)
    if impacts is not None and not impacts.any() and not has_stuck:
        return RunClass(OrbitClass.no_impacts if size > 0.0 else OrbitClass.rest)
    for periods in range(1, len(states) // 2 + 1):
        if not _repeats(scaled, periods):
            continue
        if periods % 2 == 0 and _closes(scaled, periods // 2):
            reason = f"repeats after {periods} periods, or after {periods // 2}: it comes together too slowly to tell"
            return RunClass(OrbitClass.unknown, 0, periods, reason)
        return _repeating(impacts, periods, has_stuck)
    return _without_period(scaled, turns, has_stuck)


def _without_period(scaled: Floats, turns: Floats | None, has_stuck: bool) -> RunClass:
    """Return the class of states that do not repeat; the arguments are those of `class_of`."""
    known = None if turns is None or turns.size != 1 else float(turns[0])
    if rotation := rotation_of(scaled, known):
        return RunClass(OrbitClass.quasi_periodic, 0, rotation.curves, rotation=rotation)
    fewest = FEWEST_OF_CHAOS if turns is None else FEWEST_STATES
    if len(scaled) < fewest:
        reason = f"no period up to {len(scaled) // 2}; {fewest} recorded periods tell chaos"
        return RunClass(OrbitClass.unknown, reason=reason)
    if turns is not None and not turns.size:
        return RunClass(OrbitClass.unknown, reason="frequencies of the forces are unknown")
    if turns is not None and has_stuck:
        return RunClass(
            OrbitClass.unknown, reason="rests on a stop, where neighbours meet, under several sines"
        )
    if turns is not None:
        angles = 2.0 * np.pi * np.outer(np.arange(len(scaled)), turns)
        scaled = np.concatenate([scaled, np.cos(angles), np.sin(angles)], axis=1)
    if _growth(scaled) >= (GROWTH if turns is None else GROWTH_BESIDE_SINES):
        return RunClass(OrbitClass.chaos)
    more = f"; {FEWEST_STATES} recorded periods tell quasi-periodic motion" * (len(scaled) < FEWEST_STATES)
    reason = f"no period up to {len(scaled) // 2}, and neighbours do not part{more}"
    return RunClass(OrbitClass.unknown, reason=reason)


def _up_to_shift(
    states: Floats, columns: Sequence[str], impacts: Floats | None, outcome: Outcome, has_stuck: bool
) -> RunClass | None:
    """Return the class of a motion that repeats up to a shift, as of a body that nothing ties; None for others."""
    if not set(_STATES) <= set(columns) or not np.isfinite(states).all():
        return None
    place, velocity, highest, lowest = (states[:, columns.index(name)] for name in _STATES)
    found = class_of(
        np.column_stack([velocity, highest - place, lowest - place]), impacts, outcome, has_stuck
    )
    if found.kind is not OrbitClass.periodic:
        return None
    shifts = place[found.periods :] - place[: -found.periods]
    size = max(float((highest - lowest).max()), float(np.abs(shifts).max()))
    return found if np.ptp(shifts[-max(found.periods, 2) :]) <= SAME * size else None


def _repeating(impacts: Floats | None, periods: int, has_stuck: bool) -> RunClass:
    if impacts is None:
        return RunClass(
            OrbitClass.unknown, 0, periods, f"repeats after {periods} periods; impacts are not recorded"
        )
    last = impacts[-periods:]
    if has_stuck or np.isinf(last).any():
        return RunClass(OrbitClass.sticking, -1, periods)
    before = impacts[-2 * periods : -periods]
    if before.size == periods and float(last.sum()) != float(before.sum()):
        reason = f"repeats after {periods} periods, but not its number of impacts"
        return RunClass(OrbitClass.unknown, 0, periods, reason)
    count = round(float(last.sum()))
    return RunClass(OrbitClass.periodic if count else OrbitClass.no_impacts, count, periods)


def _repeats(states: Floats, periods: int) -> bool:
    """Tell whether states `periods` apart are equal, or approach each other by a constant factor."""
    distances = np.abs(states[periods:] - states[:-periods]).max(axis=1)
    if distances[-max(periods, 2) :].max() <= SAME:
        return True
    # compared two turns later, at the same place of the orbit, since a multiplier near -1 alternates
    before, after = distances[: -2 * periods], distances[2 * periods :]
    if before.size < max(4, 2 * periods) or not (distances > 0.0).all():
        return False
    return _goes_to_zero(before, after) or _dies_away(distances)


def _closes(states: Floats, half: int) -> bool:
    """Tell whether the two rounds of a doubled period approach each other all the time."""
    distances = np.abs(states[half:] - states[:-half]).max(axis=1)
    change = float(np.abs(states[2 * half :] - states[: -2 * half]).max())
    if change > SAME:  # decided by the decrease of its distances
        return False
    parts = np.array_split(distances, 4)
    falls = all(float(late.mean()) < float(early.mean()) for early, late in itertools.pairwise(parts))
    return falls and float(distances[0] - distances[-1]) > LEAST_FALL * change


def _goes_to_zero(before: Floats, after: Floats) -> bool:
    """Tell whether after = ratio before + rest is a straight line that leads to 0: a real multiplier."""
    middle = before.mean()
    spread = before - middle
    square = float(spread @ spread)
    if square <= (1e-9 * middle) ** 2:
        return False
    ratio = float(spread @ (after - after.mean())) / square
    rest = float(after.mean() - ratio * middle)
    if not ratio < 1.0 - LEAST_DECAY or ratio <= 0.0:
        return False
    straight = float(np.abs(after - ratio * before - rest).max()) <= 1e-3 * float(before.max())
    return straight and abs(rest / (1.0 - ratio)) <= NEAR_ZERO * float(after[-1])


def _dies_away(distances: Floats) -> bool:
    """Tell whether distances fall by a lot, and steadily except for a complex multiplier."""
    thirds = [float(part.max()) for part in np.array_split(distances, 3)]
    if not (thirds[1] < 0.5 * thirds[0] and thirds[2] < 0.5 * thirds[1]):
        return False
    places = np.arange(distances.size)
    slope, start = np.polyfit(places, np.log(distances), 1)
    off = float(np.std(np.log(distances) - slope * places - start))
    return bool(slope < 0.0 and off < 0.25 * abs(slope) * distances.size)


def _growth(states: Floats) -> float:
    """Return the mean rate at which neighbouring states separate, 1 / period (Rosenstein's estimate)."""
    count = len(states) - PERIODS_AHEAD
    distances = np.abs(states[:count, None] - states[None, :count]).max(axis=2)
    np.fill_diagonal(distances, np.inf)
    nearest = distances.argmin(axis=1)
    now = distances[np.arange(count), nearest]
    later = np.abs(states[PERIODS_AHEAD:] - states[nearest + PERIODS_AHEAD]).max(axis=1)
    separate = (now > 0.0) & (later > 0.0)
    return float(np.mean(np.log(later[separate] / now[separate]))) / PERIODS_AHEAD if separate.any() else 0.0
