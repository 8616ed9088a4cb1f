"""The study `maps`: points of impact and stroboscopic maps, grazing sets, and normal forms of a graze."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self, cast

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import ResultTable
from vibroimpact.analysis.dataset.schema import UnitSystem
from vibroimpact.analysis.orbits import OrbitError, PeriodicOrbit
from vibroimpact.analysis.orbits.grazing_sets import grazing_sets
from vibroimpact.analysis.orbits.normal_forms import (
    GrazingFamily,
    Nordmark,
    grazing_family,
    one_mode,
    periods_of,
    square_root_diagram,
)
from vibroimpact.analysis.orbits.periodic import TURN
from vibroimpact.analysis.study import Study
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.operations.maps import Maps
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.find import find_orbits
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.provenance import scene_attributes
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene

HISTORY = "maps of vibroimpact"
MapKind = Literal["impact", "strobe", "discontinuity", "nordmark", "square-root"]
MAP_KINDS: tuple[MapKind, ...] = ("impact", "strobe", "discontinuity", "nordmark", "square-root")
POINTS = 1500
"""Default number of a diagram's parameter values, or of a set's phases."""
MOST_POINTS = 100_000
PART = 500
"""Values of a diagram iterated together; Ctrl-C takes effect between two parts."""
RHO, OFFSET = (-0.02, 0.1), (-0.01, 0.12)
"""Default ranges of the diagrams."""
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
"""Variables of an impact map; the variables of grazes exist with the kind `discontinuity`."""
_SETS = {
    "grazes": "graze_phase",
    **{name: name for name in ("before_phase", "before_velocity", "after_phase", "after_velocity")},
}
"""Variables of the sets of grazing impacts, with the names of their attributes."""
NORDMARK = ResultTable(
    "maps",
    ("rho", "rho", "1", "distance from the graze in Nordmark's map"),
    ("x", "rho step", "1", "virtual penetration in Nordmark's map"),
    ("forcing_amplitude", "rho", "N", "forcing amplitude"),
)
"""Variables of the diagram of Nordmark's map; `forcing_amplitude` exists with a scene."""
SQUARE_ROOT = ResultTable(
    "maps",
    ("d", "d", "1", "offset of the square-root map"),
    ("x", "d step", "1", "state of the square-root map"),
)
"""Variables of the diagram of the square-root map."""


@dataclass(frozen=True, slots=True)
class MapSettings:
    """Kind of a map, and its numbers.

    Attributes
    ----------
    kind : {"impact", "strobe", "discontinuity", "nordmark", "square-root"}
    span : tuple of float, or None
        Range of rho (nordmark) or d (square-root).
    points : int
        Number of values in the range, or of phases in the sets of `discontinuity`.
    alpha, gamma, restitution : float or None
        Numbers of the Nordmark map; None: from the scene.
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
        """Raise UsageError unless the settings fit the kind of map."""
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
    """Return checked settings for a kind given as text.

    Raises
    ------
    UsageError
        The settings fit no map.
    """
    settings = MapSettings(cast("MapKind", kind), **options)
    settings.refuse()
    return settings


@dataclass(eq=False)
class MapOfScene(Study[str]):
    """The points of a map, to be drawn: see `vibroimpact.maps`. A row is the name of a finished part."""

    name = "maps"
    nothing = "a map"
    history = HISTORY

    scene: Scene | None
    settings: MapSettings

    def __post_init__(self) -> None:
        self.values: dict[str, Any] = {}
        self.attributes: dict[str, Any] = {}

    @classmethod
    def reads(cls, options: Maps) -> Sequence[Path]:
        """Return the scene, if there is one."""
        return [] if options.scene is None else [options.scene]

    @classmethod
    def marks(cls, options: Maps) -> Mapping[str, Any]:
        """Return the path of the scene."""
        return {} if options.scene is None else super().marks(options)

    @classmethod
    def prepare(cls, options: Maps, stack: ExitStack) -> Self:
        """Open the scene."""
        settings = _settings(options)
        if options.scene is not None:
            return cls(opened_scene(options.scene, options.changes or ()), settings)
        if options.changes:
            raise UsageError("--set: expected a scene to change, got none.")
        return cls(None, settings)

    def rows(self) -> Generator[str, None, None]:
        """Find the parts of the map, one after the other.

        UsageError: the scene has no such map. OrbitError: the map needs one mode, and the body has several.
        """
        kind = self.settings.kind
        if kind == "square-root":
            yield from self._square_root()
        elif kind == "nordmark":
            yield from self._nordmark()
        else:
            yield from self._of_impacts(_needed(self.scene, self.settings))

    def made(self) -> xr.Dataset:
        """Return the points."""
        tables = {"strobe": STATES, "nordmark": NORDMARK, "square-root": SQUARE_ROOT}
        scene, kind = self.scene, self.settings.kind
        units: UnitSystem = "SI" if scene is None else scene.units
        found = tables.get(kind, IMPACTS).dataset(self.values, self.attributes, units=units)
        attributes: dict[str, Any] = {}
        if scene is not None:
            attributes = scene_attributes(scene, HISTORY) | {"units_system": scene.units}
        return found.assign_attrs(attributes | {"map": kind, "history": HISTORY})

    def print_results(self) -> None:
        """Print a summary of the map."""
        _print_map(self.dataset)

    def _of_impacts(self, scene: Scene) -> Generator[str, None, None]:
        is_strobe, has_sets = self.settings.kind == "strobe", self.settings.kind == "discontinuity"
        body = impacting_body(scene, yielding=not has_sets)
        if has_sets:
            one_mode(body)  # refused before any computation
            self.values |= dict.fromkeys(_SETS.values(), np.empty(0))
        across = "displacement" if is_strobe else "phase"
        states = _run(scene, strobe=is_strobe)
        self._mark([], across)
        self.values |= {across: states[:, 0], "velocity": states[:, 1]}
        yield "states"
        with suppress(OrbitError):  # a body without losses has families of orbits: no single orbit to mark
            self._mark(find_orbits(scene, 1, 1), across)
        yield "orbits"
        if has_sets:
            found = grazing_sets(body, self.settings.points)
            self.values |= {name: getattr(found, where) for where, name in _SETS.items()}
            yield "sets"

    def _mark(self, orbits: Sequence[PeriodicOrbit], across: str) -> None:
        of = _strobed if across == "displacement" else _impact
        marks = np.array([of(orbit) for orbit in orbits]).reshape(-1, 2)
        self.values |= {
            f"orbit_{across}": marks[:, 0],
            "orbit_velocity": marks[:, 1],
            "orbit_name": [_named(orbit) for orbit in orbits],
        }

    def _nordmark(self) -> Generator[str, None, None]:
        chosen, family = _nordmark(self.scene, self.settings)
        self.attributes = {"alpha": chosen.alpha, "gamma": chosen.gamma, "restitution": chosen.restitution}
        if family is not None:
            self.attributes |= {"grazing_amplitude": family.amplitude, "rho_slope": family.slope}
        if chosen.oscillator is not None:
            ratio, frequency = chosen.oscillator
            self.attributes |= {"oscillator_damping_ratio": ratio, "oscillator_frequency_ratio": frequency}
        self.attributes |= {"root_sign": chosen.sign}
        for rho in self._diagram("rho", RHO, chosen.diagram):
            if family is not None:
                self.values["forcing_amplitude"] = family.amplitude_of(rho)
            yield "rho"

    def _square_root(self) -> Generator[str, None, None]:
        slope = 0.5 if self.settings.slope is None else self.settings.slope
        self.attributes = {"slope": slope}
        for _ in self._diagram("d", OFFSET, partial(square_root_diagram, slope)):
            yield "d"

    def _diagram(
        self, name: str, span: tuple[float, float], states_at: Callable[[Floats], Floats]
    ) -> Iterator[Floats]:
        """Yield the diagram's values, part after part, each time its states are known."""
        values = np.linspace(*(self.settings.span or span), self.settings.points)
        parts: list[Floats] = []
        for begin in range(0, values.size, PART):
            parts.append(states_at(values[begin : begin + PART]))
            self.values = {name: values[: begin + PART], "x": np.concatenate(parts)}
            yield self.values[name]


def _needed(scene: Scene | None, settings: MapSettings) -> Scene:
    if scene is None:
        raise UsageError(f"maps: scene: expected one for the kind {settings.kind}, got none.")
    return scene.unswept()


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
    """Return the class and name of an orbit: by its two multipliers for one mode, else by its stability."""
    multipliers = orbit.multipliers
    if multipliers.size != 2 or not np.isfinite(multipliers).all():
        return f"{CLASSES[orbit.is_stable]} {orbit.name}"
    if multipliers[0].imag != 0.0:
        return f"{CLASSES[orbit.is_stable]} focus {orbit.name}"
    if orbit.is_stable:
        return f"stable node {orbit.name}"
    return f"{'flip ' if multipliers[0].real < 0.0 else ''}saddle {orbit.name}"


def _impact(orbit: PeriodicOrbit) -> tuple[float, float]:
    return np.mod(orbit.phases[0], TURN), orbit.velocities[0]


def _nordmark(scene: Scene | None, settings: MapSettings) -> tuple[Nordmark, GrazingFamily | None]:
    """Return Nordmark's map, and for a map from a scene its path to the graze."""
    if settings.alpha is not None and settings.gamma is not None:
        restitution = 1.0 if settings.restitution is None else settings.restitution
        return Nordmark(settings.alpha, settings.gamma, restitution), None
    alone = _needed(scene, settings)
    if alone.body.IS_STRUCTURE:
        raise UsageError(
            f"{alone.source}: body.kind: expected an oscillator for Nordmark's map, got another body."
        )
    amplitude = float_parameters(alone, None)["forcing.amplitude"]
    if amplitude == 0.0:
        raise UsageError(f"{alone.source}: forcing.amplitude: expected a force, got 0.")
    family = grazing_family(impacting_body(alone), amplitude)
    if settings.restitution is not None:
        raise UsageError("maps: restitution: expected with alpha and gamma, got it with those of the scene.")
    return family.map, family


def _settings(options: Maps) -> MapSettings:
    start, stop = options.start, options.stop
    if (start is None) != (stop is None):
        raise UsageError("maps: from, to: expected both or neither, got one of them.")
    return settings_of(
        options.kind,
        span=None if start is None or stop is None else (start, stop),
        points=options.points,
        alpha=options.alpha,
        gamma=options.gamma,
        restitution=options.restitution,
        slope=options.slope,
    )


def _print_map(found: xr.Dataset) -> None:
    kind = found.attrs["map"]
    if kind in ("nordmark", "square-root"):
        _print_diagram(found, "rho" if kind == "nordmark" else "d")
        return
    say(f"{counted(found.sizes['state'], 'state' if kind == 'strobe' else 'impact')} of a run.")
    for name in found["orbit_name"].values:
        say(f"{name}")
    if kind == "discontinuity":
        say(
            f"S has {int(np.isfinite(found['before_velocity']).sum())} points, W "
            f"{int(np.isfinite(found['after_velocity']).sum())}, of {found.sizes['graze']} grazes."
        )


def _print_diagram(found: xr.Dataset, name: str) -> None:
    if name == "rho":
        numbers = {key: float(found.attrs[key]) for key in ("alpha", "gamma", "restitution")}
        say(", ".join(f"{key} {value:.8g}" for key, value in numbers.items()) + ".")
        if "grazing_amplitude" in found.attrs:
            say(f"Graze at the forcing amplitude {float(found.attrs['grazing_amplitude']):.12g}.")
        elif "oscillator_damping_ratio" in found.attrs:
            ratio, frequency = (
                float(found.attrs[f"oscillator_{key}_ratio"]) for key in ("damping", "frequency")
            )
            say(
                f"An oscillator of damping ratio {ratio:.8g} has these, forced at {frequency:.8g} times its frequency."
            )
        else:
            say("No oscillator has these: expected -2 sqrt(gamma) <= alpha < 1 + gamma.")
    states = found["x"].values
    bounded = np.isfinite(states).all(axis=1)
    periods = periods_of(np.nan_to_num(states))
    values = found[name].values
    runs: list[str] = []
    edges = np.flatnonzero(np.diff(periods, prepend=-1) != 0)
    for begin, end in zip(edges, [*edges[1:], len(values)], strict=True):
        if end - begin >= max(3, len(values) // 100) and bounded[begin:end].all():
            what = f"period {periods[begin]}" if periods[begin] else "no period"
            runs.append(f"{what} from {values[begin]:.4g} to {values[end - 1]:.4g}")
    if runs:
        say(f"{name}: " + "; ".join(runs) + ".")
