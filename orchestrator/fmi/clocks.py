"""Input clocks of an FMU of FMI 3.0: clocks that tick at known instants, and other clocks."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING

from vibroimpact.fmus.safe_xml import root_of

if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, ModelVariable

#: Variabilities of an interval that is known before a run: from the description, or from the FMU at initialization.
CONSTANT, FIXED = "constant", "fixed"


@dataclass(frozen=True, slots=True)
class InputClock:
    """An input clock that ticks at its start, and then at multiples of its interval.

    Attributes
    ----------
    name, reference
        Its name and value reference.
    interval : Fraction or None
        Time between two ticks, s, > 0; None: the FMU gives it at initialization (FMI 3.0, 2.2.8.3).
    shift : Fraction
        Time from the start of a run to the first tick, s, >= 0.
    """

    name: str
    reference: int
    interval: Fraction | None
    shift: Fraction = Fraction(0)


def clocks_of(description: ModelDescription, folder: Path) -> tuple[tuple[InputClock, ...], tuple[str, ...]]:
    """Return the input clocks of an FMU that can tick, and a description of each other clock."""
    clocks = [variable for variable in description.modelVariables if variable.type == "Clock"]
    if not clocks:
        return (), ()
    attributes = _attributes(folder)
    found: list[InputClock] = []
    others: list[str] = []
    for variable in clocks:
        own = attributes.get(variable.name, {})
        variability = own.get("intervalVariability", "")
        if variable.causality != "input" or variability not in (CONSTANT, FIXED):
            others.append(f"the {variability} {variable.causality} clock {variable.name}")
            continue
        clock = _input_clock(variable, own)
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


def _input_clock(variable: ModelVariable, own: dict[str, str]) -> InputClock | None:
    """Return a clock; None if its numbers are invalid."""
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
    return InputClock(variable.name, int(variable.valueReference), interval, shift)


def _number(text: str) -> Fraction | None:
    """Return a finite number in the notation of XML, else None."""
    return Fraction(text.strip()) if math.isfinite(float(text)) else None
