"""Facts of the scene's text for figures: stops, forcing, order of keys.

The text is provenance: it may be missing or of another version, and a figure without these facts is still right.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset.clock import CLOCK_PERIODS
from vibroimpact.analysis.dataset.schema import scene_of

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

Floats = NDArray[np.float64]
_MOTION = (
    "velocity",
    "motion_amplitude",
    "motion_angular_frequency",
    "motion_phase",
    "motion_times",
    "motion_values",
)
_ELEMENT = re.compile(r"(contact_)?displacement_([0-9]+)")


class ShownStop(NamedTuple):
    """A stop or contact of a scene: position (m), side (+1 upper, -1 lower), the points that it limits, its motion."""

    position: float
    side: float
    point: float | str | tuple[str, ...] | None
    motion: Mapping[str, Any] = {}

    def course(self, time: Floats) -> tuple[Floats, Floats]:
        """Return position (m) and velocity (m/s) of the stop at instants (s)."""
        speed, amplitude, w, phase = (
            float(self.motion.get(key, 0.0))
            for key in ("velocity", "motion_amplitude", "motion_angular_frequency", "motion_phase")
        )
        angle = w * time + phase
        place = self.position + speed * time + amplitude * np.cos(angle)
        rate = speed - amplitude * w * np.sin(angle)
        if "motion_times" in self.motion:
            spline = _spline(self.motion["motion_times"], self.motion["motion_values"])
            place, rate = place + spline(time), rate + spline(time, 1)
        return place, rate


def _spline(times: Sequence[float], values: Sequence[float]) -> PPoly:
    """Return the natural cubic spline, which goes on in straight lines before its first and after its last instant."""
    from scipy.interpolate import CubicSpline, PPoly  # it takes time, and few scenes have such a stop

    inner = CubicSpline(times, values, bc_type="natural")
    first, last = inner(times[0], 1), inner(times[-1], 1)
    before, after = [0.0, 0.0, first, values[0] - first], [0.0, 0.0, last, values[-1]]
    return PPoly(np.column_stack([before, inner.c, after]), [times[0] - 1.0, *times, times[-1] + 1.0])


def table(scene: dict[str, Any], name: str) -> dict[str, Any]:
    """Return a table of a scene; empty where the scene lacks it."""
    found = scene.get(name)
    return found if isinstance(found, dict) else {}


def swept_keys(scene: dict[str, Any]) -> list[str]:
    """Return the swept keys in the order of the scene."""
    return list(table(scene, "sweep"))


def column_of(key: str, names: Sequence[str]) -> str | None:
    """Return the coordinate of a swept key: the whole key if another key has the same last part."""
    written = re.sub(r"\W+", "_", key).strip("_")
    return max((name for name in names if f"_{written}".endswith(f"_{name}")), key=len, default=None)


def stops(dataset: xr.Dataset) -> list[ShownStop]:
    """Return the stops of the scene, then the contacts of its bodies; empty if places were swept or are unknown."""
    scene = scene_of(dataset.attrs)
    places = (".position", ".side", ".location", ".mass", ".clearance")
    if any(key.startswith("stop") and key.endswith(_MOTION) for key in swept_keys(scene)):
        return []
    if any(key.endswith(places) for key in swept_keys(scene)):
        return []
    contacts = scene.get("contact", []) if "body" in scene else []
    try:
        stops = [_stop(stop, table(scene, "body")) for stop in scene.get("stop", [])]
        return stops + [
            ShownStop(float(each.get("clearance", 0.0)), 1.0, tuple(each["between"])) for each in contacts
        ]
    except (KeyError, TypeError, ValueError, AttributeError):
        return []


def _stop(written: dict[str, Any], body: dict[str, Any]) -> ShownStop:
    """Return one stop; its point is a mass of a chain, a place on a beam, or a point of one of several bodies."""
    point: float | str | None = written.get("at")
    if body.get("kind") == "chain":
        point = written.get("mass", len(body["masses"]))
    elif body.get("kind") == "beam":
        point = written.get("location", 1.0)
    side = -1.0 if written.get("side") == "lower" else 1.0
    return ShownStop(
        float(written["position"]), side, point, {key: written[key] for key in _MOTION if key in written}
    )


def contact_label(dataset: xr.Dataset, number: int) -> str:
    """Return the name of a contact, counted from 1: a stop by its number, contacts of bodies by their points."""
    meanings = str(dataset.variables["impact_contact"].attrs.get("flag_meanings", "")).split()
    written = limiting_tables(dataset)
    if meanings and not written:
        return meanings[number - 1]
    points = written[number - 1].get("between") if number <= len(written) else None
    return " - ".join(points) if points else f"stop {number}"


def limiting_tables(dataset: xr.Dataset) -> list[dict[str, Any]]:
    """Return the tables of the stops of the scene, then of the contacts of its bodies."""
    scene = scene_of(dataset.attrs)
    found = (scene.get(name) for name in ("stop", "contact") if "body" in scene)
    return [each for tables in found if isinstance(tables, list) for each in tables]


def observed_stops(dataset: xr.Dataset) -> list[ShownStop]:
    """Return the stops that limit the point of the recorded displacement."""
    found = stops(dataset)
    scene = scene_of(dataset.attrs)
    body, first = table(scene, "body"), found[0].point if found else None
    if body.get("kind") == "chain":
        observed = body.get("observed_mass", first)
    elif body.get("kind") == "beam":
        tip = body.get("boundary", "clamped-free") == "clamped-free"
        observed = table(scene, "sensor").get("location", 1.0 if tip else first)
    else:
        written = table(scene, "record").get("observed") or [None if isinstance(first, tuple) else first]
        observed = tuple(written[0]) if isinstance(written[0], list) else written[0]
    return [stop for stop in found if stop.point == observed]


def limits(dataset: xr.Dataset, name: str) -> list[ShownStop]:
    """Return the stops that a sampled displacement may meet."""
    if name == "displacement":
        return observed_stops(dataset)
    element = _ELEMENT.fullmatch(name)
    if element is None:
        return []
    number, found = int(element[2]), stops(dataset)
    if element[1]:
        return [stop for place, stop in enumerate(found, start=1) if place == number]
    is_chain = table(scene_of(dataset.attrs), "body").get("kind") == "chain"
    return [stop for stop in found if is_chain and stop.point == number]


def fixed_positions(stops: Sequence[ShownStop]) -> list[float]:
    """Return the positions of the stops that stand still, m, each once, ascending."""
    return sorted({stop.position for stop in stops if not stop.motion})


def forcing_rate(dataset: xr.Dataset, run: xr.Dataset) -> float | None:
    """Return the angular frequency of the forcing of a run, rad/s; None without an oscillating force.

    Several sines have the frequency of their common period, else of the first sine.

    The rows of the run have its swept values as coordinates.
    """
    scene = scene_of(dataset.attrs)
    owner, forcing = _first_sine(scene)
    periods = max(1, int(dataset.attrs.get(CLOCK_PERIODS, 1)))
    for key, factor in (("angular_frequency", 1.0), ("frequency", 2.0 * math.pi)):
        value = forcing.get(key)
        if f"{owner}.{key}" in swept_keys(scene):
            column = column_of(f"{owner}.{key}", [str(name) for name in run.coords])
            value = None if column is None else run[column].item()
        if isinstance(value, int | float) and math.isfinite(value) and value > 0.0:
            return factor * value / periods
    return None


def _first_sine(scene: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the key and the table of the first sine of a scene; an empty table where it has none."""
    forces = scene.get("forcing")
    if not isinstance(forces, list):
        forcing = table(scene, "forcing")
        return "forcing", forcing if forcing.get("signal", "sine") == "sine" else {}
    for number, force in enumerate(forces, start=1):
        if force.get("signal", "sine") == "sine":
            return f"forcing[{number}]", force
    return "forcing", {}


def in_scene_order(dataset: xr.Dataset, names: Sequence[str]) -> list[str]:
    """Return sampled variables in the order of the scene; variables that it does not name come last."""
    record = table(scene_of(dataset.attrs), "record")
    listed = (table(record, "time_series") or record).get("variables", ())
    written = [re.sub(r"\W+", "_", name).strip("_") for name in listed if isinstance(name, str)]
    return sorted(names, key=lambda name: written.index(name) if name in written else len(written))
