"""An unstable orbit that is kept by its forcing amplitude while the angular frequency changes: thesis 3.5.2.

The components are coupled as any others: body and stop, which answers its impacts, and a controller, which answers each
impact by the force of the next flight. Nothing here iterates a map.
"""

from __future__ import annotations

import dataclasses
import json
import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.results import Row, described
from vibroimpact.analysis.orbits import ImpactingBody, OrbitError, PeriodicOrbit, find_orbit
from vibroimpact.analysis.orbits.feedback import LAWS, Law, gains, impact_map
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.python_fmus import build_orbit_controller
from vibroimpact.fmus.shipped import fmu_path
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.orbits.bodies import impacting_body
from vibroimpact.orchestrator.orbits.follow import scene_attributes
from vibroimpact.orchestrator.run.parameters import LAW_NUMBERS, float_parameters, integer_parameters
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import OscillatorBody

HISTORY = "periodic orbits kept by vibroimpact"
EXTERNAL_LAW = 5
MOST_ROWS = 100_000
LONGEST_STAY = 500
"""Impacts at one angular frequency after which the orbit is taken not to settle."""
AT_THE_END = 20
"""Impacts at the last angular frequency of a plan."""
NEAREST = 1e-10
"""Distance, rad/s, to which the end of a branch is narrowed down, relative."""
CHUNK = 16
"""Forcing periods between two looks at the controller."""

Told = Callable[[float, int], None]
"""Called with the angular frequency reached and the number of impacts so far."""


@dataclass(frozen=True, slots=True)
class ControlSettings:
    """How an orbit is kept.

    Attributes
    ----------
    law : {"ogy", "deadbeat", "newton"}
    step : float
        Of the angular frequency, rad/s.
    tolerance : float
        Difference of two speeds in a row, over that of the orbit, at which the frequency goes on.
    limit : float
        Largest correction over the forcing amplitude; 0: nothing is corrected.
    noise : float
        Standard deviation of the error of measured speeds, relative.
    seed : int
        Of the noise.
    periods : int
        q of the orbit P(1,q).
    stay : int
        Flights at each angular frequency at least.
    """

    law: Law = "ogy"
    step: float = 1e-4
    tolerance: float = 1e-4
    limit: float = 0.1
    noise: float = 0.0
    seed: int = 1
    periods: int = 1
    stay: int = 1

    def refuse(self) -> None:
        """Refuse numbers that no control has.

        Raises
        ------
        UsageError
        """
        if self.law not in LAWS:
            raise UsageError(f"control: law: expected one of {', '.join(LAWS)}, got {self.law!r}.")
        for name in ("step", "tolerance"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise UsageError(
                    f"control: {name}: expected a finite number > 0, got {getattr(self, name):g}."
                )
        for name in ("limit", "noise"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise UsageError(
                    f"control: {name}: expected a number from 0 to 1, got {getattr(self, name):g}."
                )
        if abs(self.seed) >= 2**31:
            raise UsageError(f"control: seed: expected a whole number of 32 bits, got {self.seed}.")
        for name, most in (("periods", 64), ("stay", LONGEST_STAY // 2)):
            if not 1 <= getattr(self, name) <= most:
                got = getattr(self, name)
                raise UsageError(f"control: {name}: expected a whole number from 1 to {most}, got {got}.")


def settings_of(law: str = "ogy", **numbers: Any) -> ControlSettings:
    """Return settings whose law comes from outside.

    Raises
    ------
    UsageError
        They are none that a control has.
    """
    settings = ControlSettings(cast("Law", law), **numbers)
    settings.refuse()
    return settings


@dataclass(frozen=True, eq=False)
class ControlPlan:
    """The orbits that are kept, one after the other, and the gains about each.

    Attributes
    ----------
    scene : Scene
    settings : ControlSettings
    amplitude : float
        Forcing amplitude, N.
    orbits : list of PeriodicOrbit
        One at each angular frequency.
    ends_at : float or None
        Angular frequency at which the branch ends, rad/s; None where it goes on beyond the plan.
    """

    scene: Scene
    settings: ControlSettings
    amplitude: float
    orbits: list[PeriodicOrbit]
    ends_at: float | None

    @property
    def rows(self) -> list[dict[str, Any]]:
        """What the controller is given of each orbit."""
        return [_row(orbit, self.amplitude, self.settings.law) for orbit in self.orbits]

    def controller(self, output: Path) -> Path:
        """Write the controller's FMU.

        Raises
        ------
        ComponentError
            pythonfmu is not installed.
        """
        settings = self.settings
        largest = max(float(orbit.velocities[0]) for orbit in self.orbits)
        return build_orbit_controller(
            {
                "law": settings.law,
                "periods": settings.periods,
                "stay": settings.stay,
                "amplitude": self.amplitude,
                "tolerance": settings.tolerance * largest,
                "limit": settings.limit * abs(self.amplitude),
                "rows": self.rows,
            },
            output,
        )


def _row(orbit: PeriodicOrbit, amplitude: float, law: Law) -> dict[str, Any]:
    about = impact_map(orbit, amplitude)
    gain = gains(law, about)
    return {
        "angular_frequency": orbit.body.angular_frequency,
        "phase": float(orbit.phases[0]),
        "velocity": float(orbit.velocities[0]),
        "gain_time": float(gain[0]),
        "gain_velocity": float(gain[1]),
        "jacobian": about.jacobian.tolist(),
        "response": about.response.tolist(),
    }


def control_plan(scene: Scene, start: float, stop: float, settings: ControlSettings) -> ControlPlan:
    """Return the orbits P(1,q) from one angular frequency to another, as far as their branch goes.

    Parameters
    ----------
    scene : Scene
        An oscillator on restitution stops under a harmonic force; its sweep is left out.
    start, stop : float
        rad/s.
    settings : ControlSettings

    Raises
    ------
    UsageError
        The scene has no orbits that this keeps.
    OrbitError
        There is none at the start.
    """
    settings.refuse()
    alone = scene.with_sweep({}) if scene.sweep else scene
    if not isinstance(alone.body, OscillatorBody):
        raise UsageError(
            f"{scene.source}: body.kind: expected an oscillator, whose state an impact tells, got another body."
        )
    if alone.exciter is not None:
        raise UsageError(f"{scene.source}: exciter: expected none where an orbit is kept, got one.")
    body = impacting_body(alone)
    amplitude = float_parameters(alone, None)["forcing.amplitude"]
    for name, value in (("from", start), ("to", stop)):
        if not (value > 0.0 and np.isfinite(value)):
            raise UsageError(f"control: {name}: expected an angular frequency > 0, got {value:g}.")
    if amplitude == 0.0:
        raise UsageError(f"{scene.source}: forcing.amplitude: expected a force to control, got 0.")
    count = int(np.ceil(abs(stop - start) / settings.step - 1e-9))
    if count > MOST_ROWS:
        raise UsageError(
            f"control: step: expected {MOST_ROWS} steps at most, got {count}. Take larger steps."
        )
    first = _first(_at(body, start), settings.periods)
    orbits = [first]
    signed = np.sign(stop - start) * settings.step
    for number in range(1, count + 1):
        value = stop if number == count else start + number * signed
        found = _next(orbits[-1], value)
        if found is None:
            return ControlPlan(alone, settings, amplitude, orbits, _end_of_branch(orbits[-1], value))
        orbits.append(found)
    return ControlPlan(alone, settings, amplitude, orbits, None)


def _at(body: ImpactingBody, angular_frequency: float) -> ImpactingBody:
    return dataclasses.replace(body, angular_frequency=angular_frequency)


def _first(body: ImpactingBody, periods: int) -> PeriodicOrbit:
    found = orbits_of(body, 1, periods)
    if not found:
        raise OrbitError(
            f"control: expected an orbit P(1,{periods}) to keep at {body.angular_frequency:g}, got none there. "
            "Ask follow where there are some."
        )
    # of several the one that is least unstable
    return min(found, key=lambda orbit: float(np.abs(orbit.multipliers[0])))


def _next(orbit: PeriodicOrbit, angular_frequency: float) -> PeriodicOrbit | None:
    """Return the orbit of the same branch at another angular frequency; None where there is none."""
    try:
        found = find_orbit(
            _at(orbit.body, angular_frequency), orbit.phases, orbit.contacts.tolist(), orbit.periods
        )
    except OrbitError:
        return None
    return found if found.velocities[0] > 0.0 and found.is_physical else None


def _end_of_branch(orbit: PeriodicOrbit, beyond: float) -> float:
    """Return where a branch ends between an orbit and an angular frequency without one."""
    while abs(beyond - orbit.body.angular_frequency) > NEAREST * orbit.body.angular_frequency:
        middle = 0.5 * (beyond + orbit.body.angular_frequency)
        found = _next(orbit, middle)
        if found is None:
            beyond = middle
        else:
            orbit = found
    return orbit.body.angular_frequency


@dataclass(slots=True)
class Controlled:
    """What became of a plan.

    Attributes
    ----------
    plan : ControlPlan
    impacts : list of tuple
        Of each: time (s), phase (rad), speed (m/s), and of the flight that led to it forcing amplitude (N), angular
        frequency (rad/s) and row of the plan.
    end : str
        Why it ended.
    """

    plan: ControlPlan
    impacts: list[tuple[float, ...]] = field(default_factory=list)
    end: str = "interrupted"

    @property
    def reached(self) -> float:
        """Angular frequency of the last flight, rad/s."""
        at = self.impacts[-1][4] if self.impacts else self.plan.orbits[0].body.angular_frequency
        return float(at)

    @property
    def kept_to(self) -> float | None:
        """Angular frequency of the last orbit that was kept over two impacts and more, rad/s; None of none."""
        rows = [int(impact[5]) for impact in self.impacts]
        visits = Counter(rows)
        lost = self.end.startswith("lost")
        kept = [row for row in sorted(visits) if visits[row] >= 2 and not (lost and row == rows[-1])]
        return self.plan.orbits[kept[-1]].body.angular_frequency if kept else None

    @property
    def dataset(self) -> xr.Dataset:
        """Impacts and orbits."""
        return _dataset(self)


def run_plan(plan: ControlPlan, told: Told | None = None, *, into: Controlled | None = None) -> Controlled:
    """Couple body, stop and controller and let them go through a plan.

    Parameters
    ----------
    plan : ControlPlan
    told : callable, optional
        Where it is.
    into : Controlled, optional
        Grows meanwhile: what Ctrl-C leaves.

    Raises
    ------
    ComponentError
        pythonfmu is not installed; or a component fails.
    """
    found = Controlled(plan) if into is None else into
    with tempfile.TemporaryDirectory() as folder:
        controller = plan.controller(Path(folder, "controller.fmu"))
        components, connections = coupled(plan, controller)
        importer = Importer(components, connections, macro_step=plan.orbits[0].body.period)
        try:
            _run(importer, found, told)
        finally:
            importer.free()
    return found


def coupled(plan: ControlPlan, controller: Path) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return the components and connections of a plan, which begin on its first orbit."""
    scene, orbit, settings = plan.scene, plan.orbits[0], plan.settings
    port = f"contact[{int(orbit.contacts[0]) + 1}]"
    numbers: dict[str, float | int | bool | str] = {
        **float_parameters(scene, None),
        **integer_parameters(scene),
    }
    contact = orbit.body.contacts[int(orbit.contacts[0])]
    numbers |= {
        f"{port}.law": EXTERNAL_LAW,
        "forcing.angular_frequency": orbit.body.angular_frequency,
        "forcing.phase": float(orbit.phases[0]),
        "displacement_start": contact.position,
        "velocity_start": -contact.direction * contact.restitution * float(orbit.velocities[0]),
    }
    stop = {"law": LAW_NUMBERS["restitution"], "restitution": contact.restitution}
    errors = {"noise": settings.noise, "seed": settings.seed}
    components = [
        ComponentSpec("body", fmu_path("Oscillator"), numbers),
        ComponentSpec("stop", fmu_path("ImpactStop"), stop),
        ComponentSpec("controller", controller, errors),
    ]
    pairs = [
        (f"body.{port}.displacement", "stop.displacement"),
        (f"body.{port}.velocity", "stop.velocity"),
        ("stop.applied_restitution", f"body.{port}.applied_restitution"),
        *((f"body.{port}.{name}", f"controller.{name}") for name in _SEEN),
        ("controller.forcing_amplitude", "body.forcing.amplitude"),
        ("controller.forcing_angular_frequency", "body.forcing.angular_frequency"),
    ]
    return components, [ConnectionSpec(_split(source), _split(target)) for source, target in pairs]


def coupled_scene(plan: ControlPlan, controller: str) -> str:
    """Return a scene of the coupled components, whose controller is the FMU of this name beside it."""
    components, connections = coupled(plan, Path(controller))
    title = f"{plan.scene.title or Path(plan.scene.source).stem}: an orbit that is kept"
    lines = ["[scene]", f"title = {json.dumps(title)}", f'units = "{plan.scene.units}"', ""]
    files = {"body": "Oscillator", "stop": "ImpactStop", "controller": controller}
    for component in components:
        values = (f"{json.dumps(name)} = {json.dumps(value)}" for name, value in component.parameters.items())
        lines += [
            f"[component.{component.name}]",
            f"fmu = {json.dumps(files[component.name])}",
            f"parameters = {{ {', '.join(values)} }}",
            "",
        ]
    for connection in connections:
        source, target = ".".join(connection.source), ".".join(connection.target)
        lines += ["[[connection]]", f"from = {json.dumps(source)}", f"to = {json.dumps(target)}", ""]
    period = plan.orbits[0].body.period
    seen = [
        *(f"controller.{name}" for name in ("row", "correction", "kept")),
        "body.displacement",
        "body.velocity",
    ]
    lines += [
        "[record]",
        f"recorded_time = {float(4.0 * len(plan.orbits) * plan.settings.periods * plan.orbits[-1].body.period)!r}",
        f"variables = {json.dumps(seen)}",
        "rate = 4",
        "events = true",
        "",
        "[execution]",
        'how = "coupled"',
        f"macro_step = {float(period)!r}",
        "",
    ]
    return "\n".join(lines)


_SEEN = ("count", "last_time", "last_phase", "last_velocity")


def _split(reference: str) -> tuple[str, str]:
    component, _, variable = reference.partition(".")
    return component, variable


def _run(importer: Importer, found: Controlled, told: Told | None) -> None:
    plan = found.plan
    body, controller = importer.components["body"], importer.components["controller"]
    port = f"contact[{int(plan.orbits[0].contacts[0]) + 1}]"
    seen = body.group("Float64", [f"{port}.{name}" for name in _SEEN[1:]])
    force = body.group("Float64", ["forcing.amplitude", "forcing.angular_frequency"])
    count = body.group("Int64", [f"{port}.{_SEEN[0]}"])
    row = controller.group("Int64", ["row"])
    kept = controller.group("Boolean", ["kept"])
    stay = [0, -1]  # impacts at this row

    def note(_: object) -> None:
        # the controller has not seen this impact yet: force and row are those of the flight that led here
        if int(count.get()[0]) == len(found.impacts):
            return  # initialization ends in event mode, too
        seen.get()
        force.get()
        row.get()
        at = int(row.values[0])
        stay[:] = [stay[0] + 1 if at == stay[1] else 1, at]
        found.impacts.append((*map(float, seen.values), *map(float, force.values), float(at)))

    importer.on_event = note
    importer.begin(0.0)
    last = len(plan.orbits) - 1
    while True:
        before = len(found.impacts)
        longest = plan.orbits[stay[1] if stay[1] >= 0 else 0].body.period
        importer.advance(importer.time + CHUNK * plan.settings.periods * longest)
        kept.get()
        if told is not None:
            told(found.reached, len(found.impacts))
        if not kept.values[0]:
            found.end = "lost: an impact came a quarter of a period off"
        elif len(found.impacts) == before:
            found.end = "lost: no impacts any more"
        elif stay[1] == last and stay[0] >= AT_THE_END:
            found.end = "kept to the end of the plan"
        elif stay[0] > LONGEST_STAY:
            found.end = f"not settled: {LONGEST_STAY} impacts at one angular frequency"
        else:
            continue
        return


def _dataset(found: Controlled) -> xr.Dataset:
    plan = found.plan
    plain = plan.scene.units == "nondimensional"
    units = {name: "1" if plain else unit for name, unit in _UNITS.items()}
    table = np.array(found.impacts, dtype=np.float64).reshape(-1, 6)
    at = table[:, 5].astype(np.int64)
    multipliers = np.array([abs(orbit.multipliers[0]) for orbit in plan.orbits])
    visits = np.bincount(at, minlength=len(plan.orbits)) if at.size else np.zeros(len(plan.orbits), np.int64)
    rows: dict[str, Row] = {
        "impact_time": ("impact", table[:, 0], units["time"], "time of the impact"),
        "impact_phase": ("impact", table[:, 1], "1" if plain else "rad", "forcing phase of the impact"),
        "impact_velocity": ("impact", table[:, 2], units["velocity"], "impact velocity"),
        "forcing_amplitude": (
            "impact",
            table[:, 3],
            units["force"],
            "forcing amplitude of the flight before",
        ),
        "correction": (
            "impact",
            table[:, 3] / plan.amplitude - 1.0,
            "1",
            "correction of the forcing amplitude, relative",
        ),
        "angular_frequency": ("impact", table[:, 4], units["rate"], "angular frequency of the flight before"),
        "impact_orbit": ("impact", at, "1", "number of the orbit that was kept then, from 0"),
        "orbit_angular_frequency": (
            "orbit",
            np.array([orbit.body.angular_frequency for orbit in plan.orbits]),
            units["rate"],
            "angular frequency of the orbit",
        ),
        "orbit_velocity": (
            "orbit",
            np.array([float(orbit.velocities[0]) for orbit in plan.orbits]),
            units["velocity"],
            "impact velocity of the orbit",
        ),
        "orbit_multiplier": ("orbit", multipliers, "1", "size of the largest multiplier"),
        "orbit_impacts": ("orbit", visits, "1", "impacts at this orbit"),
    }
    settings = {
        f"control_{f.name}": getattr(plan.settings, f.name) for f in dataclasses.fields(plan.settings)
    }
    ends = {} if plan.ends_at is None else {"branch_ends_at": plan.ends_at}
    return xr.Dataset(described(rows)).assign_attrs(
        scene_attributes(plan.scene, HISTORY)
        | settings
        | ends
        | ({} if found.kept_to is None else {"kept_to": found.kept_to})
        | {
            "reached": found.reached,
            "end": found.end,
            "units_system": plan.scene.units,
            "amplitude": plan.amplitude,
        }
    )


_UNITS = {"time": "s", "velocity": "m s-1", "force": "N", "rate": "rad s-1"}


def control(
    scene: Scene,
    start: float,
    stop: float,
    *,
    law: Law = "ogy",
    step: float = 1e-4,
    tolerance: float = 1e-4,
    limit: float = 0.1,
    noise: float = 0.0,
    seed: int = 1,
    periods: int = 1,
    stay: int = 1,
) -> xr.Dataset:
    """Keep an orbit P(1,q) from one angular frequency to another by the forcing amplitude.

    Parameters
    ----------
    scene : Scene
        An oscillator on restitution stops under a harmonic force.
    start, stop : float
        Angular frequencies, rad/s.
    law : {"ogy", "deadbeat", "newton"}
        What is done about a deviation at an impact: the next one is put on the direction that comes back faster; the
        orbit is reached two impacts later; as the first, about an orbit that is located from the last two impacts.
    step : float
        Of the angular frequency, rad/s.
    tolerance : float
        Difference of two speeds in a row, over that of the orbit, at which the frequency goes on.
    limit : float
        Largest correction over the forcing amplitude; 0: nothing is corrected.
    noise : float
        Standard deviation of the error of measured speeds, relative.
    seed : int
        Of the noise.
    periods : int
        q.
    stay : int
        Flights at each angular frequency at least.

    Returns
    -------
    xarray.Dataset
        Along `impact` what came (`impact_velocity`, `correction`, ...), along `orbit` what was to be kept; attributes
        `kept_to` (rad/s) and `end` say how far it was kept and why not further, `branch_ends_at` where there is no
        such orbit any more.

    Raises
    ------
    UsageError
        The scene has no orbits that this keeps.
    OrbitError
        There is none at the start.
    ComponentError
        pythonfmu is not installed.
    """
    settings = ControlSettings(law, step, tolerance, limit, noise, seed, periods, stay)
    return run_plan(control_plan(scene, start, stop, settings)).dataset
