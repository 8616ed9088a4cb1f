"""How people write the units that CF writes, in figures and tables."""

from __future__ import annotations

_SYMBOLS = {
    "1": "-",
    "9.80665 m s-2": "g",
    "m s-2": "m/s²",
    "m s-1": "m/s",
    "rad s-1": "rad/s",
    "m N-1": "m/N",
    "N m-1": "N/m",
    "N s m-1": "N s/m",
    "0.001 V": "mV",
}


def written_unit(cf: str) -> str:
    """Return a CF unit as people write it; one without a symbol as it is.

    >>> written_unit("m s-2"), written_unit("9.80665 m s-2"), written_unit("1"), written_unit("V")
    ('m/s²', 'g', '-', 'V')
    """
    return _SYMBOLS.get(cf, cf)
