"""A second oscillation in a free decay: another mode that beats with the first, or a hum.

No damping law explains either. Two decaying cosines do; the same criterion compares them with the laws.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.analysis.decay.exponential import ExponentialDecay, decaying_cosine, spectral_peak
from vibroimpact.analysis.decay.residuals import residual_test
from vibroimpact.analysis.decay.samples import DecaySamples, Floats
from vibroimpact.fmus.errors import EstimationError

_LINE_DISTANCE = 1.5
"""Distance from the first frequency, in 1 / (length of the record), below which the first may just change slowly."""
_EXPLAINED = 0.9
"""Share of the residual's variance that a second oscillation must explain if the rest is no noise."""
_AIC_DIFFERENCE = 30.0
"""Difference of Akaike's criterion above which two cosines are better than a damping law.

The highest of thousands of lines of noise takes about 15 off the criterion.
"""
_PARAMETERS = 10
"""Two decaying cosines, the offset, and the variance of the residual."""


@dataclass(frozen=True, slots=True)
class SecondOscillation:
    """The second decaying cosine of a decay, and the criterion of both.

    Attributes
    ----------
    angular_frequency : float
        rad/s.
    amplitude : float
        Unit of the samples, at the first sample.
    aic : float
        Akaike's criterion of both cosines together, for white residuals.
    """

    angular_frequency: float
    amplitude: float
    aic: float

    def better_than(self, aic: float) -> bool:
        """Tell whether two cosines describe the decay better than a fit with this criterion."""
        return self.aic < aic - _AIC_DIFFERENCE

    @property
    def words(self) -> str:
        """The second oscillation as part of a sentence."""
        hertz = self.angular_frequency / (2.0 * np.pi)
        return f"a second oscillation of {hertz:.4g} Hz is in the window: another mode, or a hum"


def second_oscillation(samples: DecaySamples, first: ExponentialDecay) -> SecondOscillation | None:
    """Return the second oscillation of a decay; None where there is none.

    Both cosines are fitted together; the second starts at the highest peak of the residual's spectrum. A frequency
    close to the first one is a slow change of the first oscillation. A multiple of the first frequency comes from
    friction and springs. Both count as no second oscillation.
    """
    residual = samples.value - first.fitted
    time = samples.time - samples.time[0]
    least = _LINE_DISTANCE * 2.0 * np.pi / float(time[-1])
    omega, own = first.angular_frequency.value, first.decay_rate.value
    try:
        start = spectral_peak(replace(samples, value=residual))
    except EstimationError:
        return None  # nothing is left
    found = _both(time, samples.value, (omega, own), (start, own))
    if found is None:
        return None
    parameters, left = found
    places = parameters[[2, 6]]
    second = 4 * int(np.argmax(np.abs(places - omega)))
    other = float(parameters[second + 2])
    multiple = max(round(other / omega), 1) * omega
    explained = 1.0 - float(left @ left) / float(residual @ residual)
    noise = residual_test(left, float(np.max(np.abs(samples.value))), omega * samples.mean_interval).adequate
    if not other > least or abs(other - multiple) < least or not (noise or explained > _EXPLAINED):
        return None
    count = len(time)
    aic = count * float(np.log(max(float(left @ left) / count, 1e-300))) + 2.0 * _PARAMETERS
    return SecondOscillation(other, float(np.hypot(*parameters[second : second + 2])), aic)


def _both(
    time: Floats, value: Floats, first: tuple[float, float], second: tuple[float, float]
) -> tuple[Floats, Floats] | None:
    """Return the parameters of two decaying cosines and the offset, and the residual.

    Start values are pairs of angular frequency and decay rate. None where the fit does not settle.
    """
    from scipy.optimize import least_squares

    columns = [
        np.exp(-rate * time) * turned(omega * time)
        for omega, rate in (first, second)
        for turned in (np.cos, np.sin)
    ]
    linear = np.linalg.lstsq(np.column_stack([*columns, np.ones_like(time)]), value, rcond=None)[0]
    start = np.array([*linear[:2], *first, *linear[2:4], *second, linear[4]])

    def parts(p: Floats) -> tuple[tuple[Floats, Floats], ...]:
        return tuple(decaying_cosine(np.append(p[place : place + 4], 0.0), time) for place in (0, 4))

    def residual(p: Floats) -> Floats:
        return np.asarray(sum(motion for motion, _ in parts(p)) + p[8] - value)

    def derivatives(p: Floats) -> Floats:
        return np.hstack([*(columns[:, :4] for _, columns in parts(p)), np.ones((len(time), 1))])

    with np.errstate(all="ignore"):  # a trial step may overflow; it is then shortened
        found = least_squares(residual, start, jac=derivatives, x_scale="jac", max_nfev=200)
    if not found.success or not np.all(np.isfinite(found.x)):
        return None
    return found.x, np.asarray(found.fun)
