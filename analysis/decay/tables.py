"""Estimates as tables that people read."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from vibroimpact.analysis.decay.estimate import Estimate
from vibroimpact.analysis.decay.free_decay import FreeDecay
from vibroimpact.analysis.decay.laws import spoken
from vibroimpact.analysis.recording.units import unit_label
from vibroimpact.fmus.terminal import Terminal

_ROUNDING = 1e-9
"""Relative errors below this are not of the data, but of the arithmetic."""

METHOD_WORDS = {
    "decrement": "logarithmic decrement",
    "exponential": "decaying cosine",
    "law": "best damping law",
    "response": "frequency response",
    "half_power": "half-power bandwidth",
}


def shown(value: float, error: float) -> tuple[str, str]:
    """Return value and standard error with as many digits as the error allows: two of its own.

    >>> shown(0.00556754, 0.0000610394)
    ('0.005568', '0.000061')
    >>> shown(438.6585, 0.02306)
    ('438.659', '0.023')
    """
    if not (np.isfinite(error) and error > 0.0):
        return f"{value:.6g}", "-"
    size = abs(value) if value else 1.0
    if error < _ROUNDING * size:
        return f"{value:.12g}", f"< {_ROUNDING * size:.0e}"
    place = 1 - int(np.floor(np.log10(error)))
    if place > 12 or place < -6 or size < 1e-4:
        digits = max(1, min(15, int(np.floor(np.log10(size))) + place))
        return f"{value:.{digits}e}", f"{error:.1e}"
    return f"{value:.{max(place, 0)}f}", f"{error:.{max(place, 0)}f}"


def _table(title: str, columns: Mapping[str, str]) -> Table:
    table = Table(title=title, box=SIMPLE_HEAD, title_justify="left")
    for name, justify in columns.items():
        # rich wants literals, which values of a dict are not
        table.add_column(name, justify=justify, no_wrap=name != "coefficients")  # type: ignore[arg-type]
    return table


def print_estimates(
    console: Terminal,
    title: str,
    estimates: Mapping[str, Mapping[str, Estimate]],
    names: Mapping[str, str] = METHOD_WORDS,
) -> None:
    """Print all methods side by side: one row for each quantity and method, with the name of the method."""
    table = _table(
        title,
        {"quantity": "left", "method": "left", "value": "right", "std. error": "right"}
        | {"95 % interval": "center", "unit": "left"},
    )
    quantities = list(dict.fromkeys(name for found in estimates.values() for name in found))
    for quantity in quantities:
        for method, found in estimates.items():
            if quantity in found:
                estimate = found[quantity]
                value, error = shown(estimate.value, estimate.standard_error)
                interval = "-"
                if error != "-":
                    low, high = (shown(end, estimate.standard_error)[0] for end in estimate.interval)
                    interval = f"{low} .. {high}"
                row = quantity.replace("_", " "), names.get(method, method), value, error, interval
                table.add_row(*row, unit_label(estimate.unit))
    console.print(table)


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
    table = _table(
        f"Damping laws, best first (x'' + w0^2 x = -2 viscous x' - coulomb sign x' - quadratic x' |x'|); "
        f"effective samples {choice.effective_samples:.0f} of {len(decay.samples.time)}",
        {"law": "left", "AIC": "right", "effective": "right", "weight": "right", "rms": "right"}
        | {"residual": "left", "coefficients": "left"},
    )
    lowest = choice.best.aic
    lowest_effective = choice.best.effective_aic(choice.effective_samples)
    for fit, weight in zip(choice.fits, choice.weights(), strict=True):
        parts = []
        for term in (*fit.law.terms, "cubic"):
            if term in fit.coefficients:
                known = fit.coefficients[term]
                parts.append(f"{term} {known.value:.4g} +- {known.standard_error:.1g}")
        verdict = "noise" if fit.test.adequate else "not noise"
        table.add_row(
            spoken(fit.law),
            f"{fit.aic - lowest:+.1f}" if fit is not choice.best else f"{lowest:.1f}",
            f"{fit.effective_aic(choice.effective_samples) - lowest_effective:+.1f}",
            f"{weight:.3f}",
            f"{fit.test.rms:.4g}",
            verdict if fit.physical else "negative term",
            ", ".join(parts),
        )
    console.print(table)


def _print_backbone(console: Terminal, decay: FreeDecay) -> None:
    assert decay.backbone is not None
    found = decay.backbone
    table = _table(
        f"Frequency and damping against amplitude, in windows of {found.periods:.3g} periods",
        {"time (s)": "right", "amplitude": "right", "frequency (Hz)": "right", "+-": "right"}
        | {"damping ratio": "right", "+- ": "right"},
    )
    for place in range(len(found.time)):
        frequency = shown(
            found.angular_frequency[place] / (2 * np.pi), found.angular_frequency_error[place] / (2 * np.pi)
        )
        damping = shown(found.damping_ratio[place], found.damping_ratio_error[place])
        table.add_row(f"{found.time[place]:.6g}", f"{found.amplitude[place]:.4g}", *frequency, *damping)
    console.print(table)
