"""Basins of attraction: starts, the attractors on which they end, and the shares of these attractors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.schema import OrbitClass
from vibroimpact.analysis.orbits.attractors.chaotic_groups import NO_GROUPS, Blocks, Feature, Groups
from vibroimpact.analysis.orbits.classify import RunClass

Floats = NDArray[np.float64]
Labels = NDArray[np.int16]

UNDECIDED, BEYOND_A_STOP = -1, -2
"""Labels of starts that are near no attractor yet, and of starts that are impossible for a body."""
CONFIDENCE = 0.95
"""Confidence of the intervals of shares, and of the share that may have been missed."""
MIRRORED, MIRRORED_APERIODIC = 1e-6, 0.1
"""Difference of features, over their size, up to which an attractor is the mirror image of another."""
_MIRROR = np.array([1.0, 1.0, -1.0, -1.0, 1.0])
"""Factors of the features of a mirror image: its impacts come half a period later."""
MOST_PERIODS = 100_000
"""Default budget: most forcing periods for which one start is followed."""


class Ends(NamedTuple):
    """States at forcing phase 0 some periods later, shape (start, variable), and whether each run succeeded."""

    states: Floats
    well: NDArray[np.bool_]


class Section(NamedTuple):
    """Motions period by period: the observed displacement and velocity at forcing phase 0, and the extremes."""

    states: Floats
    """Shape (start, period, 2), m and m/s."""
    extremes: Floats
    """Smallest and largest displacement, shape (start, 2), m."""


class Flow(Protocol):
    """Interface to simulate many starts at once."""

    @property
    def decay(self) -> float:
        """Rate at which the slowest free motion decays, 1 / forcing period; infinite where none decays."""

    @property
    def turns(self) -> Floats | None:
        """Turns of further sines in a forcing period, shape (sine,), whose phases are the last variables.

        None where all forces repeat with the forcing period.
        """

    @property
    def free_state(self) -> Floats | None:
        """State at forcing phase 0 of the steady motion without impacts, shape (variable,); None where it hits."""

    def stays_free(self, states: Floats) -> NDArray[np.bool_]:
        """Return a mask of the states at forcing phase 0 from which no stop can be met any more."""

    def follow(self, states: Floats, periods: int, *, first: bool = False) -> Ends:
        """Return the states after some forcing periods, from states of shape (start, variable).

        With `first` they are at time 0, not at forcing phase 0; the periods then count from the next phase 0.
        """

    def classes(
        self, states: Floats, transient: int, *, first: bool = False
    ) -> tuple[list[RunClass], Floats]:
        """Return the class of a run from each state after a transient of forcing periods, and its last states."""

    def measure(self, states: Floats, periods: int, blocks: int) -> Blocks:
        """Return the features of the impacts in consecutive blocks of forcing periods, from forcing phase 0 on."""

    def section(self, states: Floats, periods: int) -> Section:
        """Return the motions at each forcing phase 0 of some periods, from states at forcing phase 0 on."""


@dataclass(frozen=True, eq=False)
class Features:
    """Features of the motion on an attractor.

    Attributes
    ----------
    at_stops : array, shape (stop, feature)
        Means in a forcing period, by `Feature`; NaN for a chatter, which has infinitely many impacts.
    extremes : array, shape (2,)
        Smallest and largest displacement, m.
    dimension : float
        Correlation dimension of its states at forcing phase 0; 0 for an orbit.
    """

    at_stops: Floats
    extremes: Floats
    dimension: float = 0.0

    @property
    def impacts(self) -> Floats:
        """Mean number of impacts in a forcing period, shape (stop,), without the slow impacts of a chatter."""
        return self.at_stops[:, Feature.impacts]

    @property
    def speed(self) -> Floats:
        """Mean impact velocity, shape (stop,), m/s; NaN without impacts."""
        return np.divide(
            self.at_stops[:, Feature.speed],
            self.impacts,
            np.full_like(self.impacts, np.nan),
            where=self.impacts > 0,
        )

    @property
    def phase_spread(self) -> Floats:
        """Circular standard deviation of the impact phases, weighted by velocity, shape (stop,), rad."""
        resultant = np.hypot(self.at_stops[:, Feature.cosine], self.at_stops[:, Feature.sine])
        total = self.at_stops[:, Feature.speed]
        length = np.divide(resultant, total, np.full_like(total, np.nan), where=total > 0)
        return np.asarray(np.sqrt(np.maximum(-2.0 * np.log(np.clip(length, 1e-300, None)), 0.0)))


@dataclass(frozen=True, eq=False)
class Attractor:
    """An attractor on which starts end."""

    kind: RunClass
    states: Floats
    """States at forcing phase 0, shape (period, variable); empty where no state repeats."""
    radius: float
    """Distance, over the size of the motion, from which probe starts came back; 0 where they did not from any."""
    features: Features
    decay: float = np.inf
    """Rate at which its slowest neighbours come back, 1 / forcing period."""
    section: Floats = field(default_factory=lambda: np.empty((0, 0)))
    """States at forcing phase 0 of a motion that does not repeat, shape (period, variable)."""
    exponent: float = np.nan
    """Largest Lyapunov exponent of a motion that does not repeat, 1 / forcing period."""
    exponent_error: float = np.nan
    """Standard error of the exponent."""
    is_one: bool = True
    """False for chaotic motion that may lie on several attractors, which could not be separated."""

    @property
    def has_period(self) -> bool:
        """Whether its motion repeats."""
        return len(self.states) > 0

    @property
    def is_chaotic(self) -> bool:
        """Whether its motion is chaotic."""
        return self.kind.kind is OrbitClass.chaos

    @property
    def impacts(self) -> Floats:
        """Mean number of impacts in a forcing period, shape (stop,)."""
        return self.features.impacts

    @property
    def multiplier(self) -> float:
        """Modulus of its slowest multiplier in a forcing period; NaN where no state repeats."""
        return float(np.exp(-self.decay)) if self.has_period else float("nan")

    @property
    def name(self) -> str:
        """`P(p,q)`, `no impacts`, `quasi-periodic`, `chaos`, `aperiodic`.

        `chaotic, not told apart` and `aperiodic, not told apart` mean that there may be several.
        """
        if not self.is_one:
            return f"{'chaotic' if self.is_chaotic else 'aperiodic'}, not told apart"
        return "aperiodic" if self.kind.kind is OrbitClass.unknown else self.kind.name


@dataclass(frozen=True, slots=True)
class Separation:
    """Numbers of attractors without a period, by the features of their impacts and by recurrence."""

    by_features: int
    by_recurrence: int
    agree: bool
    """Whether both separate the same runs."""


@dataclass(eq=False)
class Basins:
    """Starts and the attractors on which they end.

    Attributes
    ----------
    starts : array, shape (start, variable)
    labels : array of int, shape (start,)
        Numbers of attractors, or UNDECIDED, BEYOND_A_STOP.
    scale : array, shape (variable,)
        Size of the motion.
    attractors : list of Attractor
    most_periods : int
        Budget: most forcing periods for which one start is followed.
    followed_periods, needed_periods : int
        Forcing periods for which the starts that took longest were followed, and those that the slowest decay needs.
    told_by_sample : int
        Number of starts that count as chaotic because a sample of them was.
    undetected_share_below : float
        Share of the possible starts that may end elsewhere although none in that sample does. A larger share would have
        a start in the sample with a probability of 95 %.
    groups, numbers : Groups, array of int
        Chaotic groups, and the number of the attractor of each.
    separation : Separation or None
        None without attractors that have no period.
    """

    starts: Floats
    labels: Labels
    scale: Floats
    attractors: list[Attractor] = field(default_factory=list)
    most_periods: int = MOST_PERIODS
    followed_periods: int = 0
    needed_periods: int = 0
    told_by_sample: int = 0
    undetected_share_below: float = 0.0
    groups: Groups = NO_GROUPS
    numbers: NDArray[np.int16] = field(default_factory=lambda: np.empty(0, np.int16))
    separation: Separation | None = None

    @property
    def names(self) -> list[str]:
        """Names of the attractors; attractors of one kind have letters."""
        plain = [each.name for each in self.attractors]
        return [
            f"{name} {_letter(plain[:place].count(name))}" if plain.count(name) > 1 else name
            for place, name in enumerate(plain)
        ]

    @property
    def full_names(self) -> list[str]:
        """Names of the attractors, with the rotation numbers of quasi-periodic motions."""
        return [
            name if each.kind.rotation is None else f"{name}, {each.kind.rotation.text}"
            for name, each in zip(self.names, self.attractors, strict=True)
        ]

    @property
    def possible(self) -> int:
        """Number of starts that are possible for a body."""
        return int((self.labels != BEYOND_A_STOP).sum())

    @property
    def decided(self) -> float:
        """Share of the possible starts with a known end."""
        return float((self.labels >= 0).sum()) / max(self.possible, 1)

    @property
    def counts(self) -> NDArray[np.int64]:
        """Number of starts that end on each attractor."""
        return np.bincount(self.labels[self.labels >= 0], minlength=len(self.attractors))

    @property
    def fractions(self) -> Floats:
        """Share of the possible starts that end on each attractor."""
        found: Floats = self.counts / max(self.possible, 1)
        return found

    @property
    def intervals(self) -> Floats:
        """Confidence intervals of the shares, shape (attractor, 2): see `share_interval`."""
        found = [share_interval(int(count), self.possible) for count in self.counts]
        return np.array(found).reshape(-1, 2)

    @property
    def missed_share_below(self) -> float:
        """Largest share of the plane that an attractor without a start may have, at 95 % confidence.

        Undecided starts may belong to it; a share that a sample of chaotic starts missed adds to it.
        """
        decided = round(self.decided * self.possible)
        return min(1.0, missed_share(decided) + self.undetected_share_below + 1.0 - self.decided)


def partners(attractors: list[Attractor], images: NDArray[np.int32] | None) -> list[int]:
    """Return the number of each attractor's mirror image, half a period later: its own, or -1 without one.

    Parameters
    ----------
    attractors : list of Attractor
    images : array of int, shape (stop,), or None
        Stop that takes the place of each stop in the mirror image; None where the scene has no mirror symmetry.
    """
    if images is None:
        return [-1] * len(attractors)
    found = []
    for one in attractors:
        off = [_mirrored_off(one, other, images) for other in attractors]
        nearest = int(np.argmin(off))
        limit = MIRRORED if one.has_period else MIRRORED_APERIODIC
        found.append(nearest if off[nearest] <= limit else -1)
    return found


def _mirrored_off(one: Attractor, other: Attractor, images: NDArray[np.int32]) -> float:
    """Return the difference of an attractor from the mirror image of another, over the size of its features."""
    if one.name != other.name:
        return float("inf")
    mirrored = other.features.at_stops[images] * _MIRROR
    pairs = [(one.features.extremes, -other.features.extremes[::-1])]
    if np.isfinite(mirrored).all():
        pairs += list(zip(one.features.at_stops.T, mirrored.T, strict=True))
    size = float(np.abs(one.features.extremes).max())
    speed = max(float(np.nan_to_num(one.features.at_stops[:, Feature.largest]).max()), 1e-300)
    scales = [size, 1.0, speed, speed, speed, speed]
    return max(
        float(np.abs(a - b).max()) / scale for (a, b), scale in zip(pairs, scales[: len(pairs)], strict=True)
    )


def share_interval(count: int, starts: int) -> tuple[float, float]:
    """Return the interval of a share of which `count` of some random starts are members (Clopper and Pearson 1934).

    The interval holds the share with a probability of 95 % at least.

    >>> low, high = share_interval(0, 100)
    >>> low, round(high, 4)
    (0.0, 0.0362)
    """
    from scipy.special import betaincinv

    tail = 0.5 * (1.0 - CONFIDENCE)
    low = float(betaincinv(count, starts - count + 1, tail)) if count else 0.0
    high = float(betaincinv(count + 1, starts - count, 1.0 - tail)) if count < starts else 1.0
    return low, high


def missed_share(starts: int) -> float:
    """Return the largest share of which none of some random starts is a member, at 95 % confidence: about 3 / starts.

    >>> round(missed_share(300), 5)
    0.00994
    """
    return 1.0 - float((1.0 - CONFIDENCE) ** (1.0 / starts)) if starts else 1.0


def _letter(place: int) -> str:
    """Return a, b, ..., z, aa, ab, ...

    >>> _letter(0), _letter(25), _letter(26)
    ('a', 'z', 'aa')
    """
    letters = ""
    while place >= 0:
        letters = chr(ord("a") + place % 26) + letters
        place = place // 26 - 1
    return letters
