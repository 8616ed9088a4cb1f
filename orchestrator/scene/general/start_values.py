"""Start values of FMU variables: does a value of a scene file fit its variable, and as what is it sent?"""

from __future__ import annotations

import math
import re
from typing import NamedTuple

from vibroimpact.orchestrator.scene.general.component_facts import VariableFacts
from vibroimpact.orchestrator.scene.problems import nearest

StartValue = float | int | bool | str

_INTEGER_TYPE = re.compile(r"(U?)Int([0-9]+)")


class Misfit(NamedTuple):
    """What a variable expects instead of a value, and what to do."""

    expected: str
    hint: str = ""


def typed_value(variable: VariableFacts, value: object) -> StartValue | Misfit:
    """Return a value as its variable takes it: float, int (also for enumerations), bool or str.

    Parameters
    ----------
    variable : VariableFacts
        A scalar variable.
    value : object
        A value of a TOML document; an enumeration takes the name or the number of one of its items.
    """
    if variable.kind == "boolean":
        return value if isinstance(value, bool) else Misfit("true or false")
    if variable.kind == "text":
        return value if isinstance(value, str) else Misfit("text")
    if variable.kind == "enumeration":
        return _item(variable, value)
    return _real(variable, value) if variable.kind == "real" else _integer(variable, value)


def swept_value(variable: VariableFacts, value: float) -> StartValue | Misfit:
    """Return a swept number as its variable takes it."""
    whole = variable.kind != "real" and value.is_integer()
    return typed_value(variable, int(value) if whole else value)


def _real(variable: VariableFacts, value: object) -> StartValue | Misfit:
    expected = Misfit(f"a finite number{_limits(variable)}")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return expected
    try:
        number = float(value)
    except OverflowError:  # TOML's whole numbers have no end
        return expected
    return number if math.isfinite(number) and _is_within(variable, number) else expected


def _integer(variable: VariableFacts, value: object) -> StartValue | Misfit:
    if isinstance(value, bool) or not isinstance(value, int) or not _is_within(variable, value):
        return Misfit(f"a whole number{_limits(variable)}")
    match = _INTEGER_TYPE.fullmatch(variable.type)
    signed, bits = (not match[1], int(match[2])) if match else (True, 32)  # FMI 2.0 Integer
    lowest, highest = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
    return value if lowest <= value <= highest else Misfit(f"a whole number from {lowest} to {highest}")


def _item(variable: VariableFacts, value: object) -> StartValue | Misfit:
    names = {number: name for name, number in variable.items.items()}
    if isinstance(value, str) and value in variable.items:
        return variable.items[value]
    if isinstance(value, int) and not isinstance(value, bool) and value in names:
        return value
    choices = ", ".join(f'"{name}" ({number})' for number, name in names.items())
    hint = nearest(value, variable.items) if isinstance(value, str) else ""
    return Misfit(f"one of {choices}", hint if hint.startswith("Did") else "")


def _is_within(variable: VariableFacts, value: float) -> bool:
    low, high = variable.minimum, variable.maximum
    return (low is None or value >= low) and (high is None or value <= high)


def _limits(variable: VariableFacts) -> str:
    low, high = variable.minimum, variable.maximum
    if low is not None and high is not None:
        return f" from {low:g} to {high:g}"
    if low is not None:
        return f" >= {low:g}"
    return f" <= {high:g}" if high is not None else ""
