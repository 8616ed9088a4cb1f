"""All estimates from one free decay, as a dataset and as printed tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import Row, described
from vibroimpact.analysis.decay.backbone import Backbone, backbone
from vibroimpact.analysis.decay.decrement import Decrement, Peaks, logarithmic_decrement
from vibroimpact.analysis.decay.estimate import (
    METHOD_WORDS,
    Estimate,
    print_estimates,
    print_remarks,
    table_of,
    verdict_by_method,
)
from vibroimpact.analysis.decay.exponential import ExponentialDecay, fit_exponential
from vibroimpact.analysis.decay.law_fit import CUBIC, LawChoice, LawFit, choose_law
from vibroimpact.analysis.decay.laws import ALL_LAWS, TERMS, VISCOUS, DampingLaw, spoken
from vibroimpact.analysis.decay.residuals import ResidualTest
from vibroimpact.analysis.decay.samples import DecaySamples, decay_samples
from vibroimpact.analysis.decay.second_oscillation import SecondOscillation, second_oscillation
from vibroimpact.analysis.recording import Channel
from vibroimpact.analysis.recording.units import unit_label
from vibroimpact.fmus.errors import EstimationError
from vibroimpact.fmus.messages import joined, message
from vibroimpact.fmus.printing import table, value_and_error, with_error
from vibroimpact.fmus.terminal import Terminal

T = TypeVar("T")
_TERMS = (*TERMS, CUBIC)


@dataclass(frozen=True, slots=True)
class FreeDecay:
    """Results of one free decay.

    A field is None if its method was not requested, or failed; `refusals` has the reason by method.
    """

    samples: DecaySamples
    exponential: ExponentialDecay
    decrement: Decrement | None = None
    choice: LawChoice | None = None
    backbone: Backbone | None = None
    refusals: Mapping[str, str] = field(default_factory=dict)
    second: SecondOscillation | None = None

    @property
    def law(self) -> LawFit | None:
        """The best damping law; None where a second oscillation explains the motion better."""
        return self.choice.best if self.choice is not None and self.second is None else None

    def doubts(self) -> dict[str, list[str]]:
        """Return the reasons why estimates are unreliable, by method; each is a part of a sentence."""
        common = [self.second.words] if self.second is not None else []
        if self.exponential.decay_rate.interval[0] <= 0.0:
            common.append("the motion does not decay by more than its error")
        found = {}
        misfit = _misfit("a decaying cosine", self.exponential.test) if self.second is None else []
        if self.decrement is not None:
            bent = ["the logarithm of the peaks is not a straight line"] if self.decrement.bent else []
            found["decrement"] = common + (bent or misfit)
        found["exponential"] = common + misfit
        if self.law is not None:
            negative = [] if self.law.physical else ["a coefficient of the law is negative"]
            found["law"] = common + negative + _misfit(spoken(self.law.law), self.law.test)
        return found

    @property
    def verdict(self) -> str:
        """One line with the reliable methods, the unreliable methods, and the reasons."""
        return verdict_by_method(self.doubts())

    def estimates(self) -> dict[str, dict[str, Estimate]]:
        """Return the estimates by method, then quantity."""
        found: dict[str, dict[str, Estimate]] = {}
        if self.decrement is not None:
            found["decrement"] = {
                "logarithmic_decrement": self.decrement.decrement,
                "damping_ratio": self.decrement.damping_ratio,
                "angular_frequency": self.decrement.angular_frequency,
            }
        quantities = (
            *("amplitude", "angular_frequency", "decay_rate", "phase", "offset"),
            *("natural_angular_frequency", "damping_ratio"),
        )
        found["exponential"] = {name: getattr(self.exponential, name) for name in quantities}
        if self.law is not None:
            found["law"] = law_estimates(self.law)
        return found

    def words(self) -> tuple[str, ...]:
        """Return the remarks for a reader, in sentences."""
        sentences = list(self.samples.remarks)
        rate = self.exponential.decay_rate
        if rate.interval[0] <= 0.0:
            sentences.append(
                "the motion does not decay by more than its error: it is driven, or the window too short."
            )
        sentences.append(f"the decaying cosine is {self.exponential.test.words()}.")
        if self.decrement is not None and self.decrement.bent:
            sentences.append(
                f"the logarithm of the peaks is not a straight line (decrement about {self.decrement.first:.3g} at "
                f"first, {self.decrement.last:.3g} at last): the damping is not viscous alone."
            )
        if self.second is not None:
            sentences.append(
                f"{self.second.words}. Two decaying cosines describe the motion, and no damping law is chosen."
            )
        elif self.choice is not None:
            sentences += self.choice.words()
        if self.backbone is not None:
            sentences.append(self.backbone.words(self.samples.unit))
        sentences += [message(f"{method}: ", reason) for method, reason in self.refusals.items()]
        return tuple(sentences)

    def dataset(self) -> xr.Dataset:
        """Return the dataset: estimates (method, quantity), motion, laws, peaks and windows, where available."""
        parts = [table_of(self.estimates()), _motion(self)]
        if self.decrement is not None:
            parts.append(_peaks(self.decrement.peaks, self.samples.unit))
        if self.choice is not None:
            parts.append(_laws(self.choice, self.samples.unit))
        if self.backbone is not None:
            parts.append(_windows(self.backbone, self.samples.unit))
        return xr.merge(parts, combine_attrs="override").assign_attrs(
            estimates="decay",
            channel=self.samples.name,
            reference_time=self.samples.reference_time,
            best_law="" if self.law is None else self.law.law.name,
            verdict=self.verdict,
            remarks=joined("\n", self.words()),
        )


def estimate_decay(
    samples: DecaySamples | Channel | xr.DataArray,
    laws: Sequence[DampingLaw] = ALL_LAWS,
    *,
    cubic: bool = False,
    periods: float | None = None,
) -> FreeDecay:
    """Estimate frequency, damping and damping law of a free decay by all methods.

    Parameters
    ----------
    samples : DecaySamples, Channel or xarray.DataArray
        Samples of a decay; a signal is cut at its largest excursion, see `decay_samples`.
    laws : sequence of DampingLaw
        Laws to fit; if empty, no law is chosen.
    cubic : bool
        Fit a cubic stiffness with every law.
    periods : float, optional
        Length of the windows of the backbone.

    Raises
    ------
    EstimationError
        Nothing oscillates.
    """
    samples = samples if isinstance(samples, DecaySamples) else decay_samples(samples)
    exponential = fit_exponential(samples)
    refusals: dict[str, str] = {}

    def tried(method: str, estimate: Callable[[], T]) -> T | None:
        try:
            return estimate()
        except EstimationError as problem:
            refusals[method] = problem.message
            return None

    decrement = tried("decrement", lambda: logarithmic_decrement(samples))
    choice = tried("law", lambda: choose_law(samples, laws, cubic=cubic, start=exponential)) if laws else None
    best = exponential if choice is None else choice.best
    second = None if best.test.adequate else second_oscillation(samples, exponential)
    if second is not None and not second.better_than(best.aic):
        second = None
    windows = tried("backbone", lambda: backbone(samples, periods))
    return FreeDecay(samples, exponential, decrement, choice, windows, refusals, second)


def _misfit(what: str, test: ResidualTest) -> list[str]:
    """Return the reason for doubt if a fit leaves more than noise."""
    if test.adequate:
        return []
    return [
        f"{what} leaves more than noise ({100.0 * test.relative_structure:.2g} % of the largest excursion)"
    ]


def law_estimates(fit: LawFit) -> dict[str, Estimate]:
    """Return the coefficients of a fitted law, and the damping ratio of its viscous term."""
    known = fit.coefficients
    found = {name: known[name] for name in ("natural_angular_frequency", "offset")}
    found |= {"decay_rate" if name == VISCOUS else name: known[name] for name in _TERMS if name in known}
    if VISCOUS in known:
        omega, rate = known["natural_angular_frequency"], known[VISCOUS]
        # The relative error of the frequency is orders of magnitude smaller than that of the rate.
        error = rate.standard_error / omega.value
        found["damping_ratio"] = Estimate(rate.value / omega.value, error, "1", rate.degrees_of_freedom)
    return found


def _motion(decay: FreeDecay) -> xr.Dataset:
    samples, unit = decay.samples, decay.samples.unit
    rows: dict[str, Row] = {
        "measured": ("time", samples.value, unit, f"measured {samples.name}"),
        "exponential_fit": ("time", decay.exponential.fitted, unit, "fitted decaying cosine"),
    }
    if decay.law is not None:
        best = decay.law
        rows["law_fit"] = ("time", best.fitted, unit, f"motion under the fitted law: {spoken(best.law)}")
    return xr.Dataset(described(rows | {"time": ("time", samples.time, "s", "time")}))


def _peaks(peaks: Peaks, unit: str) -> xr.Dataset:
    rows = {
        "peak_height": ("peak", peaks.height, unit, "turning points from the equilibrium"),
        "peak_height_error": ("peak", peaks.error, unit, "standard error of the height"),
        "peak_number": ("peak", peaks.number, "1", "half periods from the first phase"),
    }
    at = {"peak_time": ("peak", peaks.time, "s", "instants of the turning points")}
    return xr.Dataset(described(rows), described(at))


def _laws(choice: LawChoice, unit: str) -> xr.Dataset:
    fits, samples = choice.fits, choice.effective_samples
    tests, effective = [fit.test for fit in fits], [fit.effective_aic(samples) for fit in fits]
    probability = [test.portmanteau_probability for test in tests]

    def column(words: str, values: Sequence[float | bool], of: str = "1") -> Row:
        return "law", np.array(values, dtype=np.float64), of, words

    rows = {
        "aic": column("Akaike's criterion, for white residuals", [fit.aic for fit in fits]),
        "aicc": column("Akaike's criterion, corrected for few samples", [fit.aicc for fit in fits]),
        "effective_aic": column("Akaike's criterion with the effective number of samples", effective),
        "akaike_weight": column("weight by the effective criterion", choice.weights()),
        "residual_rms": column("root mean square of the residual", [test.rms for test in tests], unit),
        "noise_floor": column("its white part", [test.noise_floor for test in tests], unit),
        "portmanteau_probability": column("Ljung-Box probability of white noise", probability),
        "adequate": column("1 where the residual passes for noise", [test.adequate for test in tests]),
        "physical": column("1 where no coefficient is negative", [fit.physical for fit in fits]),
    }
    for term in _TERMS:
        known = [fit.coefficients.get(term) for fit in fits]
        of = next((item.unit for item in known if item is not None), None)
        if of is not None:
            values = [np.nan if item is None else item.value for item in known]
            errors = [np.nan if item is None else item.standard_error for item in known]
            rows[f"law_{term}"] = column(f"{term} coefficient", values, of)
            rows[f"law_{term}_error"] = column(f"standard error of the {term} coefficient", errors, of)
    at: dict[str, Row] = {
        "law": ("law", [fit.law.name for fit in fits], "1", "damping law"),
        "effective_samples": ((), samples, "1", "independent samples"),
    }
    return xr.Dataset(described(rows), described(at))


def _windows(found: Backbone, unit: str) -> xr.Dataset:
    along, frequency = "window", "natural angular frequency in the window"
    rows = {
        "window_time": (along, found.time, "s", "middle of the window"),
        "window_amplitude": (along, found.amplitude, unit, "amplitude in the middle of the window"),
        "window_frequency": (along, found.angular_frequency, "rad s-1", frequency),
        "window_frequency_error": (along, found.angular_frequency_error, "rad s-1", "standard error of it"),
        "window_damping": (along, found.damping_ratio, "1", "damping ratio in the window"),
        "window_damping_error": (along, found.damping_ratio_error, "1", "standard error of it"),
    }
    return xr.Dataset(described(rows))


def print_decay(console: Terminal, decay: FreeDecay) -> None:
    """Print the estimates of a free decay, its damping laws, its backbone, and the remarks."""
    unit = "" if decay.samples.unit == "1" else f" ({unit_label(decay.samples.unit)})"
    title = (
        f"Free decay of {decay.samples.name}{unit}, amplitude and phase at {decay.samples.reference_time:g} s"
    )
    console.print(decay.verdict, soft_wrap=True)
    law = {} if decay.law is None else {"law": spoken(decay.law.law)}
    print_estimates(console, title, decay.estimates(), METHOD_WORDS | law)
    if decay.choice is not None:
        _print_laws(console, decay.choice, len(decay.samples.time))
    if decay.backbone is not None:
        _print_backbone(console, decay.backbone)
    print_remarks(console, decay.words())


def _print_laws(console: Terminal, choice: LawChoice, samples: int) -> None:
    rows = table(
        f"Damping laws, best first (x'' + w0^2 x = -2 viscous x' - coulomb sign x' - quadratic x' |x'|); "
        f"effective samples {choice.effective_samples:.0f} of {samples}",
        *("<law", ">AIC", ">effective", ">weight", ">rms", "<residual", "<coefficients"),
    )
    lowest = choice.best.aic
    lowest_effective = choice.best.effective_aic(choice.effective_samples)
    for fit, weight in zip(choice.fits, choice.weights(), strict=True):
        known = (
            f"{name} {with_error(one.value, one.standard_error)}"
            for name, one in fit.coefficients.items()
            if name in _TERMS
        )
        verdict = "noise" if fit.test.adequate else "not noise"
        rows.add_row(
            spoken(fit.law),
            f"{fit.aic - lowest:+.1f}" if fit is not choice.best else f"{lowest:.1f}",
            f"{fit.effective_aic(choice.effective_samples) - lowest_effective:+.1f}",
            f"{weight:.3f}",
            f"{fit.test.rms:.4g}",
            verdict if fit.physical else "negative term",
            ", ".join(known),
        )
    console.print(rows)


def _print_backbone(console: Terminal, found: Backbone) -> None:
    rows = table(
        f"Frequency and damping against amplitude, in windows of {found.periods:.3g} periods",
        *(">time (s)", ">amplitude", ">frequency (Hz)", ">+-", ">damping ratio", ">+-"),
    )
    for place in range(len(found.time)):
        frequency = value_and_error(
            found.angular_frequency[place] / (2 * np.pi), found.angular_frequency_error[place] / (2 * np.pi)
        )
        damping = value_and_error(found.damping_ratio[place], found.damping_ratio_error[place])
        rows.add_row(f"{found.time[place]:.6g}", f"{found.amplitude[place]:.4g}", *frequency, *damping)
    console.print(rows)
