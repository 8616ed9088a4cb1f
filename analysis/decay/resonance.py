"""Natural frequency, damping ratio and modal constant of a resonance, fitted to a frequency response; its dataset."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import described
from vibroimpact.analysis.decay.estimate import Estimate, table_of, verdict_of
from vibroimpact.analysis.decay.frequency_response import DRIVEN, FrequencyResponse, half_power
from vibroimpact.analysis.decay.leakage import NO_LEAKAGE, Leakage
from vibroimpact.analysis.decay.residuals import coloured_covariance, residual_test
from vibroimpact.analysis.decay.samples import Complexes, Floats
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.messages import Argument, joined, message

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

FORMS = ("displacement", "velocity", "acceleration", "transmissibility")
"""Kinds of response: the first three to a force, the last an absolute acceleration to that of the base."""

_FEWEST_LINES = 8
_STANDS_OUT = 3.0
"""Modal constant, in standard errors, below which a peak may be a ripple of the noise."""
_BAND = 8.0
"""Fitted half-power bandwidths on either side of a peak, unless a band is given."""
_NEIGHBOURS = 5
"""Number of lines over which the variance from the coherence is averaged."""
_ROUNDING = 1e-12
"""Distance of the coherence from 1 below which the distance is rounding, and errors are unknown."""
_BY_CHANCE = 1e-3
"""Probability of a larger misfit by chance alone, below which the band holds more than one resonance."""
_LARGEST_MISFIT = 0.01
"""Misfit over the peak above which one resonance does not describe lines whose errors are unknown."""
_FEW_LINES = 0.5
"""Lines in the half-power bandwidth below which the lines show leakage instead of the resonance."""
_LEAKAGE_ERROR = 0.1
"""Standard error of the leakage's shift, as a share of the shift: rho is the mean over the lines."""


@dataclass(frozen=True, slots=True)
class Resonance:
    """A fitted resonance.

    `H = C N(omega) / (omega0^2 - omega^2 + 2 i zeta omega0 omega) + R`. For displacement (p = 0), velocity or
    acceleration per force, `N = (i omega)^p`; for a transmissibility, `N = omega0^2 + 2 i zeta omega0 omega`. R is the
    response of all other modes in the band.

    Attributes
    ----------
    natural_angular_frequency, damping_ratio : Estimate
    modal_constant : Estimate
        C: 1/mass of a single oscillator; for a transmissibility the participation (1 for a single oscillator).
    phase : Estimate or None
        Phase of C, rad: 0 or pi where model and polarity are right; None where only magnitudes were fitted.
    half_power_damping_ratio : float
        Ratio from the bandwidth at the peak over sqrt 2, as a check; NaN where the curve does not fall that far.
    angular_frequency, magnitude, fitted : ndarray of float, shape (line,)
        The fitted lines: rad/s, `|H|` measured and fitted.
    error : ndarray of float, shape (line,)
        Standard error of the magnitude; zeros where unknown.
    doubts : tuple of str
        Reasons why the estimates are unreliable, each a part of a sentence.
    """

    natural_angular_frequency: Estimate
    damping_ratio: Estimate
    modal_constant: Estimate
    phase: Estimate | None
    form: str
    half_power_damping_ratio: float
    angular_frequency: Floats
    magnitude: Floats
    fitted: Floats
    error: Floats
    doubts: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """One line that says whether the estimates are reliable, and why not."""
        return verdict_of(self.doubts)


@dataclass(frozen=True, slots=True)
class Curve:
    """A frequency response to fit: complex where the phase is known, else real magnitudes.

    Attributes
    ----------
    angular_frequency : ndarray of float, shape (line,)
        rad/s.
    response : ndarray of complex or float, shape (line,)
    error : ndarray of float, shape (line,)
        Standard error of each real part; zeros where unknown.
    form, unit : str
        One of `FORMS`; CF unit of C.
    leakage : Leakage
        Effect of the segments on the lines.
    estimator : {"h1", "h2"}
    common : float
        Number of lines equivalent to one independent line.
    """

    angular_frequency: Floats
    response: Floats | Complexes
    error: Floats
    form: str = "displacement"
    unit: str = "1"
    leakage: Leakage = NO_LEAKAGE
    estimator: str = "h1"
    common: float = 1.0

    @property
    def complex(self) -> bool:
        """Whether the phase is known."""
        return np.iscomplexobj(self.response)


def curve_of(
    found: FrequencyResponse,
    form: str = "auto",
    band: tuple[float, float] | None = None,
    estimator: str = "h1",
) -> Curve:
    """Return the part of a frequency response around its highest peak, or in a band, ready to be fitted.

    Parameters
    ----------
    found : FrequencyResponse
    form : str
        One of `FORMS`, or `auto`: by the units of the channels.
    band : tuple of float, optional
        Hz.
    estimator : {"h1", "h2"}

    Raises
    ------
    UsageError
        Unknown form, or too few lines in the band.
    """
    if form not in ("auto", *FORMS):
        raise UsageError(
            message(Argument("form"), f': expected auto or one of {", ".join(FORMS)}, got "{form}".')
        )
    if form == "auto":
        form = _form_of(found.units)
    response = found.h2 if estimator == "h2" else found.h1
    omega = 2.0 * np.pi * found.frequency
    low, high = band or (0.0, np.inf)
    lines = (found.frequency >= low) & (found.frequency <= high)
    if band is None:
        # Lines with hardly any drive are noise over noise, and their quotient may be the highest of all.
        driven = np.abs(response) * (found.drive_power > DRIVEN)
        peak, width = _peak(omega, driven)
        finest = max(2.0 * np.pi * found.resolution, 2.0 * float(omega[1] - omega[0]))
        lines &= np.abs(omega - peak) <= _BAND * max(width, finest)
    if np.count_nonzero(lines) < _FEWEST_LINES:
        raise UsageError(
            message(
                Argument("band"),
                f": expected {_FEWEST_LINES} lines or more, got {np.count_nonzero(lines)}; they are "
                f"{found.frequency[1] - found.frequency[0]:.4g} Hz apart. Widen the band, or take longer segments.",
            )
        )
    magnitude = np.abs(response)
    known = found.averages > 1.5 and float(np.max(found.coherence[lines])) < 1.0 - _ROUNDING
    error = _errors(magnitude, found) if known else np.zeros_like(magnitude)
    return Curve(
        omega[lines],
        response[lines] if found.phase_known else magnitude[lines],
        error[lines],
        form,
        _constant_unit(form, found.units),
        found.leakage,
        estimator,
        found.common,
    )


def _errors(magnitude: Floats, found: FrequencyResponse) -> Floats:
    """Return the standard errors of the lines, from the coherence of each line and its neighbours.

    With few averages, the coherence of a single line is too high and too uncertain for a weight.
    """
    from scipy.ndimage import uniform_filter1d

    unbiased = found.averages / (found.averages - 1.0)
    variance = unbiased * (magnitude * found.relative_error) ** 2
    # geometric: the error of leakage is a share of the response, which changes fast about its peak
    return np.asarray(np.exp(0.5 * uniform_filter1d(np.log(np.maximum(variance, 1e-300)), _NEIGHBOURS)))


def _form_of(units: tuple[str, str]) -> str:
    drive, response = units
    if drive == response == "m s-2":
        return "transmissibility"
    return {"m s-1": "velocity", "m s-2": "acceleration"}.get(response, "displacement")


def _constant_unit(form: str, units: tuple[str, str]) -> str:
    if form == "transmissibility" or units == ("1", "1"):
        return "1"
    drive, response = units
    mechanical = drive == "N" and response in ("m", "m s-1", "m s-2")
    return "kg-1" if mechanical else f"({response}) ({drive})-1"


def _peak(omega: Floats, magnitude: Floats) -> tuple[float, float]:
    """Return the place of the highest value, and the width of the peak at this value over sqrt 2."""
    low, high = half_power(omega, magnitude)
    return float(omega[np.argmax(magnitude)]), high - low if np.isfinite(high - low) else 0.0


def half_power_damping_ratio(omega: Floats, magnitude: Floats) -> float:
    """Return `(omega_2^2 - omega_1^2) / (4 omega_peak^2)` of the half-power points; NaN where there are none.

    `omega` is in rad/s, `magnitude` is `|H|`.
    """
    low, high = half_power(omega, magnitude)
    return float((high**2 - low**2) / (4.0 * omega[int(np.argmax(magnitude))] ** 2))


def _shape(omega: Floats, natural: float, damping: float, form: str) -> Complexes:
    """Return N / (omega0^2 - omega^2 + 2 i zeta omega0 omega)."""
    bottom = natural**2 - omega**2 + 2j * damping * natural * omega
    if form == "transmissibility":
        return np.asarray((natural**2 + 2j * damping * natural * omega) / bottom)
    return np.asarray((1j * omega) ** FORMS.index(form) / bottom)


def fit_resonance(curve: Curve | FrequencyResponse) -> Resonance:
    """Fit one resonance to a frequency response by least squares, weighted by its errors where these are known.

    The model includes the leakage of the lines (`Leakage`). Standard errors come from the scatter about the fit,
    neighbouring lines correlated or not, or from the coherence, whichever is larger. A tenth of the leakage's shift is
    added. A frequency response is fitted around its highest peak, see `curve_of`. A misfit beyond chance, for example
    from a second resonance in the band, is a reason for doubt.

    Raises
    ------
    EstimationError
        No resonance is in the band.
    """
    curve = curve_of(curve) if isinstance(curve, FrequencyResponse) else curve
    found = _solved(curve, _start(curve))
    covariance, _ = coloured_covariance(found.jac, found.fun, 4 if curve.complex else 2)
    if np.all(curve.error > 0.0):
        covariance = _larger(covariance, np.linalg.pinv(found.jac.T @ found.jac))
    if len(curve.leakage.weights) > 1:
        unleaked = _solved(replace(curve, leakage=NO_LEAKAGE), found.x).x
        covariance = covariance + np.diag((_LEAKAGE_ERROR * (found.x - unleaked)) ** 2)
    resonance = _described(curve, found.x, covariance, np.abs(_model(curve, found.x)))
    constant = resonance.modal_constant
    if abs(constant.value) < _STANDS_OUT * constant.standard_error:
        raise EstimationError(
            f"resonance: expected one that stands out of the noise, got a modal constant of "
            f"{constant.value:.3g} +- {constant.standard_error:.2g}. Choose another band."
        )
    return replace(resonance, doubts=(*_misfit(curve, found), *_too_narrow(curve, resonance)))


def _model(curve: Curve, p: Floats) -> Floats | Complexes:
    """Return the lines of a resonance, leakage included, from its frequency, damping ratio, C and R."""
    omega, seen = curve.angular_frequency, curve.leakage.seen
    if not curve.complex:
        return np.asarray(np.abs(seen(lambda at: p[2] * _shape(at, p[0], p[1], curve.form), omega) + p[3]))
    constant, others = p[2] + 1j * p[3], p[4] + 1j * p[5]

    def response(at: Floats) -> Complexes:
        return np.asarray(constant * _shape(at, p[0], p[1], curve.form) + others)

    cross = seen(response, omega)
    if curve.estimator == "h1" or len(curve.leakage.weights) == 1:
        return cross
    return np.asarray(seen(lambda at: np.abs(response(at)) ** 2 + 0j, omega) / np.conj(cross))


def _solved(curve: Curve, start: Floats) -> OptimizeResult:
    """Return the least-squares fit; EstimationError where its parameters leave the band."""
    from scipy.optimize import least_squares

    omega = curve.angular_frequency
    known = bool(np.all(curve.error > 0.0))
    largest = float(np.max(np.abs(curve.response)))
    weight = 1.0 / curve.error if known else np.full(len(omega), 1.0 / largest)

    def residual(p: Floats) -> Floats:
        # Real and imaginary part of each line alternate: neighbours in the residual are neighbours in frequency.
        return np.asarray((_model(curve, p) - curve.response) * weight).view(np.float64)

    found = least_squares(residual, start, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=400)
    natural, damping = float(found.x[0]), float(found.x[1])
    if not (omega[0] <= natural <= omega[-1] and 0.0 < damping < 1.0):
        raise EstimationError(
            f"resonance: expected one from {omega[0] / (2 * np.pi):.6g} to {omega[-1] / (2 * np.pi):.6g} Hz, got "
            f"{natural / (2 * np.pi):.6g} Hz with damping ratio {damping:.3g}. Choose another band."
        )
    return found


def _misfit(curve: Curve, found: OptimizeResult) -> tuple[str, ...]:
    """Return the reason for doubt if one resonance does not describe the lines."""
    from scipy.stats import chi2

    omega = curve.angular_frequency
    parts = found.fun.reshape(len(omega), -1)
    left = np.sum(parts**2, axis=1)
    farthest = omega[int(np.argmax(left))] / (2.0 * np.pi)
    why = (
        f"another resonance near the fitted one (the misfit is largest at {farthest:.5g} Hz), or motion that is not "
        "linear"
    )
    if np.all(curve.error > 0.0):
        freedom = max((parts.size - len(found.x)) / curve.common, 1.0)
        mean = float(np.sum(left)) / max(parts.size - len(found.x), 1)
        if mean * freedom > float(chi2.isf(_BY_CHANCE, freedom)):
            return (f"the fit leaves {np.sqrt(mean):.2g} times what the coherence explains: {why}",)
        return ()
    # residuals are shares of the peak here
    rms = float(np.sqrt(np.mean(left)))
    if rms > _LARGEST_MISFIT and not residual_test(found.fun, 1.0, np.pi / 2.0).adequate:
        return (f"the fit leaves {100.0 * rms:.2g} % of the peak, and not as noise: {why}",)
    return ()


def _too_narrow(curve: Curve, resonance: Resonance) -> tuple[str, ...]:
    """Return the reason for doubt if lines are too far apart for the resonance."""
    width = 2.0 * resonance.damping_ratio.value * resonance.natural_angular_frequency.value
    lines = width / (2.0 * curve.leakage.spacing) if curve.leakage.spacing else np.inf
    if lines >= _FEW_LINES:
        return ()
    return (
        f"the half-power bandwidth has {lines:.2g} lines, and leakage takes the place of the resonance: record "
        "longer, or fit the decay",
    )


def _larger(one: Floats, other: Floats) -> Floats:
    """Return the first covariance, scaled up where the second has larger variances."""
    scale = np.sqrt(np.maximum(1.0, np.diag(other) / np.maximum(np.diag(one), 1e-300)))
    return np.asarray(one * np.outer(scale, scale))


def _start(curve: Curve) -> Floats:
    """Return start parameters from the peak and its width; EstimationError for lines of one frequency."""
    omega = curve.angular_frequency
    # a sweep up and down has each frequency twice
    spacing = float(omega[1] - omega[0]) or float(np.ptp(omega)) / (len(omega) - 1)
    if not spacing > 0.0:
        raise EstimationError(
            f"resonance: expected lines at several frequencies, got {omega[0] / (2 * np.pi):.6g} Hz alone. "
            "Choose another band."
        )
    peak, width = _peak(omega, np.abs(curve.response))
    damping = min(0.5 * max(width, spacing) / peak, 0.3)
    shape = _shape(omega, peak, damping, curve.form)
    if not curve.complex:
        return np.array([peak, damping, float(np.max(curve.response) / np.max(np.abs(shape))), 0.0])
    columns = np.column_stack([shape, np.ones_like(shape)])
    constant, others = np.linalg.lstsq(columns, curve.response, rcond=None)[0]
    return np.array([peak, damping, constant.real, constant.imag, others.real, others.imag])


def _described(curve: Curve, found: Floats, covariance: Floats, fitted: Floats) -> Resonance:
    error = np.sqrt(np.diag(covariance))
    freedom = max(len(curve.angular_frequency) * (2.0 if curve.complex else 1.0) - len(found), 1.0)
    constant, constant_error, phase = float(found[2]), float(error[2]), None
    if curve.complex:
        turned = complex(found[2], found[3])
        along = np.array([turned.real, turned.imag]) / abs(turned)
        across = np.array([-turned.imag, turned.real]) / abs(turned) ** 2
        block = covariance[2:4, 2:4]
        constant = abs(turned) * (1.0 if turned.real >= 0.0 else -1.0)
        constant_error = float(np.sqrt(along @ block @ along))
        phase = Estimate(float(np.angle(turned)), float(np.sqrt(across @ block @ across)), "rad", freedom)
    omega, magnitude = curve.angular_frequency, np.abs(curve.response)
    return Resonance(
        Estimate(float(found[0]), float(error[0]), "rad s-1", freedom),
        Estimate(float(found[1]), float(error[1]), "1", freedom),
        Estimate(constant, constant_error, curve.unit, freedom),
        phase,
        curve.form,
        half_power_damping_ratio(omega, magnitude),
        omega,
        magnitude,
        fitted,
        curve.error,
    )


def resolution_remark(found: FrequencyResponse, resonance: Resonance) -> tuple[str, ...]:
    """Return the warning that lines are too wide for the resonance, if they are."""
    width = resonance.damping_ratio.value * resonance.natural_angular_frequency.value / np.pi
    if found.resolution < 0.25 * width:
        return ()
    return (
        message(
            f"a line is {found.resolution:.3g} Hz wide and the resonance {width:.3g} Hz: the fit takes the leakage "
            "out, and its doubt widens the intervals. Take longer segments (",
            *(Argument("segment"), "), or fit the decay."),
        ),
    )


@dataclass(frozen=True, slots=True)
class ResponseEstimates:
    """A fitted resonance and its source.

    `response` is None for a curve from a simulated sweep; `unit` is the CF unit of the response.
    """

    resonance: Resonance
    response: FrequencyResponse | None
    title: str
    unit: str = "1"
    remarks: tuple[str, ...] = ()

    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """Return the estimates by method, then quantity."""
        fit = self.resonance
        found = {
            "natural_angular_frequency": fit.natural_angular_frequency,
            "damping_ratio": fit.damping_ratio,
            "modal_constant": fit.modal_constant,
        }
        if fit.phase is not None:
            found["modal_phase"] = fit.phase
        rough = Estimate(fit.half_power_damping_ratio, float("nan"))
        return {"response": found, "half_power": {"damping_ratio": rough}}

    def words(self) -> tuple[str, ...]:
        """Return the remarks for a reader, in sentences."""
        said = list(self.remarks)
        fit = self.resonance
        ratio = fit.half_power_damping_ratio / fit.damping_ratio.value
        if not np.isfinite(ratio):
            said.append("the band does not hold both half-power points: there is no cross-check.")
        elif abs(ratio - 1.0) > 0.2 and not (self.response and resolution_remark(self.response, fit)):
            said.append(
                f"the half-power bandwidth gives {ratio:.2g} times the fitted damping ratio: another mode, noise, or "
                "lines too far apart."
            )
        return tuple(said)

    def dataset(self) -> xr.Dataset:
        """Return estimates (method, quantity), the fitted lines, and all lines of a measured response."""
        fit, found, unit = self.resonance, self.response, self.unit
        lines = {
            "response": ("line", fit.magnitude, unit, "magnitude of the response"),
            "response_error": ("line", fit.error, unit, "standard error of the magnitude"),
            "fitted_response": ("line", fit.fitted, unit, "magnitude of the fitted response"),
        }
        at = {"angular_frequency": ("line", fit.angular_frequency, "rad s-1", "frequency")}
        parts = [table_of(self.estimates()), xr.Dataset(described(lines), described(at))]
        if found is not None:
            measured = {
                "h1_magnitude": ("frequency", np.abs(found.h1), unit, "|H1|"),
                "h1_phase": ("frequency", np.angle(found.h1), "rad", "phase of H1"),
                "h2_magnitude": ("frequency", np.abs(found.h2), unit, "|H2|"),
                "coherence": ("frequency", found.coherence, "1", "coherence"),
                "frequency": ("frequency", found.frequency, "Hz", "frequency"),
            }
            parts.append(xr.Dataset(described(measured)))
        return xr.merge(parts, combine_attrs="override").assign_attrs(
            estimates="response",
            title=self.title,
            form=fit.form,
            verdict=fit.verdict,
            remarks=joined("\n", self.words()),
        )
