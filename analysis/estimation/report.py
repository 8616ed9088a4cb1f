"""Estimates from impacting motion as tables."""

from __future__ import annotations

import math

from rich.table import Table

from vibroimpact.analysis.estimation.estimates import QUANTITIES, SHOWN, ImpactEstimates, MethodEstimate
from vibroimpact.fmus.printing import table, value_and_error
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.fmus.units import written_unit


def print_impacts(console: Terminal, estimates: ImpactEstimates) -> None:
    """Print the verdict, all methods side by side, how far errors move the estimates, refusals and remarks."""
    console.print(estimates.verdict)
    console.print(_estimates(estimates))
    if estimates.conditioning:
        console.print(_conditioning(estimates))
    for name, value in estimates.facts.items():
        shown = value if isinstance(value, str) else f"{value:.6g}"
        console.print(f"{name.replace('_', ' ')}: {shown}")
    for doubt in estimates.doubts:
        of = f" of {', '.join(doubt.methods)}" if doubt.methods else ""
        console.print(f"doubt{of}: {doubt.reason}")
    for refusal in estimates.refusals:
        console.print(f"refused: {refusal.reason}")
    for remark in estimates.remarks:
        console.print(f"note: {remark}")


def _estimates(estimates: ImpactEstimates) -> Table:
    """Return quantities by methods."""
    methods = [name for name in SHOWN if name in estimates.values]
    title = f"{estimates.channel}: estimates with {estimates.confidence:.0%} intervals"
    rows = table(title, "<quantity", "<unit", *(f">{method.replace('_', ' ')}" for method in methods))
    for quantity in QUANTITIES:
        cells = [estimates.values[method].get(quantity) for method in methods]
        if any(cells):
            words = quantity.replace("_", " ")
            rows.add_row(words, written_unit(estimates.unit_of(quantity)), *(_cell(cell) for cell in cells))
    return rows


def _cell(estimate: MethodEstimate | None) -> str:
    """Return value and interval with the digits that the doubt leaves."""
    if estimate is None:
        return ""
    if not math.isfinite(estimate.standard_error):
        return f"{estimate.value:.4g}"
    ends = (estimate.value, estimate.low, estimate.high)
    value, low, high = (value_and_error(end, estimate.standard_error)[0] for end in ends)
    return f"{value} [{low}, {high}]" if estimate.standard_error > 0.0 else value


def _conditioning(estimates: ImpactEstimates) -> Table:
    """Return how errors move the estimates."""
    title = "conditioning: change of the estimate per change of what it rests on"
    rows = table(title, "<sensitivity of the energy balance", ">value")
    for name, value in estimates.conditioning.items():
        rows.add_row(name.replace("_", " "), f"{value:.4g}")
    return rows
