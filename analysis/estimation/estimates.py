"""Results of an estimation from impacting motion: one row for each method and quantity, printed or as a dataset."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass, field

import numpy as np
import xarray as xr
from rich.table import Table

from vibroimpact.analysis.dataset.estimate_table import estimate_table
from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.estimation.physics import Floats
from vibroimpact.fmus.messages import joined, message
from vibroimpact.fmus.printing import table, value_and_error
from vibroimpact.fmus.terminal import Terminal
from vibroimpact.fmus.units import written_unit

TABLE = ResultTable(
    "estimates",
    ("impact_time", "impact", "s", "instants of impact"),
    ("time", "time", "s", "time"),
    ("measured", "time", "{unit}", "measured displacement"),
    ("fitted", "time", "{unit}", "displacement fitted by {method}"),
    ("bounce_speed", "bounce", "{speed}", "speed of approach"),
    ("bounce_ratio", "bounce", "1", "ratio of the flights after and before"),
    ("restitution_of_speed", "bounce", "1", "restitution at the speed of the impact"),
    *(
        (f"restitution_of_speed_{end}", "bounce", "1", f"restitution at the speed of the impact, {words}")
        for end, words in (("low", "lower end of the interval"), ("high", "upper end of the interval"))
    ),
)
METHODS = (
    "energy_known_damping",
    "energy_joint",
    "energy_amplitude",
    "weak_form",
    "trajectory",
    "period_one",
)
"""Methods in the order of display; `period_one` gives start values only, without an interval."""

SHOWN = (*METHODS, "flight_times")
"""Methods in the order of tables; `flight_times` is the method for bounces without a force."""

ANSWERING = tuple(name for name in SHOWN if name != "period_one")
"""Methods that give intervals."""

QUANTITIES: Mapping[str, tuple[str, str]] = {
    "restitution": ("1", "coefficient of restitution"),
    "energy_loss_factor": ("1", "restitution if all loss that is not the known damping were at the impact"),
    "damping_ratio": ("1", "damping over critical damping"),
    "natural_frequency": ("rad s-1", "undamped natural angular frequency"),
    "static_deflection": ("channel", "force amplitude over stiffness"),
    "phase": ("rad", "phase of the force at time 0"),
    "angular_frequency": ("rad s-1", "angular frequency of the force on the recording's clock"),
    "stop_position": ("channel", "position of the stop"),
    "offset": ("channel", "reading at rest"),
    "impact_velocity": ("channel s-1", "root mean square speed of approach"),
}
"""Unit (`channel`: the unit of the displacement) and meaning."""


_REASONS_IN_LINE = 2


@dataclass(frozen=True, slots=True)
class MethodEstimate:
    """One number with its uncertainty.

    Attributes
    ----------
    value, standard_error : float
    low, high : float
        Ends of the interval; NaN without an interval.
    """

    value: float
    standard_error: float = np.nan
    low: float = np.nan
    high: float = np.nan

    @classmethod
    def within(cls, value: float, error: float, reach: float) -> MethodEstimate:
        """Return an estimate with an interval symmetric about the value."""
        return cls(value, error, value - reach, value + reach)

    def covers(self, truth: float) -> bool:
        """Tell whether the interval holds a value."""
        return self.low <= truth <= self.high


@dataclass(frozen=True, slots=True)
class Refusal:
    """A method without an answer, and the reason: the message of its EstimationError."""

    method: str
    reason: str


@dataclass(frozen=True, slots=True)
class Doubt:
    """A reason why estimates are unreliable.

    Attributes
    ----------
    reason : str
        Part of a sentence.
    methods : tuple of str
        Methods with this doubt; empty: all.
    """

    reason: str
    methods: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FittedMotion:
    """The measured motion, and the motion that fits it best.

    Attributes
    ----------
    time, measured, fitted : ndarray, shape (sample,)
        Time in s, others in the unit of the channel; NaN where nothing was fitted.
    method : str
        Method of the fitted motion.
    """

    time: Floats
    measured: Floats
    fitted: Floats
    method: str


@dataclass(frozen=True, slots=True)
class RestitutionOfSpeed:
    """A restitution that changes with the speed of approach, at the speeds of the impacts.

    Attributes
    ----------
    speed : ndarray, shape (bounce,)
        Unit of the channel per s.
    single : ndarray, shape (bounce,)
        Ratio at each single impact.
    fitted, low, high : ndarray, shape (bounce,)
        r(v) and the ends of its interval.
    """

    speed: Floats
    single: Floats
    fitted: Floats
    low: Floats
    high: Floats

    def words(self, unit: str) -> str:
        """Return the change of the restitution as a sentence; `unit` is the unit of the channel."""
        slow, fast = int(np.argmin(self.speed)), int(np.argmax(self.speed))
        shown = written_unit(f"{'' if unit == '1' else unit} s-1".strip())
        return (
            f"The restitution changes with the speed of impact: {self.fitted[slow]:.3g} at {self.speed[slow]:.3g} "
            f"{shown}, {self.fitted[fast]:.3g} at {self.speed[fast]:.3g} {shown}"
        )


@dataclass(frozen=True)
class ImpactEstimates:
    """Estimates of all methods from one record of impacting motion.

    Attributes
    ----------
    channel : str
        Name of the displacement.
    unit : str
        Its CF unit.
    values : dict
        Estimates by method, then quantity.
    conditioning : dict
        Sensitivity of an estimate to an error of the data or of a held value (thesis eqs. 4.14 to 4.20), by name.
    facts : dict
        Numbers or words about the record, by name: impacts, flights, window, noise, side, ...
    refusals : tuple of Refusal
    doubts : tuple of Doubt
        Reasons why the estimates of all or of some methods are unreliable.
    remarks : tuple of str
        Remarks for the reader.
    confidence : float
        Confidence of the intervals.
    impact_times : ndarray, shape (impact,)
        s.
    motion : FittedMotion or None
    of_speed : RestitutionOfSpeed or None
        r(v), instead of a single restitution that the data contradict.
    """

    channel: str
    unit: str
    values: Mapping[str, Mapping[str, MethodEstimate]]
    conditioning: Mapping[str, float] = field(default_factory=dict)
    facts: Mapping[str, float | str] = field(default_factory=dict)
    refusals: tuple[Refusal, ...] = ()
    doubts: tuple[Doubt, ...] = ()
    remarks: tuple[str, ...] = ()
    confidence: float = 0.95
    impact_times: Floats = field(default_factory=lambda: np.empty(0))
    motion: FittedMotion | None = None
    of_speed: RestitutionOfSpeed | None = None
    kind: str = "impacts"
    """`impacts`, or `bounces` under a constant force."""

    def reasons(self, method: str) -> list[str]:
        """Return the reasons why the estimates of a method are unreliable."""
        return [doubt.reason for doubt in self.doubts if method in doubt.methods or not doubt.methods]

    @property
    def verdict(self) -> str:
        """One line that says which methods are reliable, which are not, and why."""
        answered = [name for name in ANSWERING if name in self.values]
        reliable = [name for name in answered if not self.reasons(name)]
        unreliable = [name for name in answered if name not in reliable]
        if not answered:
            why = ["no method has an answer", *(doubt.reason for doubt in self.doubts)]
            return message("not sure, because ", _listed(why), ".")
        if not reliable:
            return message("not sure, because ", _listed([doubt.reason for doubt in self.doubts]), ".")
        if not unreliable:
            return f"sure of {_named(reliable)}."
        why = [reason for name in unreliable for reason in self.reasons(name)]
        opening = f"sure of {_named(reliable)}; not sure of {_named(unreliable)}, because "
        return message(opening, _listed(why), ".")

    def unit_of(self, quantity: str) -> str:
        """Return the unit of a quantity; the channel's unit is filled in."""
        unit = QUANTITIES[quantity][0]
        return unit.replace("channel", self.unit if self.unit != "1" else "").strip() or "1"

    def dataset(self) -> xr.Dataset:
        """Return dims estimator and quantity: estimate, standard_error, interval_low, interval_high; measured, fitted.

        Units differ by quantity, so the variables carry `1`, and the coordinate `unit` gives the unit of each quantity.
        Conditioning, facts, refusals and remarks are attributes.
        """
        methods = [name for name in SHOWN if name in self.values]
        quantities = [name for name in QUANTITIES if any(name in self.values[method] for method in methods)]
        cells = {
            method: {name: astuple(one) for name, one in self.values[method].items()} for method in methods
        }
        units = {name: self.unit_of(name) for name in quantities}
        parts = [estimate_table(cells, units, self.confidence), self._motion()]
        return xr.merge(parts, combine_attrs="override").assign_attrs(self._attributes())

    def _motion(self) -> xr.Dataset:
        """Return impacts, the fitted motion, and r(v) over the impacts between two flights, where available."""
        motion, found = self.motion, self.of_speed
        values = {"impact_time": self.impact_times}
        if motion is not None:
            values |= {"measured": motion.measured, "fitted": motion.fitted, "time": motion.time}
        if found is not None:
            values |= {"bounce_speed": found.speed, "bounce_ratio": found.single}
            values |= {"restitution_of_speed": found.fitted}
            values |= {"restitution_of_speed_low": found.low, "restitution_of_speed_high": found.high}
        speed, method = self.unit_of("impact_velocity"), "" if motion is None else motion.method
        return TABLE.dataset(values, unit=self.unit, speed=speed, method=method).set_coords("impact_time")

    def _attributes(self) -> dict[str, str | float]:
        """Return the attributes of the whole table."""
        return {
            "estimates": self.kind,
            "channel": self.channel,
            "confidence": self.confidence,
            "verdict": self.verdict,
            "doubts": joined(
                "\n",
                (message(f"{', '.join(doubt.methods) or 'all'}: ", doubt.reason) for doubt in self.doubts),
            ),
            "remarks": joined("\n", self.remarks),
            "refusals": "\n".join(f"{refusal.method}: {refusal.reason}" for refusal in self.refusals),
            **{f"conditioning_{name}": value for name, value in self.conditioning.items()},
            **self.facts,
        }


def _listed(reasons: Sequence[str]) -> str:
    """Return the most serious reasons in one line."""
    different = list(dict.fromkeys(reasons))
    more = len(different) - _REASONS_IN_LINE
    shown = joined("; ", different[:_REASONS_IN_LINE])
    return message(shown, f"; and {more} more") if more > 0 else shown


def _named(methods: Sequence[str]) -> str:
    return ", ".join(name.replace("_", " ") for name in methods)


def print_impacts(console: Terminal, estimates: ImpactEstimates) -> None:
    """Print the verdict, all methods side by side, the sensitivities, refusals and remarks."""
    console.print(estimates.verdict)
    console.print(_estimates(estimates))
    if estimates.of_speed is not None:
        console.print(_speeds(estimates, estimates.of_speed))
    if estimates.conditioning:
        console.print(_conditioning(estimates))
    for name, value in estimates.facts.items():
        shown = value if isinstance(value, str) else f"{value:.6g}"
        console.print(f"{name.replace('_', ' ')}: {shown}")
    for doubt in estimates.doubts:
        of = f" of {', '.join(doubt.methods)}" if doubt.methods else ""
        console.print(message(f"doubt{of}: ", doubt.reason))
    for refusal in estimates.refusals:
        console.print(f"refused: {refusal.reason}")
    for remark in estimates.remarks:
        console.print(message("note: ", remark))


def _estimates(estimates: ImpactEstimates) -> Table:
    """Return a block of methods for each quantity; columns side by side for all methods would be unreadable."""
    title = f"{estimates.channel}: estimates with {estimates.confidence:.0%} intervals"
    rows = table(title, "<quantity", "<method", ">estimate", ">from", ">to", "<unit")
    for quantity in QUANTITIES:
        words, unit = quantity.replace("_", " "), written_unit(estimates.unit_of(quantity))
        for method in SHOWN:
            found = estimates.values.get(method, {}).get(quantity)
            if found is not None:
                rows.add_row(words, method.replace("_", " "), *_cells(found), unit)
                words = unit = ""
        if not words:
            rows.add_section()
    return rows


def _speeds(estimates: ImpactEstimates, found: RestitutionOfSpeed) -> Table:
    """Return the restitution at the speed of each impact."""
    unit = written_unit(estimates.unit_of("impact_velocity"))
    rows = table("restitution against speed", f">speed ({unit})", ">one impact", ">r(v)", ">from", ">to")
    for cells in zip(found.speed, found.single, found.fitted, found.low, found.high, strict=True):
        rows.add_row(*(f"{cell:.4g}" for cell in cells))
    return rows


def _cells(estimate: MethodEstimate) -> tuple[str, str, str]:
    """Return value and interval with the digits that the standard error allows."""
    if not math.isfinite(estimate.standard_error):
        return f"{estimate.value:.4g}", "", ""
    ends = (estimate.value, estimate.low, estimate.high)
    value, low, high = (value_and_error(end, estimate.standard_error)[0] for end in ends)
    return (value, low, high) if estimate.standard_error > 0.0 else (value, "", "")


def _conditioning(estimates: ImpactEstimates) -> Table:
    """Return the table of the sensitivities of the estimates."""
    title = "conditioning: change of the estimate per change of what it rests on"
    rows = table(title, "<sensitivity of the energy balance", ">value")
    for name, value in estimates.conditioning.items():
        rows.add_row(name.replace("_", " "), f"{value:.4g}")
    return rows
