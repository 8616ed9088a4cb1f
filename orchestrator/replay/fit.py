"""Fits of a replay: the numbers of a scene that bring the simulated motion nearest to the measured one.

Least squares over all compared channels of all recordings. Lag and polarity are found from the start of the event
alone. They are held while the numbers are fitted, so that an error of the model cannot hide in them. With better
numbers they are found again, until they stay.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.replay.alignment import Interpolated
from vibroimpact.analysis.replay.comparison import Comparison
from vibroimpact.fmus.errors import ComponentError, EstimationError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.orchestrator.replay.covariance import LagSlopes, covariance_of, lag_slopes
from vibroimpact.orchestrator.replay.replayer import Replayer
from vibroimpact.orchestrator.replay.scoring import compare_motion
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.fields import bounds_of
from vibroimpact.orchestrator.scene.keys import MODES, numeric_key

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

#: Power of the natural frequency in each kind of number: 1 in frequencies, 2 in stiffnesses.
_FREQUENCY_POWER = {
    **dict.fromkeys(("frequency", "frequencies", "angular_frequencies"), 1.0),
    **dict.fromkeys(("stiffness", "flexural_rigidity", "youngs_modulus"), 2.0),
}
MOST_ALIGNMENTS = 6
#: Condition of the scaled normal matrix above which two numbers are inseparable: their difference is derivative noise.
MOST_CONDITION = 1e8
#: Relative effect of doubling a number below which it is treated as having none.
LEAST_CHANGE = 1e-9
#: Offset of a second start from a start without effect, relative to the larger of a number and its scale.
NEIGHBOUR_DISTANCE = 0.1
#: Squared distance of a number from its flat value, in standard errors of the square; below it the two are not
#: distinct.
FLAT_ERRORS = 3.0
#: Change of a lag, as a share of its standard error, below which the lag has settled.
LAG_STAYS = 0.1
#: Draws of the drive noise; standard errors from them are good to about 1/sqrt(2 draws), a sixth.
NOISE_DRAWS, NOISE_SEED = 20, 5
#: Step of the numeric derivatives, relative to the larger of a number and its scale.
DERIVATIVE_STEP = 1e-5


@dataclass(frozen=True, slots=True)
class ReplayFit:
    """Result of a fit.

    Attributes
    ----------
    keys : tuple of str
    start, values, standard_error : ndarray, shape (key,)
        Each in the unit of its key. The errors are for least squares with residuals correlated in time. They include
        the errors of the fitted lags, and the noise of the drive as measured before the event. They hold if the model
        is right, and do not cover the error of a wrong model.
    correlation : ndarray, shape (key, key)
        Correlation of the errors.
    comparisons : tuple of list of Comparison
        Comparisons of each fitted recording, with the fitted numbers.
    alignments : int
        Number of searches for lag and polarity.
    simulations : int
        Number of simulations of all recordings.
    remarks : tuple of str
        Numbers at a bound, inseparable pairs of numbers, a lag that did not settle.
    """

    keys: tuple[str, ...]
    start: Floats
    values: Floats
    standard_error: Floats
    correlation: Floats
    comparisons: tuple[list[Comparison], ...]
    alignments: int
    simulations: int
    remarks: tuple[str, ...]

    @property
    def numbers(self) -> dict[str, float]:
        """The values found, by key."""
        return dict(zip(self.keys, self.values.tolist(), strict=True))


def fit_keys(scene: Scene, text: str) -> tuple[str, ...]:
    """Return the keys of `--fit body.damping_ratio,sensor.gain`.

    UsageError: a key is no number of the scene, or occurs twice.
    """
    keys = tuple(key.strip() for key in text.split(",") if key.strip())
    if not keys or len(set(keys)) < len(keys):
        raise UsageError(
            message(
                Argument("fit"),
                f": expected keys such as body.damping_ratio,sensor.gain, each once, got {text!r}.",
            )
        )
    for key in keys:
        scene.value(key)
        if key == MODES or numeric_key(key).table == "execution":
            raise UsageError(
                message(
                    Argument("fit"),
                    f": expected numbers of what moves that change without steps, got {key}. "
                    "A sweep of it is scored at each value: `vibroimpact campaign`.",
                )
            )
    return keys


def fit_replay(
    replayers: Sequence[Replayer],
    keys: Sequence[str],
    *,
    progress: Callable[[int, float], None] = lambda simulations, error: None,
) -> ReplayFit:
    """Fit numbers of a scene to recordings.

    Parameters
    ----------
    replayers : sequence of Replayer
        Replayers of one scene, one for each recording; the scene compares something.
    keys : sequence of str
        Numbers of the scene to fit; the scene has their start values.
    progress : callable
        Called after each simulation with the number of simulations and the root-mean-square error (1: the mean's).

    Raises
    ------
    UsageError
        Nothing is compared.
    EstimationError
        A number has no effect on the data, or the search does not end.
    """
    return _Fit(replayers, tuple(keys), progress).run()


class _Fit:
    def __init__(
        self, replayers: Sequence[Replayer], keys: tuple[str, ...], progress: Callable[[int, float], None]
    ) -> None:
        self.replayers, self.keys, self.progress = replayers, keys, progress
        scene = replayers[0].scene
        if not replayers[0].readings:
            raise UsageError(
                f"{scene.source}: replay.compare: expected something to fit to, got nothing. Add compare = [...]."
            )
        self.start = np.array([scene.value(key) for key in keys])
        bounds = [bounds_of(scene.field(key)) for key in keys]
        self.lower = np.array([bound.low for bound in bounds], dtype=np.float64)
        self.upper = np.array([bound.high for bound in bounds], dtype=np.float64)
        self.scale = np.where(self.start != 0.0, np.abs(self.start), 1.0)
        self.simulations = 0
        self.flat: dict[int, float] = {}
        self._at: tuple[Sequence[Sequence[Comparison]], Floats, list[Floats]] | None = None

    def run(self) -> ReplayFit:
        values, remarks = self.start.copy(), []
        comparisons = self.compared(values)
        values, comparisons = self.better_start(values, comparisons)
        values, comparisons, new_remarks = self.start_with_effect(values, comparisons)
        remarks += new_remarks
        self.refuse_alike(self._slopes(values, comparisons))  # before a search that would fail
        alignments = 0
        while alignments < MOST_ALIGNMENTS:
            alignments += 1
            values = self.solve(values, comparisons)
            renewed = self.compared(values)
            settled = _have_settled(comparisons, renewed)
            comparisons = renewed
            if settled:
                break
        else:
            remarks.append("lag and polarity did not settle: do not rely on the numbers")
        covariance = self.covariance(values, comparisons)
        errors = np.sqrt(np.diag(covariance))
        correlation = covariance / np.outer(errors, errors)
        remarks += self._remarks(values, correlation) + self._at_flat(values, errors)
        return ReplayFit(
            self.keys, self.start, values, errors, correlation, comparisons, alignments, self.simulations,
            tuple(remarks),
        )  # fmt: skip

    def better_start(
        self, values: Floats, comparisons: tuple[list[Comparison], ...]
    ) -> tuple[Floats, tuple[list[Comparison], ...]]:
        """Scale the start by the measured dominant frequency if that explains more: a distant start gets lost.

        Numbers of the frequency are scaled by the ratio of measured to simulated frequency, stiffnesses by its square.
        """
        first = comparisons[0][0]
        ratio = first.measured_frequency.frequency / first.simulated_frequency.frequency
        powers = np.array([_FREQUENCY_POWER.get(_name(key), 0.0) for key in self.keys])
        if not np.any(powers) or not np.isfinite(ratio) or ratio <= 0.0:
            return values, comparisons
        other = np.clip(values * ratio**powers, self.lower, self.upper)
        others = self.compared(other)
        return (other, others) if _explained(others) > _explained(comparisons) else (values, comparisons)

    def start_with_effect(
        self, values: Floats, comparisons: tuple[list[Comparison], ...]
    ) -> tuple[Floats, tuple[list[Comparison], ...], list[str]]:
        """Move the start to values at which each number has an effect, if there are such values near the given start.

        The first case is a single number without effect, such as the place of a sensor where the shape is flat. If
        nothing moves or is read (a gain of 0), no other number has an effect: the numbers with an effect are fitted
        first.
        """
        values, new_remarks = self._away_from_idle(values, comparisons)
        idle = self._idle(self._slopes(values, comparisons))
        if idle.any() and not idle.all():
            values = self.solve(values, comparisons, ~idle)
            comparisons = self.compared(values)
            late = ", ".join(self.keys[place] for place in np.flatnonzero(idle))
            new_remarks.append(
                f"{late}: without effect where the search began; the other numbers were found first"
            )
            values, more = self._away_from_idle(values, comparisons)
            new_remarks += more
        return values, comparisons, new_remarks

    def _away_from_idle(
        self, values: Floats, comparisons: Sequence[Sequence[Comparison]]
    ) -> tuple[Floats, list[str]]:
        new_remarks = []
        for place in np.flatnonzero(self._idle(self._slopes(values, comparisons))).tolist():
            tried = [
                (sum(float(one @ one) for one in self.residuals(other, comparisons)), float(other[place]))
                for other in self._neighbours(values, place)
                if not self._idle(self._slopes(other, comparisons))[place]
            ]
            if tried:
                new_remarks.append(
                    f"{self.keys[place]} has no effect at {values[place]:.6g}: the search began beside it, at "
                    f"{min(tried)[1]:.6g}"
                )
                self.flat[place] = float(values[place])
                values = np.where(np.arange(len(values)) == place, min(tried)[1], values)
        return values, new_remarks

    def _idle(self, slopes: Sequence[Floats]) -> Flags:
        """Return a mask of numbers that do not change the compared signals beyond rounding, shape (key,)."""
        energy = sum((np.sum(slope**2, axis=0) for slope in slopes), np.zeros(len(self.keys)))
        moved = np.sqrt(energy / sum(len(slope) for slope in slopes)) * self.scale
        idle: Flags = ~(moved > LEAST_CHANGE)
        return idle

    def _neighbours(self, values: Floats, place: int) -> list[Floats]:
        """Return the values with one number a little larger, and a little smaller, within its bounds."""
        step = NEIGHBOUR_DISTANCE * self.scale[place] * np.eye(len(values))[place]
        both = (values + step, values - step)
        return [other for other in both if self.lower[place] < other[place] < self.upper[place]]

    def compared(self, values: Floats) -> tuple[list[Comparison], ...]:
        """Simulate every recording and find lag and polarity anew."""
        numbers = self._numbers(values)
        return tuple(compare_motion(replayer, replayer.simulate(numbers)) for replayer in self.replayers)

    def _numbers(self, values: Floats) -> dict[str, float]:
        self.simulations += 1
        return dict(zip(self.keys, values.tolist(), strict=True))

    def residuals(
        self,
        values: Floats,
        comparisons: Sequence[Sequence[Comparison]],
        random: np.random.Generator | None = None,
    ) -> list[Floats]:
        """Return the residual of each channel over its own standard deviation, with lag and polarity held.

        With `random`, new noise as before the event is added to the drive.
        """
        numbers = self._numbers(values)
        found = []
        for replayer, compared in zip(self.replayers, comparisons, strict=True):
            motion = replayer.simulate(numbers, random)
            for reading, comparison in zip(motion.readings, compared, strict=True):
                at = comparison.measured.time[comparison.scored] - comparison.alignment.lag
                simulated = comparison.alignment.polarity * Interpolated(motion.time, reading)(at)
                measured = comparison.values[comparison.scored]
                found.append((measured - simulated) / np.std(measured))
        self.progress(self.simulations, float(np.sqrt(np.mean(np.concatenate(found) ** 2))))
        return found

    def solve(
        self, values: Floats, comparisons: Sequence[Sequence[Comparison]], chosen: Flags | None = None
    ) -> Floats:
        """Return the least-squares values from a start, with lag and polarity held; only chosen numbers change."""
        from scipy.optimize import least_squares

        rows = np.flatnonzero(np.ones(len(values)) if chosen is None else chosen)
        lower, upper, scale = (ends[rows] for ends in (self.lower, self.upper, self.scale))

        def with_chosen(scaled: Floats) -> Floats:
            found: Floats = values.copy()
            found[rows] = scaled * scale
            return found

        inside = np.clip(values[rows], lower + 1e-12 * scale, upper - 1e-12 * scale)
        try:
            solution = least_squares(
                lambda scaled: np.concatenate(self.residuals(with_chosen(scaled), comparisons)),
                inside / scale,
                bounds=(lower / scale, upper / scale),
                x_scale="jac",
                diff_step=DERIVATIVE_STEP,
                xtol=1e-9,
                ftol=1e-10,
                gtol=1e-10,
                max_nfev=100,
            )
        except ComponentError as error:
            raise EstimationError(
                f"fit: the search reached numbers that the body refuses: {error} Start nearer, or fit fewer numbers."
            ) from error
        return with_chosen(solution.x)

    def covariance(self, values: Floats, comparisons: Sequence[Sequence[Comparison]]) -> Floats:
        """Return the covariance of the numbers: see `covariance_of`."""
        residuals = self.residuals(values, comparisons)
        slopes = self._slopes(values, comparisons)
        self.refuse_alike(slopes)
        disturbances: list[list[Floats]] = []
        if any(replayer.drive_noise is not None for replayer in self.replayers):
            random = np.random.default_rng(NOISE_SEED)
            for _ in range(NOISE_DRAWS):
                disturbed = self.residuals(values, comparisons, random)
                disturbances.append([a - b for a, b in zip(disturbed, residuals, strict=True)])
        return covariance_of(slopes, self._lag_slopes(values, comparisons), residuals, disturbances)

    def _lag_slopes(
        self, values: Floats, comparisons: Sequence[Sequence[Comparison]]
    ) -> list[LagSlopes | None]:
        found: list[LagSlopes | None] = []
        for replayer, compared in zip(self.replayers, comparisons, strict=True):
            motion = replayer.simulate(self._numbers(values))
            for reading, comparison in zip(motion.readings, compared, strict=True):
                size = float(np.std(comparison.values[comparison.scored]))
                found.append(lag_slopes(comparison, Interpolated(motion.time, reading), size))
        return found

    def refuse_alike(self, slopes: Sequence[Floats]) -> None:
        """Raise EstimationError for numbers that the recordings do not separate, by the normal matrix of slopes."""
        idle = self._idle(slopes)
        if idle.any():
            raise EstimationError(
                f"fit: {self.keys[int(np.argmax(idle))]}: expected a number that changes what is compared, got one "
                "that does not, beside its start either. Leave it out."
            )
        bread: Floats = sum((slope.T @ slope for slope in slopes), np.zeros((len(self.keys), len(self.keys))))
        size = np.sqrt(np.diag(bread))
        scaled = bread / np.outer(size, size)
        if np.linalg.cond(scaled) > MOST_CONDITION:
            weakest = np.abs(np.linalg.eigh(scaled)[1][:, 0])
            alike = " and ".join(self.keys[place] for place in np.flatnonzero(weakest > 0.1))
            raise EstimationError(
                f"fit: expected numbers that the recordings tell apart, got {alike}, which change the motion alike. "
                "Fit fewer of them."
            )

    def _slopes(self, values: Floats, comparisons: Sequence[Sequence[Comparison]]) -> list[Floats]:
        """Return the derivative of each residual by each number, shape (sample, key) for each channel.

        The last result is kept: the start is evaluated three times.
        """
        if not (self._at and self._at[0] is comparisons and np.array_equal(self._at[1], values)):
            self._at = comparisons, values.copy(), self._slopes_at(values, comparisons)
        return self._at[2]

    def _slopes_at(self, values: Floats, comparisons: Sequence[Sequence[Comparison]]) -> list[Floats]:
        columns = []
        for place in range(len(values)):
            step = 10.0 * DERIVATIVE_STEP * self.scale[place]
            # at a bound the difference is one-sided, as the body refuses parameters beyond it
            below, above = (min(step, room) for room in self._room(values, place))
            along = np.eye(len(values))[place]
            ahead = self.residuals(values + above * along, comparisons)
            behind = self.residuals(values - below * along, comparisons)
            columns.append([(a - b) / (above + below) for a, b in zip(ahead, behind, strict=True)])
        return [np.column_stack(channel) for channel in zip(*columns, strict=True)]

    def _room(self, values: Floats, place: int) -> tuple[float, float]:
        return float(values[place] - self.lower[place]), float(self.upper[place] - values[place])

    def _remarks(self, values: Floats, correlation: Floats) -> list[str]:
        remarks = []
        for place, key in enumerate(self.keys):
            if min(self._room(values, place)) <= 1e-6 * self.scale[place]:
                remarks.append(
                    f"{key} ended at its bound, {values[place]:.6g}: its error is not to be relied on"
                )
            for other in range(place):
                if abs(correlation[place, other]) > 0.99:
                    remarks.append(
                        f"{self.keys[other]} and {key} change the motion nearly alike "
                        f"(correlation {correlation[place, other]:.4f}): one hides in the other"
                    )
        return remarks

    def _at_flat(self, values: Floats, errors: Floats) -> list[str]:
        """Return remarks on numbers that ended where they have no effect: the data give only (value - flat)^2."""
        return [
            f"{self.keys[place]} is not told from {flat:.6g}, where it has no effect: its error is not to be relied on"
            for place, flat in self.flat.items()
            if abs(values[place] - flat) < 2.0 * FLAT_ERRORS * errors[place]
        ]


def _name(key: str) -> str:
    return key.rpartition(".")[2].partition("[")[0]


def _explained(comparisons: Sequence[Sequence[Comparison]]) -> float:
    """Return the mean squared correlation of simulated and measured signals, independent of their gains."""
    found = []
    for comparison in (one for compared in comparisons for one in compared):
        pair = comparison.values[comparison.scored], comparison.simulated[comparison.scored]
        found.append(float(np.corrcoef(*pair)[0, 1]) ** 2 if np.ptp(pair[1]) > 0.0 else 0.0)
    return float(np.mean(found))


def _have_settled(before: Sequence[Sequence[Comparison]], after: Sequence[Sequence[Comparison]]) -> bool:
    pairs = [
        (old.alignment, new.alignment)
        for earlier, later in zip(before, after, strict=True)
        for old, new in zip(earlier, later, strict=True)
    ]
    return all(
        old.polarity == new.polarity and abs(new.lag - old.lag) <= LAG_STAYS * new.lag_error + 1e-12
        for old, new in pairs
    )
