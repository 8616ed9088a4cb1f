"""How people write the units that CF writes, in figures and tables."""

from __future__ import annotations

import math
import re

_WHOLE = {"1": "-", "degree_Celsius": "°C"}
_FACTOR = re.compile(r"(?P<factor>\d+(?:\.\d+)?(?:[eE][-+]?\d+)?) (?P<unit>\D.*)")
_TOKEN = re.compile(r"(?P<name>[A-Za-zµΩ%]+)(?P<power>-?[1-9])?")
_PREFIXES = {1e-12: "p", 1e-9: "n", 1e-6: "µ", 1e-3: "m", 1e3: "k", 1e6: "M", 1e9: "G"}
# of what a prefix makes the unit that people use; `g` is gravity here, never a part of a kilogram
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
    """Return a CF unit as people write it; one that has no such form as it is.

    >>> written_unit("m s-2"), written_unit("9.80665 m s-2"), written_unit("1"), written_unit("V")
    ('m/s²', 'g', '-', 'V')
    >>> written_unit("0.001 m"), written_unit("0.001 m s-1"), written_unit("1e-06 V s2 m-1"), written_unit("0.5 m")
    ('mm', 'mm/s', 'µV s²/m', '0.5 m')
    """
    if cf in _WHOLE:
        return _WHOLE[cf]
    match = _FACTOR.fullmatch(cf)
    factor, unit = (float(match["factor"]), match["unit"]) if match else (1.0, cf)
    found = [_TOKEN.fullmatch(token) for token in unit.split()]
    tokens = [(token["name"], int(token["power"] or 1)) for token in found if token is not None]
    if not found or len(tokens) < len(found):
        return cf
    scaled = _scaled(factor, tokens)
    return cf if scaled is None else _joined(scaled)


def _scaled(factor: float, tokens: list[tuple[str, int]]) -> list[tuple[str, int]] | None:
    """Return the parts of a unit with a factor in the name of the first; None where no name has it."""
    (name, power), rest = tokens[0], tokens[1:]
    if factor == 1.0:
        return tokens
    if math.isclose(factor, _GRAVITY, rel_tol=1e-9) and tokens[:2] == [("m", 1), ("s", -2)]:
        return [("g", 1), *tokens[2:]]
    if power != 1:
        return None
    prefixed = {scale: f"{prefix}{name}" for scale, prefix in _PREFIXES.items() if name in _PREFIXED}
    for scale, symbol in (prefixed | _NAMED.get(name, {})).items():
        if math.isclose(factor, scale, rel_tol=1e-9):
            return [(symbol, 1), *rest]
    return None


def _joined(tokens: list[tuple[str, int]]) -> str:
    """Return the parts of a unit in one line, those with negative powers behind a stroke."""

    def written(sign: int) -> list[str]:
        return [
            name + (str(abs(power)).translate(_SUPERSCRIPTS) if abs(power) > 1 else "")
            for name, power in tokens
            if power * sign > 0
        ]

    above, below = " ".join(written(1)) or "1", written(-1)
    if not below:
        return above
    return f"{above}/{below[0]}" if len(below) == 1 else f"{above}/({' '.join(below)})"
