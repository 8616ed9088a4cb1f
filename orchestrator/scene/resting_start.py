"""A start on the stops, for what needs a scene whose motion starts nowhere: a search for periodic orbits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import Any

KEY = "displacement_start"


def with_resting_start(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document in which a start that is not written is on the rigid stops that keep the body from 0.

    Parameters
    ----------
    document : mapping
        A parsed TOML document, whatever is in it; it stays as it is. What is no number is left to the rules of scenes.

    Returns
    -------
    dict
        With `body.displacement_start` where a rigid stop of an oscillator or of a mass of a chain is beyond 0.

    Examples
    --------
    >>> with_resting_start({"body": {"mass": 1.0}, "stop": [{"position": -0.5}]})["body"]
    {'mass': 1.0, 'displacement_start': -0.5}
    """
    found = deepcopy(dict(document))
    body = found.get("body")
    if not isinstance(body, dict) or KEY in body or f"body.{KEY}" in _table(found.get("sweep")):
        return found
    kind, masses = body.get("kind", "oscillator"), body.get("masses")
    size = len(masses) if kind == "chain" and isinstance(masses, list) else 1
    starts = [0.0] * size
    for side, position, mass in _limits(found, size):
        if 1 <= mass <= size:
            nearest = min if side == "upper" else max
            starts[mass - 1] = nearest(starts[mass - 1], position)
    if any(starts) and kind in ("oscillator", "chain"):
        body[KEY] = starts if kind == "chain" else starts[0]
    return found


def _limits(document: Mapping[str, Any], size: int) -> Iterator[tuple[str, float, int]]:
    """Yield side, position at its worst over the sweep, and mass of each rigid stop: as given, or the last."""
    stops, swept = document.get("stop"), _table(document.get("sweep"))
    for number, stop in enumerate(stops if isinstance(stops, list) else [], start=1):
        if not isinstance(stop, dict) or stop.get("law", "restitution") != "restitution":
            continue
        side, mass = stop.get("side", "upper"), stop.get("mass", size)
        positions = [*_values(swept.get(f"stop[{number}].position")), stop.get("position")]
        known = [float(each) for each in positions if type(each) in (int, float) and each == each]
        if known and type(mass) is int:
            yield side, (min(known) if side == "upper" else max(known)), mass


def _values(axis: Any) -> list[Any]:
    """Return the ends or the values of a swept key, as written."""
    table = _table(axis)
    values = table.get("values")
    return [*(values if isinstance(values, list) else []), table.get("start"), table.get("stop")]


def _table(raw: Any) -> Mapping[str, Any]:
    return raw if isinstance(raw, dict) else {}
