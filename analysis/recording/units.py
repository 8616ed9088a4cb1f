"""Units of measured channels: their labels in files, their CF names, and their factors to SI.

Only this module calls pint. The label `g` of a channel means gravity, the unit of accelerometers, never grams.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.units import written_unit

if TYPE_CHECKING:
    import pint

# Labels that instruments write, with pint's names; `g` and `G` are gravity here.
_LABELS = {
    **dict.fromkeys(("", "1", "-", "au", "a.u.", "counts"), "dimensionless"),
    **dict.fromkeys(("g", "G", "gn", "g0"), "standard_gravity"),
    **dict.fromkeys(("volts", "Volts"), "volt"),
    "Amps": "ampere",
    # thousandths of an inch; pint's mil is one of an angle
    **dict.fromkeys(("mil", "mils", "thou"), "thou"),
    # strain
    **dict.fromkeys(("µε", "με", "µstrain", "ustrain", "microstrain"), "1e-6"),
}
_OFFSET_LABELS = ("degC", "deg C", "°C", "Celsius", "degree_Celsius")
# Preferred SI names, as CF (UDUNITS) writes them.
_SI_NAMES = ("N", "Pa", "V", "J", "W", "N s", "N m", "N m-1", "V s2 m-1", "V N-1", "Hz", "rad", "rad s-1")
_DEGREES = re.compile(r"°(?![A-Za-z])")
_DETECTED = re.compile(r"(?P<unit>\S.*?)(?:\s+|(?<=[VAgG²2]))(?:RMS|rms|Rms|pk|pk-pk|p-p|pp|peak)")
"""A unit, and the kind of reading of the instrument (RMS, peak); the size of the unit does not change."""
_LONGEST_DETECTED = 60
_LONGEST_LABEL = 200
"""Characters above which a label is no unit: a product is read factor by factor, each as long as the rest."""
_SUPERSCRIPTS = str.maketrans("¹²³⁻", "123-")
_FACTOR = re.compile(
    r"(?:(?P<number>\d{1,16}(?:\.\d{0,18})?(?:[eE][-+]?\d{1,2})?)|(?P<name>[A-Za-zµμΩ_%]{1,30}))"
    r"(?:(?:\*\*|\^)?(?P<power>[-+]?[1-9]))?(?P<joint>\s*[*/·]\s*|\s+|$)"
)


@dataclass(frozen=True, slots=True)
class MeasuredUnit:
    """A unit of a channel."""

    label: str
    """The label in the file, or as the user wrote it."""
    cf: str
    """The stored form: an SI unit that CF (UDUNITS) reads, with a factor if it is not SI: `9.80665 m s-2`."""
    si: str
    """The SI unit, as CF writes it: `m s-2`."""
    factor: float
    """SI value of one of this unit."""


def unit_label(cf: str) -> str:
    """Return a unit as people write it after a number, see `fmus.units.written_unit`.

    >>> unit_label("9.80665 m s-2"), unit_label("0.001 m"), unit_label("1")
    ('g', 'mm', '1')
    """
    return cf if cf == "1" else written_unit(cf)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry[float]:
    import pint

    return pint.UnitRegistry()


@lru_cache(maxsize=256)
def measured_unit(label: str) -> MeasuredUnit:
    """Return the unit that a label stands for.

    Parameters
    ----------
    label : str
        `g`, `m/s^2`, `mV`, `N`, `lbf`, `deg`, `9.80665 m s-2`, ...; empty or `1` for a pure number.

    Raises
    ------
    DatasetError
        The unit is unknown.

    Examples
    --------
    >>> measured_unit("g").cf, measured_unit("g").factor
    ('9.80665 m s-2', 9.80665)
    >>> measured_unit("mV").cf, measured_unit("m/s^2").cf, measured_unit("m s-2").cf
    ('0.001 V', 'm s-2', 'm s-2')
    >>> measured_unit("g RMS").factor, measured_unit("°/s").si, measured_unit("µε").cf
    (9.80665, 'rad s-1', '1e-06 1')
    """
    import pint

    if len(label) > _LONGEST_LABEL:
        raise _unknown(label)
    text = _DEGREES.sub("deg", label.strip().translate(_SUPERSCRIPTS))
    detected = _DETECTED.fullmatch(text) if len(text) <= _LONGEST_DETECTED else None
    if detected is not None:
        text = detected["unit"]
    if text in _OFFSET_LABELS:
        return MeasuredUnit(label, "degree_Celsius", "degree_Celsius", 1.0)
    try:
        base = _product(_LABELS.get(text, text)).to_base_units()
        factor, si = float(base.magnitude), _si_name(base)
        cf = si if factor == 1.0 else f"{factor:.15g} {si}"
        _refuse_another(base, cf)
    except (
        pint.PintError,
        AssertionError,
        TypeError,
        ValueError,
        AttributeError,
        ArithmeticError,
    ) as problem:
        raise _unknown(label) from problem
    return MeasuredUnit(label, cf, si, factor)


def _refuse_another(base: Any, cf: str) -> None:
    """Raise ValueError unless the CF unit reads back as the same unit; very large and half powers do not."""
    again = _product(cf).to_base_units()
    if again.units != base.units or not math.isclose(again.magnitude, base.magnitude, rel_tol=1e-12):
        raise ValueError(cf)


def _unknown(label: str) -> DatasetError:
    return DatasetError(
        f"unit: expected a unit such as m/s^2, g, V, mV or N, got {label[:60]!r}. "
        "Give the channel's unit yourself."
    )


def _product(text: str) -> Any:
    """Return the quantity of a product of powers of units; nothing else of pint's expressions is evaluated."""
    quantity: Any = _registry().Quantity(1.0, "dimensionless")
    sign, rest = 1, text
    while rest:
        match = _FACTOR.match(rest)
        if match is None:
            raise ValueError(rest)
        number, name, power = match["number"], match["name"], int(match["power"] or 1)
        quantity = quantity * (float(number) if number else _registry().Quantity(1.0, name)) ** (sign * power)
        rest = rest[match.end() :]
        sign = -1 if match["joint"].strip() == "/" else 1
    return quantity


def _si_name(base: Any) -> str:
    """Return the CF name of a quantity in SI base units."""
    if base.unitless and not str(base.units).startswith("rad"):
        return "1"
    for name in _SI_NAMES:
        trial = _product(name).to_base_units()
        if trial.units == base.units and trial.magnitude == 1.0:
            return name
    powers = ((f"{_registry().Unit(name):~}", int(power)) for name, power in base.unit_items())
    return " ".join(name if power == 1 else f"{name}{power}" for name, power in powers)
