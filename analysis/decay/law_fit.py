"""Damping laws fitted to the whole motion of a free decay, and the choice of the best law, if any."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.exponential import Envelope, ExponentialDecay, first_guess, fit_exponential
from vibroimpact.analysis.decay.laws import ALL_LAWS, COULOMB, QUADRATIC, VISCOUS, DampingLaw, spoken
from vibroimpact.analysis.decay.motion import Coefficients, decaying_motion
from vibroimpact.analysis.decay.residuals import ResidualTest, coloured_covariance, residual_test
from vibroimpact.analysis.decay.samples import DecaySamples, Floats, unit_power
from vibroimpact.fmus.errors import EstimationError

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

CUBIC = "cubic"
_STEP = 1e-6
_MOST_EVALUATIONS = 60


@dataclass(frozen=True, slots=True)
class LawFit:
    """A damping law with its fitted coefficients.

    Attributes
    ----------
    law : DampingLaw
    coefficients : mapping of str to Estimate
        By name: `natural_angular_frequency`, `offset`, `amplitude` (at the turning point before the window),
        `turning_time`, the terms of the law, and `cubic` if it was fitted.
    residual_sum : float
        Sum of squares, (unit of the samples)^2.
    fitted : ndarray of float, shape (sample,)
    settled : bool
        Whether the fit ended before its limit of evaluations.
    """

    law: DampingLaw
    coefficients: Mapping[str, Estimate]
    residual_sum: float
    fitted: Floats
    test: ResidualTest
    settled: bool

    @property
    def physical(self) -> bool:
        """Whether every damping coefficient removes energy: none is negative."""
        return all(self.coefficients[term].value >= 0.0 for term in self.law.terms)

    @property
    def parameters(self) -> int:
        """Number of fitted numbers, the variance of the residual included."""
        return len(self.coefficients) + 1

    @property
    def aic(self) -> float:
        """Akaike's criterion for white residuals."""
        return self.effective_aic(len(self.fitted))

    @property
    def aicc(self) -> float:
        """Akaike's criterion with its correction for few samples."""
        count, numbers = len(self.fitted), self.parameters
        return self.aic + 2.0 * numbers * (numbers + 1.0) / max(count - numbers - 1.0, 1.0)

    def effective_aic(self, samples: float) -> float:
        """Return the criterion with the number of independent samples in place of all samples."""
        mean = self.residual_sum / len(self.fitted)
        return samples * float(np.log(max(mean, 1e-300))) + 2.0 * self.parameters


class _Problem:
    """The motion and its derivatives as functions of scaled parameters, in one pass for both.

    All parameters are of order 1 or smaller. They are the shift of the turning point (periods / 2 pi), amplitude and
    offset (in first amplitudes A) and the relative change of omega0. The chosen terms of lambda / omega,
    c / (omega^2 A), q A and mu A^2 follow.
    """

    def __init__(self, samples: DecaySamples, start: ExponentialDecay, names: tuple[str, ...]) -> None:
        self.samples, self.names = samples, names
        self.omega = start.natural_angular_frequency.value
        self.turning, self.size, self.side = _turning_point(samples, start)
        self.offset = start.offset.value
        self._known: tuple[bytes, Floats, Floats] | None = None

    @cached_property
    def scales(self) -> dict[str, tuple[float, float, str]]:
        """The physical value of a scaled 0, the size of one scaled unit, and the CF unit, by parameter."""
        unit = self.samples.unit
        return {
            "turning_time": (self.turning, 1.0 / self.omega, "s"),
            "amplitude": (0.0, self.size, unit),
            "offset": (self.offset, self.size, unit),
            "natural_angular_frequency": (self.omega, self.omega, "rad s-1"),
            VISCOUS: (0.0, self.omega, "s-1"),
            COULOMB: (0.0, self.omega**2 * self.size, "s-2" if unit == "1" else f"{unit} s-2"),
            QUADRATIC: (0.0, 1.0 / self.size, unit_power(unit, -1)),
            CUBIC: (0.0, self.size**-2, unit_power(unit, -2)),
        }

    def physical(self, parameters: Floats) -> dict[str, Floats]:
        """Return the physical values of scaled parameters, shape (parameter, column)."""
        rows = zip(self.names, parameters, strict=True)
        return {name: self.scales[name][0] + self.scales[name][1] * row for name, row in rows}

    def motion(self, parameters: Floats) -> Floats:
        """Return the displacement at the samples, shape (sample, column)."""
        values = self.physical(parameters)
        nothing = np.zeros(parameters.shape[1])
        coefficients = Coefficients(
            values["natural_angular_frequency"],
            *(values.get(name, nothing) for name in (VISCOUS, COULOMB, QUADRATIC, CUBIC)),
        )
        moved = decaying_motion(values["turning_time"], values["amplitude"], coefficients, self.samples.time)
        return values["offset"] + self.side * moved

    def evaluated(self, parameters: Floats) -> tuple[Floats, Floats]:
        """Return fitted minus measured values, and their derivatives by the scaled parameters."""
        key = parameters.tobytes()
        if self._known is None or self._known[0] != key:
            columns = np.hstack([parameters[:, None], parameters[:, None] + _STEP * np.eye(len(parameters))])
            motion = self.motion(columns)
            self._known = key, motion[:, 0] - self.samples.value, (motion[:, 1:] - motion[:, :1]) / _STEP
        return self._known[1:]


def _turning_point(samples: DecaySamples, start: ExponentialDecay) -> tuple[float, float, float]:
    """Return instant, height and side of the last turning point before the first sample."""
    omega, rate = start.angular_frequency.value, start.decay_rate.value
    phase = start.phase.value + omega * (samples.time[0] - start.reference_time)
    turns = np.floor(phase / np.pi)
    time = samples.time[0] - (phase - turns * np.pi) / omega
    with np.errstate(over="ignore"):
        height = start.amplitude.value * np.exp(-rate * (time - start.reference_time))
    if not np.isfinite(height):
        raise EstimationError(
            f"{samples.name}: expected a free decay, got motion that no decaying cosine is near to (decay rate "
            f"{rate:.3g} 1/s). Narrow the window, or write `estimate impacts` for motion against a stop."
        )
    return float(time), float(height), -1.0 if turns % 2 else 1.0


def fit_law(
    samples: DecaySamples,
    law: DampingLaw,
    start: ExponentialDecay,
    envelope: Envelope,
    *,
    cubic: bool = False,
) -> LawFit:
    """Fit a damping law by its trajectory.

    The equation of motion (`DampingLaw`) is integrated from turning point to turning point. Nothing is averaged, so
    amplitude, waveform and phase all count. Coefficients may become negative: the data then speak against this term,
    and the interval shows the uncertainty.

    `start` gives the first frequency, phase and equilibrium; `envelope` gives the amplitudes for the first guess of the
    coefficients. With `cubic` a cubic stiffness (`omega0^2 mu x^3`) is fitted too: the frequency then depends on the
    amplitude. EstimationError: the damping ends the motion before the data end.
    """
    from scipy.optimize import least_squares

    names = ("turning_time", "amplitude", "offset", "natural_angular_frequency", *law.terms)
    problem = _Problem(samples, start, names + (CUBIC,) * cubic)
    try:
        with np.errstate(all="ignore"):  # a trial step may damp beyond any swing; it is then shortened
            found = least_squares(
                lambda parameters: problem.evaluated(parameters)[0],
                _first_values(problem, law, envelope),
                jac=lambda parameters: problem.evaluated(parameters)[1],
                x_scale="jac",
                ftol=1e-9,
                xtol=1e-9,
                gtol=1e-12,
                max_nfev=_MOST_EVALUATIONS,
            )
    except ValueError as problem_of_scipy:  # raised for values that are not finite
        raise EstimationError(
            f"{samples.name}: {law.name}: expected an oscillation, got damping beyond any swing. Narrow the window."
        ) from problem_of_scipy
    return _described(problem, law, found)


def _first_values(problem: _Problem, law: DampingLaw, envelope: Envelope) -> Floats:
    """Return scaled start values; the coefficients come from the slow equation of the amplitude.

    `dA/dt = -lambda A - 2 c / (pi omega) - 4 q omega A^2 / (3 pi)`, integrated once, is linear in all coefficients.
    """
    from scipy.optimize import nnls

    time, size = envelope.time - problem.turning, envelope.amplitude / problem.size
    omega = problem.omega
    losses = {
        VISCOUS: (1.0, size),
        COULOMB: (2.0 / np.pi, np.ones_like(size)),
        QUADRATIC: (4.0 / (3.0 * np.pi), size**2),
    }
    columns = [np.ones_like(size)]
    for term in law.terms:
        share, power = losses[term]
        areas = np.concatenate([[power[0] * time[0]], 0.5 * (power[1:] + power[:-1]) * np.diff(time)])
        columns.append(-omega * share * np.cumsum(areas))
    # The slow equation ends where friction holds the body: after that the envelope is noise.
    moving = slice(0, max(3, int(np.argmax(np.append(size < 0.02 * size[0], True)))))
    solved, _ = nnls(np.column_stack(columns)[moving], size[moving])
    values = [0.0, float(solved[0]) or 1.0, 0.0, 0.0, *solved[1:]]
    return np.array(values + [0.0] * (len(problem.names) - len(values)))


def _described(problem: _Problem, law: DampingLaw, found: OptimizeResult) -> LawFit:
    turn = problem.omega * problem.samples.mean_interval
    fitted = problem.samples.value + found.fun
    values = {name: float(row[0]) for name, row in problem.physical(found.x[:, None]).items()}
    test = residual_test(-found.fun, float(np.max(np.abs(fitted - values["offset"]))), turn)
    covariance, freedom = coloured_covariance(found.jac, found.fun, round(4.0 * np.pi / turn))
    freedom = max(min(freedom, test.effective_samples - len(found.x)), 1.0)
    coefficients = {}
    for name, error in zip(problem.names, np.sqrt(np.diag(covariance)), strict=True):
        _, scale, unit = problem.scales[name]
        coefficients[name] = Estimate(values[name], float(error) * scale, unit, freedom)
    return LawFit(law, coefficients, float(found.fun @ found.fun), fitted, test, bool(found.status > 0))


@dataclass(frozen=True, slots=True)
class LawChoice:
    """Damping laws fitted to one decay, ranked.

    Attributes
    ----------
    fits : tuple of LawFit
        Best first, by AIC; laws with a negative coefficient come last.
    effective_samples : float
        Number of independent samples, from the residual of the best law; the same number for all laws.
    failed : tuple of DampingLaw
        Laws whose fit ended in damping beyond any swing.
    """

    fits: tuple[LawFit, ...]
    effective_samples: float
    failed: tuple[DampingLaw, ...] = ()

    @property
    def best(self) -> LawFit:
        """The law of the lowest AIC among the laws that only remove energy."""
        return self.fits[0]

    @property
    def best_by_effective_samples(self) -> LawFit:
        """The law of the lowest AIC when correlated samples count only as the equivalent independent samples."""
        eligible = [fit for fit in self.fits if fit.physical] or list(self.fits)
        return min(eligible, key=lambda fit: fit.effective_aic(self.effective_samples))

    def weights(self) -> tuple[float, ...]:
        """Return Akaike weights of the fits, by the effective number of samples; 0 for a law that feeds energy in."""
        scores = np.array(
            [fit.effective_aic(self.effective_samples) if fit.physical else np.inf for fit in self.fits]
        )
        if not np.any(np.isfinite(scores)):
            return (0.0,) * len(self.fits)
        share = np.exp(-0.5 * (scores - np.min(scores)))
        return tuple((share / np.sum(share)).tolist())

    def words(self) -> tuple[str, ...]:
        """Return the choice of the law and its quality, in sentences."""
        best, other = self.best, self.best_by_effective_samples
        sentences = [f"{spoken(best.law)} {'has the lowest AIC' if len(self.fits) > 1 else 'was asked for'}."]
        if not best.physical:
            sentences.append(
                "a coefficient of it is negative: it feeds energy in; no law here is a damping of this motion."
            )
        sentences.append(f"{spoken(best.law)} is {best.test.words()}.")
        if len(self.fits) > 1 and not best.test.adequate:
            good = [fit for fit in self.fits if fit.test.adequate and fit.physical]
            sentences.append(
                "none of the laws is adequate: coefficients and errors describe the best of the wrong models."
                if not good
                else f"adequate by its residual: {_named(good)}."
            )
        count = len(best.fitted)
        if len(self.fits) > 1 and self.effective_samples < 0.8 * count:
            sentences.append(
                f"AIC assumes white residuals; these are correlated, and {count} samples are worth "
                f"{self.effective_samples:.0f}: with that number {spoken(other.law)} "
                f"{'stays the first' if other is best else 'wins'}."
            )
        unphysical = [fit for fit in self.fits if not fit.physical]
        if unphysical and best.physical:
            sentences.append(f"left out for a negative coefficient: {_named(unphysical)}.")
        if self.failed:
            sentences.append(f"could not be fitted: {', '.join(map(spoken, self.failed))}.")
        unsettled = [fit for fit in self.fits if not fit.settled]
        if unsettled:
            sentences.append(f"not settled within the limit of steps: {_named(unsettled)}.")
        return tuple(sentences)


def _named(fits: Sequence[LawFit]) -> str:
    return ", ".join(spoken(fit.law) for fit in fits)


def choose_law(
    samples: DecaySamples,
    laws: Sequence[DampingLaw] = ALL_LAWS,
    *,
    cubic: bool = False,
    start: ExponentialDecay | None = None,
) -> LawChoice:
    """Fit damping laws to a free decay and rank them by Akaike's criterion; `cubic` adds a cubic stiffness.

    `start` is the decaying cosine of the same samples, if it was fitted before.

    Raises
    ------
    EstimationError
        Nothing oscillates, or no law can be fitted.

    Examples
    --------
    >>> time = np.arange(0.0, 40.0, 0.05)
    >>> noise = 0.02 * np.random.default_rng(2).normal(size=time.size)
    >>> choice = choose_law(DecaySamples(time, 3.0 * np.exp(-0.05 * time) * np.cos(4.0 * time) + noise))
    >>> choice.best.law.name, choice.best.test.adequate
    ('viscous', True)
    """
    envelope = first_guess(samples).envelope
    start = fit_exponential(samples) if start is None else start
    found, failed = [], []
    for law in laws:
        try:
            found.append(fit_law(samples, law, start, envelope, cubic=cubic))
        except EstimationError:
            failed.append(law)
    if not found:
        raise EstimationError(
            f"{samples.name}: expected a decay that some law fits, got none. Narrow the window."
        )
    ranked = sorted(found, key=lambda fit: (not fit.physical, fit.aic))
    return LawChoice(tuple(ranked), ranked[0].test.effective_samples, tuple(failed))
