"""Units as products of SI symbols: declared by FMUs, written by scenes and CF, and read by people.

Units of instruments (`g`, `lbf`, `mV`) are not read here: `analysis.recording.units` converts them to SI.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

from vibroimpact.fmus.errors import UsageError

#: FMI's base units; rad is one of them, which distinguishes angles from plain numbers.
BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
#: SI symbols without a factor, and their exponents of the base units.
SYMBOLS: Mapping[str, Mapping[str, int]] = {
    **{base: {base: 1} for base in BASE_UNITS},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Hz": {"s": -1},
    "C": {"A": 1, "s": 1},
    "Ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "S": {"kg": -1, "m": -2, "s": 3, "A": 2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "T": {"kg": 1, "s": -2, "A": -1},
    "Wb": {"kg": 1, "m": 2, "s": -2, "A": -1},
}
CELSIUS = "degree_Celsius"
ZERO_CELSIUS = 273.15
#: Relative difference below which two factors count as equal: descriptions write pi / 180 in decimals.
FACTOR_TOLERANCE = 1e-9

_SCALED = {"g": ("kg", 1e-3), "deg": ("rad", math.pi / 180.0), "min": ("s", 60.0), "h": ("s", 3600.0)}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3, "M": 1e6, "G": 1e9}
_WITHOUT_PREFIX = frozenset({"kg", "deg", "min", "h"})
_POWER = re.compile(r"([A-Za-z]{1,10})(-?[1-9][0-9]?)?")
_NUMBER = re.compile(r"[0-9.]{1,20}(?:[eE][-+]?[0-9]{1,3})?")
_LONGEST_TEXT = 100


@dataclass(frozen=True, slots=True)
class Unit:
    """A product of SI symbols: value in base units = factor * value + offset.

    Attributes
    ----------
    powers : mapping of str to int
        Powers of `SYMBOLS`, as written.
    factor, offset : float
        Size of the unit in base units, and the position of its zero in base units.
    label : str
        Name as declared; empty for a unit without a name.
    """

    powers: Mapping[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0
    label: str = ""

    @property
    def name(self) -> str:
        """The label, or the unit as in model descriptions: `m/s2`, `W/(m2.K)`, `9.80665 m/s2`; empty for a number."""
        if self.label:
            return self.label
        if self.offset:
            return "degC"
        text = _quotient(self.powers.items())
        return text if self.factor == 1.0 else f"{self.factor:.15g} {text}".rstrip()

    @property
    def cf(self) -> str:
        """Name in CF's form: `N s m-1`; `1` for a pure number."""
        text = " ".join(_written(symbol, power) for symbol, power in self.powers.items()) or "1"
        return text if self.factor == 1.0 else f"{self.factor:.15g} {text}"

    @property
    def exponents(self) -> dict[str, int]:
        """Nonzero exponents of FMI's base units."""
        sums: dict[str, int] = {}
        for symbol, power in self.powers.items():
            for base, exponent in SYMBOLS[symbol].items():
                sums[base] = sums.get(base, 0) + power * exponent
        return {base: exponent for base, exponent in sums.items() if exponent}

    @property
    def per_second(self) -> Unit:
        """Unit of a slope over time; none for the slope of a pure number."""
        return _combined(self, Unit({"s": 1}), -1) if self.name else self

    @property
    def difference(self) -> Unit:
        """Unit of a difference; for temperatures in degrees Celsius it is the kelvin."""
        return Unit(self.powers, self.factor)


def declared_unit(label: str, exponents: Mapping[str, int], factor: float = 1.0, offset: float = 0.0) -> Unit:
    """Return a unit that a model description declares, from the exponents of its base units."""
    return Unit({base: power for base, power in exponents.items() if power}, factor, offset, label)


def parse_unit(text: str) -> Unit | None:
    """Return a unit from a product of SI symbols in FMI's form; None for any other text.

    Dots join factors, and exponents follow their symbol. Each slash divides by the factor, or the parenthesis, right
    behind it. `1` is the unit of a plain number. The prefixes n, u, m, c, k, M, G are known.

    Examples
    --------
    >>> parse_unit("kg.m2/s2").exponents, parse_unit("kN").factor
    ({'kg': 1, 'm': 2, 's': -2}, 1000.0)
    >>> parse_unit("W/(m2.K)").exponents
    {'kg': 1, 's': -3, 'K': -1}
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
    return None if product is None else replace(product, label=text)


def si_unit(text: str) -> Unit:
    """Return a unit from CF's form (blanks between powers, a factor in front) or FMI's form.

    Parameters
    ----------
    text : str
        `m s-2`, `9.80665 m s-2`, `V`, `degree_Celsius`, `m/s2`, `W/(m2.K)`; `1` for a pure number.

    Raises
    ------
    UsageError
        The text is no such product.

    Examples
    --------
    >>> si_unit("9.80665 m s-2").name, si_unit("m/s2").per_second.name, si_unit("V s2 m-1").name
    ('9.80665 m/s2', 'm/s3', 'V.s2/m')
    >>> si_unit("N s/m").cf
    'N s m-1'
    """
    if text == CELSIUS:
        return Unit({"K": 1}, 1.0, ZERO_CELSIUS)
    number = _NUMBER.match(text)
    try:
        factor = 1.0 if number is None else float(number[0])
    except ValueError:
        raise _unknown(text) from None
    if not 0.0 < factor < math.inf:
        raise _unknown(text)
    rest = ".".join(text[0 if number is None else number.end() :].replace(".", " ").split())
    product = parse_unit(rest if rest and rest[0] != "/" else f"1{rest}")
    if product is None or product.factor != 1.0:  # `g` is gravity in a recording, and a prefix is a factor
        raise _unknown(text)
    return Unit(product.powers, factor)


def agree(one: Unit, other: Unit) -> bool:
    """Whether a number has the same meaning in both units, whatever their names."""
    return (
        one.exponents == other.exponents
        and math.isclose(one.factor, other.factor, rel_tol=FACTOR_TOLERANCE)
        and math.isclose(one.offset, other.offset, rel_tol=FACTOR_TOLERANCE, abs_tol=FACTOR_TOLERANCE)
    )


def conversion(source: Unit, target: Unit) -> tuple[float, float]:
    """Return factor and offset that turn numbers of one unit into numbers of another of the same base units.

    >>> conversion(Unit({"K": 1}, 1.0, 273.15), Unit({"K": 1}))
    (1.0, 273.15)
    """
    return source.factor / target.factor, (source.offset - target.offset) / target.factor


def converts(gain: float, offset: float, source: Unit, target: Unit) -> bool:
    """Whether gain and offset turn numbers of one unit into the same quantities in another."""
    if source.exponents != target.exponents:
        return False
    factor, shift = conversion(source, target)
    return math.isclose(gain, factor, rel_tol=FACTOR_TOLERANCE) and math.isclose(
        offset, shift, rel_tol=FACTOR_TOLERANCE, abs_tol=FACTOR_TOLERANCE
    )


def product_agrees(source: Unit, gain: Unit, target: Unit) -> bool:
    """Whether source times gain is target; units with a shifted zero (degC) have no products."""
    if source.offset or target.offset:
        return False
    return agree(_combined(source, gain, 1), target)


def gain_unit_between(source: Unit, target: Unit) -> str | None:
    """Return a unit for writing the gain from one unit to another; None if there is none.

    Examples
    --------
    >>> metre, speed, newton = map(parse_unit, ("m", "m/s", "N"))
    >>> gain_unit_between(metre, newton), gain_unit_between(speed, newton)
    ('N/m', 'kg/s')
    """
    ratio = _combined(target, source, -1).exponents
    divisor = f"({source.name})" if "." in source.name else source.name
    in_base_units = _quotient([(base, ratio[base]) for base in BASE_UNITS if base in ratio]) or "1"
    for text in (f"{target.name}/{divisor}", in_base_units):
        unit = parse_unit(text)
        if unit and text.count("/") <= 1 and product_agrees(source, unit, target):
            return text
    return None


def _written(symbol: str, power: int) -> str:
    return symbol if power == 1 else f"{symbol}{power}"


def _quotient(
    powers: Iterable[tuple[str, int]], between: str = ".", written: Callable[[str, int], str] = _written
) -> str:
    """Return powers in one line as FMI writes them, negative ones behind a slash; empty without powers."""
    powers = list(powers)
    above = between.join(written(symbol, power) for symbol, power in powers if power > 0)
    below = [written(symbol, -power) for symbol, power in powers if power < 0]
    divisor = f"({between.join(below)})" if len(below) > 1 else "".join(below)
    return f"{above or '1'}/{divisor}" if divisor else above


def _product(text: str) -> Unit | None:
    product = Unit()
    for written in text.split("."):
        factor = _factor(written)
        if factor is None:
            return None
        product = _combined(product, factor, 1)
    return product


def _factor(text: str) -> Unit | None:
    if text == "1":
        return Unit()
    match = _POWER.fullmatch(text)
    symbol = _symbol(match[1]) if match else None
    if match is None or symbol is None:
        return None
    return _combined(Unit(), symbol, int(match[2] or 1))


def _symbol(text: str) -> Unit | None:
    if text in SYMBOLS:
        return Unit({text: 1})
    if text in _SCALED:
        symbol, factor = _SCALED[text]
        return Unit({symbol: 1}, factor)
    prefix, bare = text[:1], text[1:]
    if prefix not in _PREFIXES or bare in _WITHOUT_PREFIX:
        return None
    unit = _symbol(bare) if bare in SYMBOLS or bare in _SCALED else None
    return unit and Unit(unit.powers, unit.factor * _PREFIXES[prefix])


def _combined(unit: Unit, other: Unit, power: int) -> Unit:
    """Return unit * other^power."""
    powers = dict(unit.powers)
    for symbol, exponent in other.powers.items():
        powers[symbol] = powers.get(symbol, 0) + power * exponent
    kept = {symbol: exponent for symbol, exponent in powers.items() if exponent}
    return Unit(kept, unit.factor * other.factor**power)


def _unknown(text: str) -> UsageError:
    return UsageError(
        f"unit: expected a product of {', '.join(SYMBOLS)} such as m s-2, got {text[:60]!r}. Convert it to SI."
    )


_WHOLE = {"1": "-", CELSIUS: "°C"}
_SIZED = re.compile(r"(?P<factor>\d+(?:\.\d+)?(?:[eE][-+]?\d+)?) (?P<unit>\D.*)")
_TOKEN = re.compile(r"(?P<name>[A-Za-zµΩ%]+)(?P<power>-?[1-9])?")
_SHOWN_PREFIXES = {1e-12: "p", 1e-9: "n", 1e-6: "µ", 1e-3: "m", 1e3: "k", 1e6: "M", 1e9: "G"}
# symbols that form everyday units with a prefix; `g` is gravity here, never a part of a kilogram
_PREFIXED = frozenset({"m", "s", "N", "Pa", "V", "A", "J", "W", "Hz", "rad"})
_NAMED = {
    "m": {0.01: "cm", 0.0254: "in", 0.3048: "ft"},
    "N": {4.4482216152605: "lbf"},
    "Pa": {100.0: "hPa", 1e5: "bar", 6894.75729316836: "psi"},
    "rad": {math.pi / 180.0: "deg"},
    "s": {60.0: "min", 3600.0: "h"},
}
_GRAVITY = 9.80665
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def written_unit(cf: str) -> str:
    """Return a CF unit in the form that people write; unchanged if it has no such form.

    >>> written_unit("m s-2"), written_unit("9.80665 m s-2"), written_unit("1"), written_unit("V")
    ('m/s²', 'g', '-', 'V')
    >>> written_unit("0.001 m"), written_unit("0.001 m s-1"), written_unit("1e-06 V s2 m-1"), written_unit("0.5 m")
    ('mm', 'mm/s', 'µV s²/m', '0.5 m')
    """
    if cf in _WHOLE:
        return _WHOLE[cf]
    match = _SIZED.fullmatch(cf)
    factor, unit = (float(match["factor"]), match["unit"]) if match else (1.0, cf)
    found = [_TOKEN.fullmatch(token) for token in unit.split()]
    tokens = [(token["name"], int(token["power"] or 1)) for token in found if token is not None]
    if not found or len(tokens) < len(found):
        return cf
    scaled = _scaled(factor, tokens)
    return cf if scaled is None else _quotient(scaled, " ", _raised)


def _scaled(factor: float, tokens: list[tuple[str, int]]) -> list[tuple[str, int]] | None:
    """Return the parts of a unit with the factor as a prefix of the first part; None if no prefix fits."""
    (name, power), rest = tokens[0], tokens[1:]
    if factor == 1.0:
        return tokens
    if math.isclose(factor, _GRAVITY, rel_tol=1e-9) and tokens[:2] == [("m", 1), ("s", -2)]:
        return [("g", 1), *tokens[2:]]
    if power != 1:
        return None
    prefixed = {scale: f"{prefix}{name}" for scale, prefix in _SHOWN_PREFIXES.items() if name in _PREFIXED}
    for scale, symbol in (prefixed | _NAMED.get(name, {})).items():
        if math.isclose(factor, scale, rel_tol=1e-9):
            return [(symbol, 1), *rest]
    return None


def _raised(symbol: str, power: int) -> str:
    return _written(symbol, power).translate(_SUPERSCRIPTS)
