"""A number with its standard error; such numbers as a dataset, and as a printed table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import xarray as xr

from vibroimpact.analysis.dataset.estimate_table import estimate_table
from vibroimpact.analysis.recording.units import unit_label
from vibroimpact.fmus.messages import message
from vibroimpact.fmus.printing import table, value_and_error
from vibroimpact.fmus.terminal import Terminal

CONFIDENCE = 0.95
METHOD_WORDS = {
    "decrement": "logarithmic decrement",
    "exponential": "decaying cosine",
    "law": "best damping law",
    "response": "frequency response",
    "half_power": "half-power bandwidth",
}


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value, its standard error and the degrees of freedom behind the error.

    Attributes
    ----------
    value, standard_error : float
        In `unit`.
    unit : str
        CF unit.
    degrees_of_freedom : float
        Degrees of freedom of the residual from which the standard error was computed.
    """

    value: float
    standard_error: float
    unit: str = "1"
    degrees_of_freedom: float = float("inf")

    @property
    def interval(self) -> tuple[float, float]:
        """Limits of the 95 % confidence interval, by Student's t.

        >>> low, high = Estimate(2.0, 0.1).interval
        >>> round(low, 3), round(high, 3)
        (1.804, 2.196)
        """
        from scipy.stats import t as student

        half = float(student.ppf(0.5 + CONFIDENCE / 2, self.degrees_of_freedom)) * self.standard_error
        return self.value - half, self.value + half


def verdict_of(doubts: Sequence[str]) -> str:
    """Return one line that says whether estimates are reliable, and why not.

    >>> verdict_of([]), verdict_of(["the record is short"])
    ('sure.', 'not sure, because the record is short.')
    """
    return f"not sure, because {'; '.join(doubts)}." if doubts else "sure."


def verdict_by_method(doubts: Mapping[str, Sequence[str]]) -> str:
    """Return one line with the reliable methods, the unreliable methods, and the reasons.

    >>> verdict_by_method({"decrement": ["it is bent"], "law": []})
    'sure of best damping law; not sure of logarithmic decrement, because it is bent.'
    """
    reliable = ", ".join(METHOD_WORDS[name] for name, reasons in doubts.items() if not reasons)
    unreliable = ", ".join(METHOD_WORDS[name] for name, reasons in doubts.items() if reasons)
    reasons = list(dict.fromkeys(reason for several in doubts.values() for reason in several))
    if not reliable or not unreliable:
        return f"sure of {reliable}." if reliable else verdict_of(reasons)
    return f"sure of {reliable}; not sure of {unreliable}, because {'; '.join(reasons)}."


def table_of(estimates: Mapping[str, Mapping[str, Estimate]]) -> xr.Dataset:
    """Return estimates on the dimensions method and quantity, see `estimate_table`."""
    units = {name: item.unit for found in estimates.values() for name, item in found.items()}
    cells = {
        method: {name: (item.value, item.standard_error, *item.interval) for name, item in found.items()}
        for method, found in estimates.items()
    }
    return estimate_table(cells, units, CONFIDENCE)


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
                rows.add_row(quantity.replace("_", " "), names[method], *_cells(found[quantity]))
    console.print(rows)


def _cells(estimate: Estimate) -> tuple[str, str, str, str]:
    value, error = value_and_error(estimate.value, estimate.standard_error)
    low, high = (value_and_error(end, estimate.standard_error)[0] for end in estimate.interval)
    return value, error, "-" if error == "-" else f"{low} .. {high}", unit_label(estimate.unit)


def print_remarks(console: Terminal, remarks: tuple[str, ...]) -> None:
    """Print remarks, one line each."""
    for remark in remarks:
        console.print(message("- ", remark), soft_wrap=True)
