"""Maps of a scene: where impacts and periods lead to, the sets of grazing impacts, and what a graze is like."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Literal, cast

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.grazing_sets import grazing_sets
from vibroimpact.analysis.orbits.normal_forms import Nordmark, grazing_family, square_root_diagram
from vibroimpact.analysis.orbits.periodic import TURN
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.find import find_orbits
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.provenance import program_attributes, scene_attributes
from vibroimpact.orchestrator.scene import Scene

HISTORY = "maps of vibroimpact"
MapKind = Literal["impact", "strobe", "discontinuity", "nordmark", "square-root"]
MAP_KINDS: tuple[MapKind, ...] = ("impact", "strobe", "discontinuity", "nordmark", "square-root")
POINTS = 1500
"""Values of a diagram's parameter, phases of a set, unless it is said."""
MOST_POINTS = 100_000
RHO, OFFSET = (-0.02, 0.1), (-0.01, 0.12)
"""Ranges of the diagrams, unless they are said."""
CLASSES = {True: "stable", False: "unstable"}
STATES = ResultTable(
    "maps",
    ("displacement", "state", "m", "displacement at forcing phase 0"),
    ("velocity", "state", "m s-1", "velocity at forcing phase 0"),
    ("orbit_displacement", "orbit", "m", "displacement"),
    ("orbit_velocity", "orbit", "m s-1", "velocity"),
    ("orbit_name", "orbit", "1", "orbit", "text"),
)
"""Variables of a strobe."""
IMPACTS = ResultTable(
    "maps",
    ("phase", "state", "rad", "forcing phase of an impact"),
    ("velocity", "state", "m s-1", "impact velocity"),
    ("orbit_phase", "orbit", "rad", "phase"),
    ("orbit_velocity", "orbit", "m s-1", "velocity"),
    ("orbit_name", "orbit", "1", "orbit", "text"),
    ("graze_phase", "graze", "rad", "forcing phase of a graze"),
    ("before_phase", "graze", "rad", "S: forcing phase of the impact before the graze"),
    ("before_velocity", "graze", "m s-1", "S: velocity of the impact before the graze"),
    ("after_phase", "graze", "rad", "W: forcing phase of the impact after the graze"),
    ("after_velocity", "graze", "m s-1", "W: velocity of the impact after the graze"),
)
"""Variables of an impact map; those of grazes are there with the kind `discontinuity`."""
NORDMARK = ResultTable(
    "maps",
    ("rho", "rho", "1", "distance from the graze in Nordmark's map"),
    ("x", "rho step", "1", "virtual penetration in Nordmark's map"),
    ("forcing_amplitude", "rho", "N", "forcing amplitude"),
)
"""Variables of the diagram of Nordmark's map; the last is there with a scene."""
SQUARE_ROOT = ResultTable(
    "maps",
    ("d", "d", "1", "offset of the square-root map"),
    ("x", "d step", "1", "state of the square-root map"),
)
"""Variables of the diagram of the square-root map."""


@dataclass(frozen=True, slots=True)
class MapSettings:
    """Which map, and of what.

    Attributes
    ----------
    kind : {"impact", "strobe", "discontinuity", "nordmark", "square-root"}
    span : tuple of float, or None
        Range of rho (nordmark) or d (square-root).
    points : int
        Values in it; phases of the sets of discontinuity.
    alpha, gamma, restitution : float or None
        Of the Nordmark map; None: those of the scene.
    slope : float
        lambda of the square-root map.
    """

    kind: MapKind
    span: tuple[float, float] | None = None
    points: int = POINTS
    alpha: float | None = None
    gamma: float | None = None
    restitution: float | None = None
    slope: float | None = None

    def refuse(self) -> None:
        """Refuse what is no map.

        Raises
        ------
        UsageError
        """
        if self.kind not in MAP_KINDS:
            raise UsageError(f"maps: kind: expected one of {', '.join(MAP_KINDS)}, got {self.kind!r}.")
        if not 10 <= self.points <= MOST_POINTS:
            raise UsageError(f"maps: points: expected 10 to {MOST_POINTS}, got {self.points}.")
        if self.span is not None and not (
            self.span[0] < self.span[1] and all(math.isfinite(end) for end in self.span)
        ):
            got = f"{self.span[0]:g}, {self.span[1]:g}"
            raise UsageError(
                f"maps: from, to: expected two finite numbers, the smaller one first, got {got}."
            )
        takes = {"nordmark": {"alpha", "gamma", "restitution", "span"}, "square-root": {"slope", "span"}}
        for name in ("alpha", "gamma", "restitution", "slope", "span"):
            if getattr(self, name) is not None and name not in takes.get(self.kind, set()):
                words = "from, to" if name == "span" else name
                raise UsageError(
                    f"maps: {words}: expected with the kinds that take it, got it with {self.kind}."
                )
        self._refuse_numbers()

    def _refuse_numbers(self) -> None:
        for name, low, high in (
            ("alpha", -10.0, 10.0),
            ("gamma", 0.0, 1.0),
            ("restitution", 0.0, 1.0),
            ("slope", 0.0, 1.0),
        ):
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise UsageError(f"maps: {name}: expected a number from {low:g} to {high:g}, got {value:g}.")
        if self.kind == "nordmark" and (self.alpha is None) != (self.gamma is None):
            raise UsageError("maps: alpha, gamma: expected both or neither, got one of them.")


def settings_of(kind: str, **options: Any) -> MapSettings:
    """Return settings whose kind comes from outside.

    Raises
    ------
    UsageError
        They are none of a map.
    """
    settings = MapSettings(cast("MapKind", kind), **options)
    settings.refuse()
    return settings


def map_of(scene: Scene | None, settings: MapSettings) -> xr.Dataset:
    """Return a map of a scene as points to be drawn; square-root, and nordmark with alpha and gamma, need no scene.

    Raises
    ------
    UsageError
        The scene has no such map.
    OrbitError
        The body has several modes, where the map is one of one mode.
    """
    if settings.kind == "square-root":
        found = _square_root(settings)
    elif settings.kind == "nordmark":
        found = _nordmark(scene, settings)
    else:
        found = _of_impacts(_needed(scene, settings), settings)
    attributes = program_attributes()
    if scene is not None:
        attributes |= scene_attributes(scene, HISTORY) | {"units_system": scene.units}
    return found.assign_attrs(attributes | {"map": settings.kind, "history": HISTORY})


def _needed(scene: Scene | None, settings: MapSettings) -> Scene:
    if scene is None:
        raise UsageError(f"maps: scene: expected one for the kind {settings.kind}, got none.")
    return scene.unswept()


# ---- of a scene's impacts ----


def _of_impacts(scene: Scene, settings: MapSettings) -> xr.Dataset:
    body = impacting_body(scene)
    orbits: list[PeriodicOrbit] = []
    with suppress(OrbitError):  # a body without losses has families of them, of which none is marked
        orbits += find_orbits(scene, 1, 1)
    is_strobe = settings.kind == "strobe"
    states = _run(scene, strobe=is_strobe)
    if is_strobe:
        marks = np.array([_strobed(orbit) for orbit in orbits]).reshape(-1, 2)
    else:
        marks = np.array([(np.mod(orbit.phases[0], TURN), orbit.velocities[0]) for orbit in orbits]).reshape(
            -1, 2
        )
    across = "displacement" if is_strobe else "phase"
    values = {
        across: states[:, 0],
        "velocity": states[:, 1],
        f"orbit_{across}": marks[:, 0],
        "orbit_velocity": marks[:, 1],
        "orbit_name": [_named(orbit) for orbit in orbits],
    }
    if settings.kind == "discontinuity":
        found = grazing_sets(body, settings.points)
        values |= {
            "graze_phase": found.grazes,
            "before_phase": found.before_phase,
            "before_velocity": found.before_velocity,
            "after_phase": found.after_phase,
            "after_velocity": found.after_velocity,
        }
    return (STATES if is_strobe else IMPACTS).dataset(values, units=scene.units)


def _run(scene: Scene, *, strobe: bool = False) -> Floats:
    """Return phases and velocities of the impacts of a long run, or its states at phase 0."""
    record = {"record.impacts": not strobe, "record.strobe": strobe}
    runner = PointRunner(scene.with_values(record))
    try:
        record_of = runner.run({})
    finally:
        runner.close()
    if strobe:
        table = record_of.periods
        return np.empty((0, 2)) if table is None else np.asarray(table)[:, :2]
    rows = record_of.impacts
    return np.empty((0, 2)) if rows is None or not len(rows) else np.asarray(rows)[:, 1:3]


def _strobed(orbit: PeriodicOrbit) -> tuple[float, float]:
    x, v = orbit.at(np.array([TURN * math.ceil(orbit.phases[0] / TURN)]))
    return float(x[0]), float(v[0])


def _named(orbit: PeriodicOrbit) -> str:
    """Return what an orbit is: of one mode by its two multipliers, else whether it is stable."""
    multipliers = orbit.multipliers
    if multipliers.size != 2 or not np.isfinite(multipliers).all():
        return f"{CLASSES[orbit.is_stable]} {orbit.name}"
    if multipliers[0].imag != 0.0:
        return f"{CLASSES[orbit.is_stable]} focus {orbit.name}"
    if orbit.is_stable:
        return f"stable node {orbit.name}"
    return f"{'flip ' if multipliers[0].real < 0.0 else ''}saddle {orbit.name}"


# ---- of a graze ----


def _nordmark(scene: Scene | None, settings: MapSettings) -> xr.Dataset:
    rho = np.linspace(*(settings.span or RHO), settings.points)
    family = None
    if settings.alpha is None or settings.gamma is None:
        alone = _needed(scene, settings)
        if alone.body.IS_STRUCTURE:
            raise UsageError(
                f"{alone.source}: body.kind: expected an oscillator for Nordmark's map, got another body."
            )
        amplitude = float_parameters(alone, None)["forcing.amplitude"]
        if amplitude == 0.0:
            raise UsageError(f"{alone.source}: forcing.amplitude: expected a force, got 0.")
        family = grazing_family(impacting_body(alone), amplitude)
        chosen = family.map
        if settings.restitution is not None:
            raise UsageError(
                "maps: restitution: expected with alpha and gamma, got it with those of the scene."
            )
    else:
        restitution = 1.0 if settings.restitution is None else settings.restitution
        chosen = Nordmark(settings.alpha, settings.gamma, restitution)
    values = {"rho": rho, "x": chosen.diagram(rho)}
    if family is not None:
        values["forcing_amplitude"] = family.amplitude_of(rho)
    attributes = {"alpha": chosen.alpha, "gamma": chosen.gamma, "restitution": chosen.restitution}
    if family is not None:
        attributes |= {"grazing_amplitude": family.amplitude, "rho_slope": family.slope}
    if chosen.oscillator is not None:
        ratio, frequency = chosen.oscillator
        attributes |= {"oscillator_damping_ratio": ratio, "oscillator_frequency_ratio": frequency}
    units = "SI" if scene is None else scene.units
    return NORDMARK.dataset(values, attributes | {"root_sign": chosen.sign}, units=units)


def _square_root(settings: MapSettings) -> xr.Dataset:
    slope = 0.5 if settings.slope is None else settings.slope
    offsets = np.linspace(*(settings.span or OFFSET), settings.points)
    return SQUARE_ROOT.dataset({"d": offsets, "x": square_root_diagram(slope, offsets)}, {"slope": slope})
