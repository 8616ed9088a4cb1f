"""Estimates from impacting motion as tables."""

from __future__ import annotations

import math

from rich.table import Table

from vibroimpact.analysis.estimation.estimates import QUANTITIES, SHOWN, ImpactEstimates, MethodEstimate
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
    table = Table(title=f"{estimates.channel}: estimates with {estimates.confidence:.0%} intervals")
    table.add_column("quantity")
    table.add_column("unit")
    for method in methods:
        table.add_column(method.replace("_", " "), justify="right")
    for quantity in QUANTITIES:
        cells = [estimates.values[method].get(quantity) for method in methods]
        if any(cells):
            words = quantity.replace("_", " ")
            table.add_row(words, written_unit(estimates.unit_of(quantity)), *(_cell(cell) for cell in cells))
    return table


def _cell(estimate: MethodEstimate | None) -> str:
    """Return value and interval with the digits that the doubt leaves."""
    if estimate is None:
        return ""
    if not math.isfinite(estimate.standard_error):
        return f"{estimate.value:.4g}"
    if estimate.standard_error <= 0.0:
        return f"{estimate.value:.6g}"
    place = math.floor(math.log10(estimate.standard_error)) - 1
    if not -12 <= place < 0:
        return f"{estimate.value:.6g} [{estimate.low:.6g}, {estimate.high:.6g}]"
    return f"{estimate.value:.{-place}f} [{estimate.low:.{-place}f}, {estimate.high:.{-place}f}]"


def _conditioning(estimates: ImpactEstimates) -> Table:
    """Return how errors move the estimates."""
    table = Table(title="conditioning: change of the estimate per change of what it rests on")
    table.add_column("sensitivity of the energy balance")
    table.add_column("value", justify="right")
    for name, value in estimates.conditioning.items():
        table.add_row(name.replace("_", " "), f"{value:.4g}")
    return table
