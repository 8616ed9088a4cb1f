"""The residual of a fit: a test whether it is noise, its verdict in words, and standard errors if it is not white."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.analysis.decay.samples import Floats

SIGNIFICANCE = 0.01
"""Probability of such a residual by noise alone, below which a law is inadequate."""

NUMERICAL_FLOOR = 1e-6
"""Structure, as a fraction of the largest excursion, below which rounding and interpolation may explain it."""

_FEWEST_LAGS, _MOST_LAGS = 10, 400


@dataclass(frozen=True, slots=True)
class ResidualTest:
    """Measures of the residual of a fit.

    Attributes
    ----------
    rms, noise_floor, structure : float
        Root mean square of the residual; rms of its white part, from second differences; rms of the rest.
    relative_structure : float
        The structure as a fraction of the largest excursion of the measured motion.
    lags : int
        Lags of the Ljung-Box test.
    portmanteau_probability : float
        Probability of such autocorrelations in white noise (Ljung-Box).
    runs_probability : float
        Probability of a number of sign changes as unusual as this in white noise (Wald-Wolfowitz, two-sided).
    effective_samples : float
        Number of independent samples that carry the same information about the oscillation.
    """

    rms: float
    noise_floor: float
    structure: float
    relative_structure: float
    lags: int
    portmanteau_probability: float
    runs_probability: float
    effective_samples: float

    @property
    def adequate(self) -> bool:
        """Whether the residual passes for white noise, or is below the accuracy of the model."""
        return self.portmanteau_probability >= SIGNIFICANCE or self.relative_structure < NUMERICAL_FLOOR

    def words(self) -> str:
        """Return the verdict as a sentence.

        >>> ResidualTest(0.5, 0.5, 0.0, 0.0, 10, 0.4, 0.6, 100.0).words()
        'adequate: the residual passes for white noise of .5 (Ljung-Box p = .40, runs p = .60)'
        """
        portmanteau = _probability(self.portmanteau_probability)
        if self.portmanteau_probability >= SIGNIFICANCE:
            runs = _probability(self.runs_probability)
            return (
                f"adequate: the residual passes for white noise of {_plain(self.rms)} "
                f"(Ljung-Box p {portmanteau}, runs p {runs})"
            )
        if self.adequate:
            return f"adequate: the residual is not noise, but {self.relative_structure:.1g} of the amplitude: rounding"
        return (
            f"inadequate: the residual is not noise (Ljung-Box p {portmanteau}); "
            f"{_plain(self.structure)} of its {_plain(self.rms)} rms is structure over a noise floor of "
            f"{_plain(self.noise_floor)}, {100 * self.relative_structure:.2g} % of the largest excursion"
        )


def _plain(number: float) -> str:
    text = f"{number:.3g}"
    return text[1:] if text.startswith("0.") else text


def _probability(number: float) -> str:
    return "< .0001" if number < 1e-4 else f"= {number:.2f}".replace("0.", ".", 1)


def residual_test(residual: Floats, excursion: float, turn: float) -> ResidualTest:
    """Test a residual, measured minus fitted in the order of time, against white noise.

    The excursion is the largest distance of the motion from its equilibrium, in the same unit. The test spans two
    periods of the oscillation; `turn` is the phase of the oscillation per sample, rad.
    """
    from scipy.stats import chi2

    count = len(residual)
    lags = int(np.clip(4.0 * np.pi / turn, _FEWEST_LAGS, min(_MOST_LAGS, count // 4)))
    correlation = autocorrelation(residual, lags)
    statistic = count * (count + 2.0) * float(np.sum(correlation**2 / (count - np.arange(1, lags + 1))))
    variance = float(np.mean(residual**2))
    probability = float(chi2.sf(statistic, lags))
    floor = float(np.mean(np.diff(residual, 2) ** 2)) / 6.0
    if floor >= variance:
        # changes faster than white noise, such as a hum: second differences cannot separate noise from it
        floor = variance if probability >= SIGNIFICANCE else 0.0
    structure = float(np.sqrt(variance - floor))
    return ResidualTest(
        rms=float(np.sqrt(variance)),
        noise_floor=float(np.sqrt(floor)),
        structure=structure,
        relative_structure=structure / excursion if excursion > 0.0 else 0.0,
        lags=lags,
        portmanteau_probability=probability,
        runs_probability=_runs_probability(residual),
        effective_samples=effective_samples(residual, turn),
    )


def autocorrelation(residual: Floats, lags: int) -> Floats:
    """Return the autocorrelation at lags 1 to `lags`; the mean is not removed (a fit's residual has none)."""
    power = float(residual @ residual)
    if power == 0.0:
        return np.zeros(lags)
    size = 1 << int(np.ceil(np.log2(len(residual) + lags)))
    spectrum = np.abs(np.fft.rfft(residual, size)) ** 2
    correlation: Floats = np.fft.irfft(spectrum, size)[1 : lags + 1] / power
    return correlation


def _runs_probability(residual: Floats) -> float:
    from scipy.stats import norm

    above = residual > np.median(residual)
    plus, minus = float(np.count_nonzero(above)), float(np.count_nonzero(~above))
    total = plus + minus
    runs = 1.0 + np.count_nonzero(np.diff(above))
    mean = 1.0 + 2.0 * plus * minus / total
    variance = (mean - 1.0) * (mean - 2.0) / (total - 1.0)
    return 1.0 if variance <= 0.0 else float(2.0 * norm.sf(abs(runs - mean) / np.sqrt(variance)))


def effective_samples(residual: Floats, turn: float) -> float:
    """Return the number of independent samples that carry the same information about the oscillation.

    `n / (1 + 2 sum_l rho_l cos(l turn))`: the density of the residual's spectrum at the oscillation's frequency,
    against its mean. The sum is taken period by period and ends at the first period that adds nothing. `turn` is the
    phase of the oscillation per sample, rad.
    """
    period = max(2, round(2.0 * np.pi / turn))
    blocks = min(len(residual) // 3, 4000) // period
    if blocks < 1:
        return float(len(residual))
    lags = np.arange(1, blocks * period + 1)
    demodulated = (autocorrelation(residual, len(lags)) * np.cos(turn * lags)).reshape(blocks, period).sum(1)
    ends = np.flatnonzero(demodulated <= 0.0)
    total = 1.0 + 2.0 * float(np.sum(demodulated[: ends[0] if len(ends) else blocks]))
    return len(residual) / max(total, 1.0)


def coloured_covariance(jacobian: Floats, residual: Floats, correlation: int) -> tuple[Floats, float]:
    """Return the covariance of the parameters of a fit with possibly correlated residuals, and its degrees of freedom.

    The covariance is the sandwich `(J'J)^-1 S (J'J)^-1` (Newey and West), with `s_i = J_i r_i` and
    `S = sum_l (1 - |l| / (L + 1)) sum_i s_i s_(i+l)'`. Correlation counts at the frequency at which the parameter acts.
    An amplitude is thus as uncertain as the residual is strong near the frequency of the oscillation. The formula for
    white residuals is the lower bound of each variance. A fit removes the parts of its residual that resemble its
    parameters, so the sandwich alone would be too small.

    The Jacobian has shape (sample, parameter). `correlation` counts samples, at least some periods of the oscillation;
    more lags are used where the scores are correlated over longer times. A variance summed over L lags has
    3 n / (2 (L + 1)) degrees of freedom, for Student's t.
    """
    samples, parameters = jacobian.shape
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    unit = jacobian / scale
    bread = np.linalg.pinv(unit.T @ unit)
    freedom = max(samples - parameters, 1)
    white = bread * float(residual @ residual) / freedom
    scores = unit * residual[:, None]
    lags = _lags(scores, correlation)
    # The weighted sum over lags equals the sum of products of sums over L + 1 neighbours, at every place.
    sums = np.cumsum(np.pad(scores, ((lags + 1, lags), (0, 0))), axis=0)
    moving = sums[lags + 1 :] - sums[: -lags - 1]
    meat = moving.T @ moving / (lags + 1.0)
    # Scores add up to zero after a fit, which removes the share (L + 1) / n from a sum over L lags.
    spared = 1.0 - (lags + 1.0) / samples
    coloured = bread @ meat @ bread * samples / freedom / spared
    inflation = np.sqrt(np.maximum(1.0, np.diag(white) / np.maximum(np.diag(coloured), 1e-300)))
    covariance: Floats = coloured * np.outer(inflation, inflation) / np.outer(scale, scale)
    return covariance, max(1.5 * samples / (lags + 1.0), 1.0)


def _lags(scores: Floats, correlation: int) -> int:
    """Return the number of lags: Andrews' rule for the most correlated score, or the caller's, if larger."""
    before, after = scores[:-1], scores[1:]
    power = np.maximum(np.einsum("ij,ij->j", scores, scores), 1e-300)
    rho = np.clip(np.einsum("ij,ij->j", before, after) / power, -0.97, 0.97)
    rate = float(np.max(4.0 * rho**2 / (1.0 - rho**2) ** 2))
    lags = max(correlation, int(1.1447 * (rate * len(scores)) ** (1.0 / 3.0)))
    return max(1, min(lags, len(scores) // 5))
