"""Units of recorded channels as FMI's model descriptions want them: exponents of base units and a factor."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

from vibroimpact.fmus.errors import UsageError

#: SI symbols and their exponents of FMI's base units, of which rad is one.
SYMBOLS: Mapping[str, Mapping[str, int]] = {
    **{base: {base: 1} for base in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Hz": {"s": -1},
}
CELSIUS = "degree_Celsius"
ZERO_CELSIUS = 273.15
_POWER = re.compile(r"([A-Za-z]{1,10})(-?[1-9])?")
_NUMBER = re.compile(r"[0-9.]{1,20}(?:[eE][-+]?[0-9]{1,3})?")


@dataclass(frozen=True, slots=True)
class SiUnit:
    """A product of SI symbols: value in base units = factor * value + offset.

    Attributes
    ----------
    powers : mapping of str to int
        Powers of `SYMBOLS`, as written.
    factor, offset : float
        Size of the unit in base units, and where its zero is.
    """

    powers: Mapping[str, int] = field(default_factory=dict)
    factor: float = 1.0
    offset: float = 0.0

    @property
    def name(self) -> str:
        """As model descriptions write it: `m/s2`, `W/(m2.K)`, `9.80665 m/s2`; empty for a pure number."""
        if self.offset:
            return "degC"
        above = ".".join(_written(s, p) for s, p in self.powers.items() if p > 0)
        below = [_written(s, -p) for s, p in self.powers.items() if p < 0]
        divisor = f"({'.'.join(below)})" if len(below) > 1 else "".join(below)
        text = f"{above or '1'}/{divisor}" if divisor else above
        return text if self.factor == 1.0 else f"{self.factor:.15g} {text}".rstrip()

    @property
    def exponents(self) -> dict[str, int]:
        """Exponents of FMI's base units, those of 0 left out."""
        sums: dict[str, int] = {}
        for symbol, power in self.powers.items():
            for base, exponent in SYMBOLS[symbol].items():
                sums[base] = sums.get(base, 0) + power * exponent
        return {base: exponent for base, exponent in sums.items() if exponent}

    @property
    def per_second(self) -> SiUnit:
        """The unit of a slope over time; a pure number's has none either."""
        if not self.name:
            return self
        powers = dict(self.powers)
        powers["s"] = powers.pop("s", 0) - 1
        return SiUnit({s: p for s, p in powers.items() if p}, self.factor)

    @property
    def difference(self) -> SiUnit:
        """The unit of a difference: of temperatures in degrees Celsius it is the kelvin."""
        return SiUnit(self.powers, self.factor)


def _written(symbol: str, power: int) -> str:
    return symbol if power == 1 else f"{symbol}{power}"


def si_unit(text: str) -> SiUnit:
    """Return a unit written as CF writes it (blanks between powers, a factor in front) or as FMI does.

    Parameters
    ----------
    text : str
        `m s-2`, `9.80665 m s-2`, `V`, `degree_Celsius`, `m/s2`, `W/(m2.K)`; `1` for a pure number.

    Raises
    ------
    UsageError
        It is no such product.

    Examples
    --------
    >>> si_unit("9.80665 m s-2").name, si_unit("m/s2").per_second.name, si_unit("V s2 m-1").name
    ('9.80665 m/s2', 'm/s3', 'V.s2/m')
    >>> si_unit("N").exponents
    {'kg': 1, 'm': 1, 's': -2}
    """
    if text == CELSIUS:
        return SiUnit({"K": 1}, 1.0, ZERO_CELSIUS)
    number = _NUMBER.match(text)
    factor = 1.0 if number is None else _positive(number[0], text)
    rest = text if number is None else text[number.end() :]
    numerator, *divisors = rest.split("/")
    powers: dict[str, int] = {}
    _multiply(powers, numerator, 1, text)
    for written in divisors:
        enclosed = written.startswith("(") and written.endswith(")")
        if not enclosed and not _POWER.fullmatch(written):
            raise _unknown(text)
        _multiply(powers, written[1:-1] if enclosed else written, -1, text)
    return SiUnit({symbol: power for symbol, power in powers.items() if power}, factor)


def _multiply(powers: dict[str, int], product: str, sign: int, text: str) -> None:
    for word in product.replace(".", " ").split():
        match = _POWER.fullmatch(word)
        if match is not None and match[1] in SYMBOLS:
            powers[match[1]] = powers.get(match[1], 0) + sign * int(match[2] or 1)
        elif word != "1":
            raise _unknown(text)


def _positive(number: str, text: str) -> float:
    try:
        value = float(number)
    except ValueError:
        raise _unknown(text) from None
    if not 0.0 < value < float("inf"):
        raise _unknown(text)
    return value


def _unknown(text: str) -> UsageError:
    known = ", ".join(SYMBOLS)
    return UsageError(
        f"unit: expected a product of {known} such as m s-2, got {text[:60]!r}. Convert it to SI."
    )
