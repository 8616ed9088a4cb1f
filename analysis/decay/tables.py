"""Estimates as tables that people read."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.free_decay import FreeDecay
from vibroimpact.analysis.decay.laws import spoken
from vibroimpact.analysis.recording.units import unit_label
from vibroimpact.fmus.printing import table, value_and_error, with_error
from vibroimpact.fmus.terminal import Terminal

METHOD_WORDS = {
    "decrement": "logarithmic decrement",
    "exponential": "decaying cosine",
    "law": "best damping law",
    "response": "frequency response",
    "half_power": "half-power bandwidth",
}


def print_estimates(
    console: Terminal,
    title: str,
    estimates: Mapping[str, Mapping[str, Estimate]],
    names: Mapping[str, str] = METHOD_WORDS,
) -> None:
    """Print all methods side by side: one row for each quantity and method, with the name of the method."""
    rows = table(title, "<quantity", "<method", ">value", ">std. error", ">95 % interval", "<unit")
    quantities = list(dict.fromkeys(name for found in estimates.values() for name in found))
    for quantity in quantities:
        for method, found in estimates.items():
            if quantity in found:
                estimate = found[quantity]
                value, error = value_and_error(estimate.value, estimate.standard_error)
                interval = "-"
                if error != "-":
                    low, high = (
                        value_and_error(end, estimate.standard_error)[0] for end in estimate.interval
                    )
                    interval = f"{low} .. {high}"
                row = quantity.replace("_", " "), names.get(method, method), value, error, interval
                rows.add_row(*row, unit_label(estimate.unit))
    console.print(rows)


def print_remarks(console: Terminal, remarks: tuple[str, ...]) -> None:
    """Print remarks, one line each."""
    for remark in remarks:
        console.print(f"- {remark}", soft_wrap=True)


def print_decay(console: Terminal, decay: FreeDecay) -> None:
    """Print the estimates of a free decay, its damping laws, its backbone, and the remarks."""
    unit = "" if decay.samples.unit == "1" else f" ({unit_label(decay.samples.unit)})"
    title = (
        f"Free decay of {decay.samples.name}{unit}, amplitude and phase at {decay.samples.reference_time:g} s"
    )
    law = {} if decay.choice is None else {"law": spoken(decay.choice.best.law)}
    print_estimates(console, title, decay.estimates(), METHOD_WORDS | law)
    if decay.choice is not None:
        _print_laws(console, decay)
    if decay.backbone is not None:
        _print_backbone(console, decay)
    print_remarks(console, decay.words())


def _print_laws(console: Terminal, decay: FreeDecay) -> None:
    assert decay.choice is not None
    choice = decay.choice
    rows = table(
        f"Damping laws, best first (x'' + w0^2 x = -2 viscous x' - coulomb sign x' - quadratic x' |x'|); "
        f"effective samples {choice.effective_samples:.0f} of {len(decay.samples.time)}",
        *("<law", ">AIC", ">effective", ">weight", ">rms", "<residual", "<coefficients"),
    )
    lowest = choice.best.aic
    lowest_effective = choice.best.effective_aic(choice.effective_samples)
    for fit, weight in zip(choice.fits, choice.weights(), strict=True):
        parts = []
        for term in (*fit.law.terms, "cubic"):
            if term in fit.coefficients:
                known = fit.coefficients[term]
                parts.append(f"{term} {with_error(known.value, known.standard_error)}")
        verdict = "noise" if fit.test.adequate else "not noise"
        rows.add_row(
            spoken(fit.law),
            f"{fit.aic - lowest:+.1f}" if fit is not choice.best else f"{lowest:.1f}",
            f"{fit.effective_aic(choice.effective_samples) - lowest_effective:+.1f}",
            f"{weight:.3f}",
            f"{fit.test.rms:.4g}",
            verdict if fit.physical else "negative term",
            ", ".join(parts),
        )
    console.print(rows)


def _print_backbone(console: Terminal, decay: FreeDecay) -> None:
    assert decay.backbone is not None
    found = decay.backbone
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
