"""Natural frequency, damping ratio and modal constant of a resonance, fitted to a frequency response; its dataset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import described
from vibroimpact.analysis.decay.estimate import Estimate, table_of
from vibroimpact.analysis.decay.frequency_response import Complexes, FrequencyResponse
from vibroimpact.analysis.decay.residuals import coloured_covariance
from vibroimpact.analysis.decay.samples import Floats
from vibroimpact.fmus.errors import EstimationError, UsageError
from vibroimpact.fmus.wording import option

FORMS = ("displacement", "velocity", "acceleration", "transmissibility")
"""What responds to what: the first three to a force, the last an absolute acceleration to that of the base."""

_FEWEST_LINES = 8
_DRIVEN = 1e-3
"""Drive of a line, relative to the largest, below which it is not looked at for a peak."""
_STANDS_OUT = 3.0
"""Modal constant, in standard errors, below which a peak may be a ripple of the noise."""
_BAND = 8.0
"""Half-power bandwidths on either side of a peak that are fitted, unless a band is given."""


@dataclass(frozen=True, slots=True)
class Resonance:
    """A fitted resonance.

    `H = C N(omega) / (omega0^2 - omega^2 + 2 i zeta omega0 omega) + R`, with `N = (i omega)^p` for the displacement
    (p = 0), velocity or acceleration per force, and `N = omega0^2 + 2 i zeta omega0 omega` for a transmissibility; R is
    what all other modes leave in the band.

    Attributes
    ----------
    natural_angular_frequency, damping_ratio : Estimate
    modal_constant : Estimate
        C: 1/mass of a single oscillator, or the participation (1 of a single one) of a transmissibility.
    phase : Estimate or None
        Of C, rad: 0 or pi where model and polarity are right; None where only magnitudes were fitted.
    half_power_damping_ratio : float
        From the bandwidth at the peak over sqrt 2, as a check; NaN where the curve does not fall that far.
    angular_frequency, magnitude, fitted : ndarray of float, shape (line,)
        What was fitted: rad/s, `|H|` measured and fitted.
    error : ndarray of float, shape (line,)
        Standard error of the magnitude; zeros where not known.
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


@dataclass(frozen=True, slots=True)
class Curve:
    """A frequency response to fit: complex where the phase is known, else real magnitudes.

    Attributes
    ----------
    angular_frequency : ndarray of float, shape (line,)
        rad/s.
    response : ndarray of complex or float, shape (line,)
    error : ndarray of float, shape (line,)
        Standard error of each real part; zeros where not known.
    form, unit : str
        One of `FORMS`; CF unit of C.
    """

    angular_frequency: Floats
    response: Floats | Complexes
    error: Floats
    form: str = "displacement"
    unit: str = "1"

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
        raise UsageError(f'{option("form")}: expected auto or one of {", ".join(FORMS)}, got "{form}".')
    if form == "auto":
        form = _form_of(found.units)
    response = found.h2 if estimator == "h2" else found.h1
    omega = 2.0 * np.pi * found.frequency
    low, high = band or (0.0, np.inf)
    lines = (found.frequency >= low) & (found.frequency <= high)
    if band is None:
        # Where hardly anything was driven, the quotient is noise over noise, and may be the highest of all.
        driven = np.abs(response) * (found.drive_power > _DRIVEN)
        peak, width = _peak(omega, driven)
        finest = max(2.0 * np.pi * found.resolution, 2.0 * float(omega[1] - omega[0]))
        lines &= np.abs(omega - peak) <= _BAND * max(width, finest)
    if np.count_nonzero(lines) < _FEWEST_LINES:
        raise UsageError(
            f"{option('band')}: expected {_FEWEST_LINES} lines or more, got {np.count_nonzero(lines)}; they are "
            f"{found.frequency[1] - found.frequency[0]:.4g} Hz apart. Widen the band, or take longer segments."
        )
    magnitude = np.abs(response)
    error = magnitude * found.relative_error if found.averages > 1.5 else np.zeros_like(magnitude)
    chosen = response[lines] if found.phase_known else magnitude[lines]
    return Curve(omega[lines], chosen, error[lines], form, _constant_unit(form, found.units))


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
    """Return the place of the highest value, and the width at which it has fallen by sqrt 2."""
    low, high = _half_power(omega, magnitude)
    return float(omega[np.argmax(magnitude)]), high - low if np.isfinite(high - low) else 0.0


def _half_power(omega: Floats, magnitude: Floats) -> tuple[float, float]:
    """Return where the magnitude falls to its maximum over sqrt 2, on both sides; NaN where it does not."""
    top = int(np.argmax(magnitude))
    level = _highest(magnitude, top) / np.sqrt(2.0)
    below = np.flatnonzero(magnitude < level)
    left, right = below[below < top], below[below > top]

    def crossing(low: int, high: int) -> float:
        share = (level - magnitude[low]) / (magnitude[high] - magnitude[low])
        return float(omega[low] + share * (omega[high] - omega[low]))

    return (
        crossing(int(left[-1]), int(left[-1]) + 1) if len(left) else np.nan,
        crossing(int(right[0]), int(right[0]) - 1) if len(right) else np.nan,
    )


def _highest(magnitude: Floats, top: int) -> float:
    """Return the height of the parabola through the highest value and its neighbours."""
    if not 0 < top < len(magnitude) - 1:
        return float(magnitude[top])
    before, here, after = magnitude[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    return float(here - (after - before) ** 2 / (8.0 * bend)) if bend < 0.0 else float(here)


def half_power_damping_ratio(omega: Floats, magnitude: Floats) -> float:
    """Return `(omega_2^2 - omega_1^2) / (4 omega_peak^2)` of the half-power points; NaN where there are none.

    `omega` is in rad/s, `magnitude` is `|H|`.
    """
    low, high = _half_power(omega, magnitude)
    return float((high**2 - low**2) / (4.0 * omega[int(np.argmax(magnitude))] ** 2))


def _shape(omega: Floats, natural: float, damping: float, form: str) -> Complexes:
    """Return N / (omega0^2 - omega^2 + 2 i zeta omega0 omega)."""
    bottom = natural**2 - omega**2 + 2j * damping * natural * omega
    if form == "transmissibility":
        return np.asarray((natural**2 + 2j * damping * natural * omega) / bottom)
    return np.asarray((1j * omega) ** FORMS.index(form) / bottom)


def fit_resonance(curve: Curve | FrequencyResponse) -> Resonance:
    """Fit one resonance to a frequency response by least squares, weighted by its errors where these are known.

    Standard errors are those of the scatter about the fit, neighbouring lines correlated or not, or those that the
    coherence predicts, whichever are larger. Of a frequency response the part around its highest peak is fitted, see
    `curve_of`.

    Raises
    ------
    EstimationError
        No resonance is in the band.
    """
    from scipy.optimize import least_squares

    curve = curve_of(curve) if isinstance(curve, FrequencyResponse) else curve
    omega, magnitude = curve.angular_frequency, np.abs(curve.response)
    peak, width = _peak(omega, magnitude)
    known = bool(np.all(curve.error > 0.0))
    weight = 1.0 / curve.error if known else np.full(len(omega), 1.0 / float(np.max(magnitude)))

    def model(p: Floats) -> Floats | Complexes:
        shape = _shape(omega, p[0], p[1], curve.form)
        if curve.complex:
            return np.asarray((p[2] + 1j * p[3]) * shape + p[4] + 1j * p[5])
        return np.asarray(np.abs(p[2] * shape + p[3]))

    def residual(p: Floats) -> Floats:
        # Real and imaginary part of each line in turn: neighbours in the residual are neighbours in frequency.
        return np.asarray((model(p) - curve.response) * weight).view(np.float64)

    # a sweep up and down has each frequency twice
    spacing = float(omega[1] - omega[0]) or float(np.ptp(omega)) / (len(omega) - 1)
    if not spacing > 0.0:
        raise EstimationError(
            f"resonance: expected lines at several frequencies, got {omega[0] / (2 * np.pi):.6g} Hz alone. "
            "Choose another band."
        )
    start = _start(curve, peak, max(width, spacing))
    found = least_squares(residual, start, x_scale="jac", xtol=1e-14, ftol=1e-14, gtol=1e-14, max_nfev=400)
    natural, damping = float(found.x[0]), float(found.x[1])
    if not (omega[0] <= natural <= omega[-1] and 0.0 < damping < 1.0):
        raise EstimationError(
            f"resonance: expected one from {omega[0] / (2 * np.pi):.6g} to {omega[-1] / (2 * np.pi):.6g} Hz, got "
            f"{natural / (2 * np.pi):.6g} Hz with damping ratio {damping:.3g}. Choose another band."
        )
    covariance, _ = coloured_covariance(found.jac, found.fun, 4 if curve.complex else 2)
    if known:
        covariance = _larger(covariance, np.linalg.pinv(found.jac.T @ found.jac))
    described = _described(curve, found.x, covariance, np.abs(model(found.x)))
    if abs(described.modal_constant.value) < _STANDS_OUT * described.modal_constant.standard_error:
        raise EstimationError(
            f"resonance: expected one that stands out of the noise, got a modal constant of "
            f"{described.modal_constant.value:.3g} +- {described.modal_constant.standard_error:.2g}. "
            "Choose another band."
        )
    return described


def _larger(one: Floats, other: Floats) -> Floats:
    """Return the first covariance, scaled up where the second has larger variances."""
    scale = np.sqrt(np.maximum(1.0, np.diag(other) / np.maximum(np.diag(one), 1e-300)))
    return np.asarray(one * np.outer(scale, scale))


def _start(curve: Curve, peak: float, width: float) -> Floats:
    damping = min(0.5 * width / peak, 0.3)
    shape = _shape(curve.angular_frequency, peak, damping, curve.form)
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
    """Return the warning that lines are too wide for the resonance, where they are."""
    width = resonance.damping_ratio.value * resonance.natural_angular_frequency.value / np.pi
    if found.resolution < 0.25 * width:
        return ()
    return (
        f"a line is {found.resolution:.3g} Hz wide and the resonance {width:.3g} Hz: the damping ratio may be too "
        f"large by leakage. Take longer segments ({option('segment')}), or fit the decay.",
    )


@dataclass(frozen=True, slots=True)
class ResponseEstimates:
    """A fitted resonance and where it is from.

    `response` is None where the curve is that of a simulated sweep; `unit` is the CF unit of the response.
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
        """Return what a reader must know, in sentences."""
        said = list(self.remarks)
        fit = self.resonance
        ratio = fit.half_power_damping_ratio / fit.damping_ratio.value
        if not np.isfinite(ratio):
            said.append("the band does not hold both half-power points: there is no cross-check.")
        elif abs(ratio - 1.0) > 0.2:
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
            estimates="response", title=self.title, form=fit.form, remarks="\n".join(self.words())
        )
