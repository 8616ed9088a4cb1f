"""Do the units at the two ends of a connection agree?

Units come from the model descriptions, as exponents of FMI's base units with a factor and an offset, never by
comparing names; the unit of a gain is written in the scene, as a product of SI symbols.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

#: FMI's base units; rad is one of them, so that angles are told from plain numbers.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
#: Descriptions write factors such as pi / 180 in decimals.
FACTOR_TOLERANCE = 1e-9

_SYMBOLS: dict[str, tuple[dict[str, int], float]] = {
    **{base: ({base: 1}, 1.0) for base in BASE_UNITS},
    "g": ({"kg": 1}, 1e-3),
    "N": ({"kg": 1, "m": 1, "s": -2}, 1.0),
    "J": ({"kg": 1, "m": 2, "s": -2}, 1.0),
    "W": ({"kg": 1, "m": 2, "s": -3}, 1.0),
    "Pa": ({"kg": 1, "m": -1, "s": -2}, 1.0),
    "Hz": ({"s": -1}, 1.0),
    "C": ({"A": 1, "s": 1}, 1.0),
    "V": ({"kg": 1, "m": 2, "s": -3, "A": -1}, 1.0),
    "Ohm": ({"kg": 1, "m": 2, "s": -3, "A": -2}, 1.0),
    "S": ({"kg": -1, "m": -2, "s": 3, "A": 2}, 1.0),
    "F": ({"kg": -1, "m": -2, "s": 4, "A": 2}, 1.0),
    "H": ({"kg": 1, "m": 2, "s": -2, "A": -2}, 1.0),
    "T": ({"kg": 1, "s": -2, "A": -1}, 1.0),
    "Wb": ({"kg": 1, "m": 2, "s": -2, "A": -1}, 1.0),
    "deg": ({"rad": 1}, math.pi / 180.0),
    "min": ({"s": 1}, 60.0),
    "h": ({"s": 1}, 3600.0),
}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
_WITHOUT_PREFIX = frozenset({"kg", "deg", "min", "h"})
_FACTOR = re.compile(r"([A-Za-z]+)(-?[1-9][0-9]?)?")
_LONGEST_TEXT = 100


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: value in base units = factor * value + offset.

    Attributes
    ----------
    name : str
        As it was written.
    exponents : tuple of int
        Exponents of `BASE_UNITS`, in their order.
    factor, offset : float
        Size of the unit in base units, and where its zero is.
    """

    name: str
    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0


def unit_of(name: str, exponents: dict[str, int], factor: float = 1.0, offset: float = 0.0) -> Unit:
    """Return a unit from the exponents of its base units; absent ones are 0."""
    return Unit(name, tuple(exponents.get(base, 0) for base in BASE_UNITS), factor, offset)


def parse_unit(text: str) -> Unit | None:
    """Read a unit written as a product of SI symbols; None when it is not one.

    Factors are joined by dots, exponents follow their symbol, each slash divides by the one factor or the
    one parenthesis behind it; `1` is the unit of a plain number. The prefixes n, u, m, c, k, M, G are known.

    Examples
    --------
    >>> parse_unit("kg.m2/s2") == Unit("kg.m2/s2", (1, 2, -2, 0, 0, 0, 0, 0))
    True
    >>> parse_unit("W/(m2.K)").exponents
    (1, 0, -3, 0, -1, 0, 0, 0)
    >>> parse_unit("N/m.s") is None  # read by some as N/(m.s)
    True
    """
    if len(text) > _LONGEST_TEXT:
        return None
    numerator, *divisors = text.split("/")
    product = _product(numerator)
    for written in divisors:
        enclosed = written.startswith("(") and written.endswith(")")
        divisor = _product(written[1:-1]) if enclosed else _factor(written)
        if product is None or divisor is None:
            return None
        product = _combined(product, divisor, -1)
    return product and Unit(text, product.exponents, product.factor)


def agree(one: Unit, other: Unit) -> bool:
    """Whether a number means the same in both units, whatever their names."""
    return (
        one.exponents == other.exponents
        and math.isclose(one.factor, other.factor, rel_tol=FACTOR_TOLERANCE)
        and math.isclose(one.offset, other.offset, rel_tol=FACTOR_TOLERANCE, abs_tol=FACTOR_TOLERANCE)
    )


def product_agrees(source: Unit, gain: Unit, target: Unit) -> bool:
    """Whether source times gain is target; units whose zero is elsewhere (degC) have no products."""
    if source.offset or target.offset:
        return False
    return agree(_combined(source, gain, 1), target)


def gain_unit_between(source: Unit, target: Unit) -> str | None:
    """Return a unit that a gain from one unit to the other can be written in; None where there is none.

    Examples
    --------
    >>> metre, speed, newton = map(parse_unit, ("m", "m/s", "N"))
    >>> gain_unit_between(metre, newton), gain_unit_between(speed, newton)
    ('N/m', 'kg/s')
    """
    ratio = _combined(target, source, -1)
    divisor = f"({source.name})" if "." in source.name else source.name
    for text in (f"{target.name}/{divisor}", _in_base_units(ratio.exponents)):
        unit = parse_unit(text)
        if unit and text.count("/") <= 1 and product_agrees(source, unit, target):
            return text
    return None


def _in_base_units(exponents: Iterable[int]) -> str:
    powers = list(zip(BASE_UNITS, exponents, strict=True))
    above = ".".join(_power(base, power) for base, power in powers if power > 0)
    below = [_power(base, -power) for base, power in powers if power < 0]
    divisor = f"({'.'.join(below)})" if len(below) > 1 else "".join(below)
    return f"{above or '1'}/{divisor}" if divisor else above or "1"


def _power(base: str, power: int) -> str:
    return base if power == 1 else f"{base}{power}"


def _product(text: str) -> Unit | None:
    product: Unit | None = unit_of("1", {})
    for written in text.split("."):
        factor = _factor(written)
        product = product and factor and _combined(product, factor, 1)
    return product


def _factor(text: str) -> Unit | None:
    if text == "1":
        return unit_of("1", {})
    match = _FACTOR.fullmatch(text)
    symbol = _symbol(match[1]) if match else None
    if match is None or symbol is None:
        return None
    return _combined(unit_of("1", {}), symbol, int(match[2] or 1))


def _symbol(text: str) -> Unit | None:
    if text in _SYMBOLS:
        return unit_of(text, *_SYMBOLS[text])
    prefix, bare = text[:1], text[1:]
    if prefix not in _PREFIXES or bare not in _SYMBOLS or bare in _WITHOUT_PREFIX:
        return None
    exponents, factor = _SYMBOLS[bare]
    return unit_of(text, exponents, factor * _PREFIXES[prefix])


def _combined(unit: Unit, other: Unit, power: int) -> Unit:
    """Return unit * other^power."""
    exponents = tuple(a + power * b for a, b in zip(unit.exponents, other.exponents, strict=True))
    return Unit("", exponents, unit.factor * other.factor**power)
