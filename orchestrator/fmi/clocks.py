"""The clocks of an FMU of FMI 3.0, as its description declares them (FMI 3.0, 2.2.8.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from vibroimpact.fmus.safe_xml import root_of

if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, ModelVariable

CONSTANT, FIXED, TUNABLE, CHANGING, COUNTDOWN, TRIGGERED = (
    *("constant", "fixed", "tunable"),
    *("changing", "countdown", "triggered"),
)
#: Variabilities of an interval between ticks: of equal intervals, and of intervals that the FMU gives one by one.
PERIODIC, APERIODIC = (CONSTANT, FIXED, TUNABLE), (CHANGING, COUNTDOWN)


@dataclass(frozen=True, slots=True)
class Clock:
    """A clock.

    Attributes
    ----------
    name, reference
        Its name and value reference.
    variability : str
        FMI's word for its interval.
    is_input : bool
        The importer lets it tick; other clocks tick by themselves, and the importer reads them.
    interval : Fraction or None
        Time between two ticks, s, > 0; None: the FMU gives it.
    shift : Fraction
        Time from the start of a run to the first tick, s, >= 0.
    gates : frozenset of int
        Value references of the clocks at whose ticks alone it can be read; empty: at any event.
    """

    name: str
    reference: int
    variability: str
    is_input: bool = True
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)
    gates: frozenset[int] = frozenset()

    @property
    def is_timed(self) -> bool:
        """Does it tick at instants that the importer knows before?"""
        return self.variability != TRIGGERED

    @property
    def is_periodic(self) -> bool:
        """Does it tick at equal intervals?"""
        return self.variability in PERIODIC


def clocks_of(description: ModelDescription, folder: Path) -> tuple[tuple[Clock, ...], tuple[str, ...]]:
    """Return the clocks of an FMU that can tick, and a description of each other clock."""
    clocks = [variable for variable in description.modelVariables if variable.type == "Clock"]
    if not clocks:
        return (), ()
    attributes = _attributes(folder)
    found: list[Clock] = []
    others: list[str] = []
    for variable in clocks:
        own = attributes.get(variable.name, {})
        variability = own.get("intervalVariability", "")
        kinds = (*PERIODIC, *APERIODIC, TRIGGERED) if variable.causality == "input" else (TRIGGERED,)
        if variability not in kinds or variable.causality not in ("input", "output", "local"):
            others.append(f"the {variability} {variable.causality} clock {variable.name}")
            continue
        clock = _clock(variable, own, variability)
        if clock is None or (clock.interval is None and variability == CONSTANT):
            others.append(f"the input clock {variable.name} without an interval > 0 and a shift >= 0")
        else:
            found.append(clock)
    return tuple(found), tuple(others)


def _attributes(folder: Path) -> dict[str, dict[str, str]]:
    """Return the attributes of each clock by its name; FMPy refuses clocks of declared types."""
    root = root_of((folder / "modelDescription.xml").read_bytes(), "modelDescription.xml")
    return {
        element.get("name", ""): dict(element.attrib) for element in root.iterfind("ModelVariables/Clock")
    }


def _clock(variable: ModelVariable, own: dict[str, str], variability: str) -> Clock | None:
    """Return a clock; None if its numbers are invalid."""
    interval, shift = None, Fraction(0)
    if variability in PERIODIC:  # other clocks have neither
        resolution = own.get("resolution")
        parts = {"interval": own.get("intervalDecimal"), "shift": own.get("shiftDecimal")}
        numbers = {name: None if text is None else _number(text) for name, text in parts.items()}
        if resolution is not None and int(resolution) > 0:  # exact, as the decimal number is rounded
            for name in parts:
                if f"{name}Counter" in own:
                    numbers[name] = Fraction(int(own[f"{name}Counter"]), int(resolution))
        if any(numbers[name] is None and text is not None for name, text in parts.items()):
            return None
        interval, shift = numbers["interval"], numbers["shift"] or Fraction(0)
        if shift < 0 or (interval is not None and interval <= 0):
            return None
    gates = frozenset(int(clock.valueReference) for clock in variable.clocks or ())
    is_input = variable.causality == "input"
    return Clock(variable.name, int(variable.valueReference), variability, is_input, interval, shift, gates)


def _number(text: str) -> Fraction | None:
    """Return a finite number in the notation of XML, else None."""
    return Fraction(text.strip()) if math.isfinite(float(text)) else None
