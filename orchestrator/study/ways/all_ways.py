"""The ways to simulate a scene, each with the settings that trade accuracy for time."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.importer.described import description_of
from vibroimpact.orchestrator.run.limits import why_not_pushed, why_not_thrown_back
from vibroimpact.orchestrator.run.parameters import float_parameters
from vibroimpact.orchestrator.run.window import recorded_window
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.laws import all_rigid, any_rigid, integrates_contacts
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.study.ways.models import other_models, other_modes
from vibroimpact.orchestrator.study.ways.numbers_of_modes import numbers_of_modes
from vibroimpact.orchestrator.study.ways.plain_steps import PlainForcesTrial, PlainStepsTrial
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial, rates_of
from vibroimpact.orchestrator.study.ways.revision import RevisedTrial
from vibroimpact.orchestrator.study.ways.sampled import SampledTrial
from vibroimpact.orchestrator.study.ways.trials import CoupledTrial, ModelExchangeTrial
from vibroimpact.orchestrator.study.ways.way import (
    Opener,
    Trial,
    Way,
    can_have,
    own_step,
    time_scale,
    way_by_scene,
)

CONTACT_TOLERANCES = (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
INTEGRATOR_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10)
STEPS_A_PERIOD = (23, 61, 211, 1009, 5003)
"""Numbers of plain steps of equal size in a period, or in the time scale of an unforced scene. They are primes, so
that steps do not fall on the same phases in each period."""
GENERAL_REFINEMENTS = (8.0, 4.0, 2.0, 1.0, 0.5, 0.25, 0.125)
"""Macro steps of a general scene, over its own macro step."""
COUPLING_TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
"""Tolerances of the steps of a general scene that an error estimate chooses."""
COUPLED_REFINEMENTS = (math.nan, 1e-2, 1e-3)
"""Macro steps of coupled compliant contacts, over the period; NaN: only the steps of the contact itself."""
LEAST_SAMPLES, MOST_SAMPLES = 64, 10**6
"""Least and largest number of samples of a run; rates with fewer or more samples are not tried."""
EXCHANGES = ("jacobi", "gauss_seidel", "iterated")
REVISED_STEPS = (0.2, 0.02)
"""Longest steps of step revision, over the period: both with rigid stops, the first with compliant stops."""
REVISED_CONTACT_STEPS = (10.0, 40.0, 160.0, 640.0)
"""Numbers of steps of step revision in a contact with a compliant stop."""
SAMPLING = (1.0 / 16.0, 0.25, 1.0, 4.0, 16.0)
"""Sample rates of a run's record, over the scene's own rate."""


def ways_of(
    scene: Scene,
    *,
    speed: float = math.nan,
    rate: float = math.nan,
    whole: Scene | None = None,
    finest: Mapping[int, Modes] | None = None,
    recorded: Scene | None = None,
) -> list[Way]:
    """Return the ways to simulate a scene without a sweep, with their settings.

    `speed` is the typical impact speed, m/s, at which other contact laws get the same restitution. `rate` is the rate
    of the scene's time series, samples per s; NaN without one. `whole` is the scene with its transient, where `scene`
    begins after the transient: other models pass a transient of their own. `finest` are the most modes of bodies by
    matrices (`finest_modes`). `recorded` is the scene with all of its recording, where `scene` has the first impacts.
    """
    if not scene.is_one_body:
        return _general_ways(scene)
    if isinstance(scene.body, StructureBody):
        replays = [] if scene.replay is None else _fewer_samples(scene)
        own = whole or scene
        return [*_fused(scene), *replays, *numbers_of_modes(own, finest or {}, recorded or own)]
    if scene.replay is not None:
        return [*_fused(scene), *_coupled_replay(scene), *_fewer_samples(scene), *other_modes(scene)]
    return [
        *_fused(scene),
        *_coupled(scene),
        *_revised(scene),
        *_plain_steps(scene),
        *_integrated(scene),
        *_read_off_samples(scene, rate),
        *other_models(whole or scene, speed),
    ]


def remarks_on(scene: Scene) -> list[str]:
    """Return remarks on the ways that the study of a scene leaves out, with the reasons."""
    remarks = []
    if scene.is_one_body and isinstance(scene.body, StructureBody):
        return _remarks_on_structures(scene)
    if fixed := _not_repeated(scene):
        remarks.append(
            f"iterated exchange with {', '.join(fixed)}: steps cannot be repeated, since the FMU does not restore its "
            "state; it is stepped once, last, with the newest values, in each of the exchanges"
        )
    plain = scene.is_lone_body and scene.stops
    if plain:
        remarks += _remarks_on_strangers(scene)
    if plain and not scene.body.HAS_MASSES:
        remarks.append(
            "stops of other laws: the mass that hits a stop is that of the modes, and with it restitution depends on "
            "their number"
        )
    if scene.is_one_body and not scene.body.HAS_MASSES and any_rigid(scene.stops):
        remarks.append(
            "number of modes: nothing converges, since the contact mass of a rigid stop on a beam falls with the "
            "number of modes and its restitution has no meaning without it (docs/contact_laws.md); compliant stops do"
        )
    return remarks


def _remarks_on_structures(scene: Scene) -> list[str]:
    """Return remarks on the ways that leave out several bodies, forces that are no single sine, and moving stops."""
    remarks = [
        "stops as FMUs of their own, plain steps, step revision and model exchange: several bodies, several forces, "
        "forces that are no sine, given modes and stops that move run fused, which is exact between impacts"
    ]
    body: Any = scene.body
    if any_rigid(scene.stops) and any(not part.HAS_MASSES for part in body.parts):
        remarks.append(
            "impacts one by one with other numbers of modes: an impact on a rigid stop excites all modes, and the mass "
            "that hits it falls with their number (docs/contact_laws.md). Range and mean energy are compared"
        )
    return remarks


def _remarks_on_strangers(scene: Scene) -> list[str]:
    """Return remarks on left-out ways whose body has no stops in its FMU, with the reasons."""
    pushed = why_not_pushed(scene)
    rigid = all_rigid(scene.stops)
    thrown_back = why_not_thrown_back(scene) if rigid else pushed
    if any_rigid(scene.stops) and not rigid:
        thrown_back = "some stops are rigid and others yield"
    if pushed and pushed == thrown_back:
        return [f"plain steps of equal size and step revision: {pushed}"]
    left_out = {"plain steps of equal size": thrown_back, "step revision": pushed}
    return [f"{way}: {why}" for way, why in left_out.items() if why]


def _opens(kind: Callable[..., Trial], *arguments: Any) -> Opener:
    """Return the opener of a kind of trial with these arguments."""

    def opened(wrap: Wrapper | None, part: float = 1.0) -> Trial:
        return kind(*arguments, wrap=wrap, part=part)

    return opened


def _fused(scene: Scene) -> list[Way]:
    how = {"execution.how": "fused"}
    if not integrates_contacts(scene.stops):
        return [way_by_scene("fused", "", math.nan, scene, how)]
    return [
        way_by_scene(
            "fused", "contact_tolerance", value, scene, {**how, "execution.contact_tolerance": value}
        )
        for value in CONTACT_TOLERANCES
    ]


def _coupled(scene: Scene) -> list[Way]:
    if not scene.stops or _has_memory(scene):
        return []
    yields = not all_rigid(scene.stops)
    ways = []
    for version in ("3.0", "2.0"):
        name = f"coupled, FMI {version}"
        for part in COUPLED_REFINEMENTS if yields else (math.nan,):
            step = math.nan if math.isnan(part) else part * time_scale(scene)
            changes: dict[str, Any] = {"execution.how": "coupled"}
            if not math.isnan(step):
                changes["execution.macro_step"] = step
            made = scene.with_values(changes)
            own = changes if version == "3.0" else {}
            ways.append(
                Way(
                    name,
                    "" if math.isnan(step) else "macro_step",
                    step,
                    own,
                    _opens(CoupledTrial, made, version),
                )
            )
    return ways


def _coupled_replay(scene: Scene) -> list[Way]:
    """Return the way in which the body, its stops and the recording are separate FMUs."""
    if _has_memory(scene):
        return []
    return [way_by_scene("coupled, FMI 3.0", "", math.nan, scene, {"execution.how": "coupled"})]


def _fewer_samples(scene: Scene) -> list[Way]:
    return [
        Way("fewer samples", "samples per s", rate, {}, _opens_replay(scene, every))
        for every, rate in rates_of(scene).items()
    ]


def _opens_replay(scene: Scene, every: int) -> Opener:
    def opened(wrap: Wrapper | None, part: float = 1.0) -> Trial:
        return ReplayTrial(scene, every, part)

    return opened


def _revised(scene: Scene) -> list[Way]:
    """Return the ways of step revision: the importer finds the impacts of a body without stops by repeating steps."""
    if not scene.stops or why_not_pushed(scene) or _has_memory(scene):
        return []
    scale, name = time_scale(scene), "step revision"
    if all_rigid(scene.stops):
        steps = [part * scale for part in REVISED_STEPS]
        return [Way(name, "step", step, {}, _opens(RevisedTrial, scene, step)) for step in steps]
    longest = REVISED_STEPS[0] * scale
    return [
        Way(name, "steps a contact", count, {}, _opens(RevisedTrial, scene, longest, count))
        for count in REVISED_CONTACT_STEPS
    ]


def _read_off_samples(scene: Scene, rate: float) -> list[Way]:
    """Return the ways that read impacts and extremes off the samples of a run."""
    rates = [part * rate for part in SAMPLING]
    begin, end = recorded_window(scene, float_parameters(scene, None))
    return [
        Way("read off samples", "samples per s", one, {}, _opens(SampledTrial, scene, one), model=True)
        for one in rates
        if LEAST_SAMPLES <= one * (end - begin) <= MOST_SAMPLES
    ]


def _plain_steps(scene: Scene) -> list[Way]:
    """Return the ways with steps of equal size, as in an importer without events."""
    scale = time_scale(scene)
    ways = []
    stops = scene.stops
    turned = bool(stops) and all_rigid(stops) and not why_not_thrown_back(scene)
    pushed = bool(stops) and not (any_rigid(stops) or why_not_pushed(scene) or _has_memory(scene))
    for count in STEPS_A_PERIOD:
        step = scale / count
        if turned:
            ways.append(
                Way(
                    "plain steps",
                    "step",
                    step,
                    {},
                    _opens(PlainStepsTrial, scene, step),
                )
            )
        elif pushed:
            ways += [
                Way(
                    f"plain steps, {exchange}",
                    "step",
                    step,
                    {},
                    _opens(PlainForcesTrial, scene, exchange, step),
                )
                for exchange in ("jacobi", "gauss_seidel")
            ]
    return ways


def _integrated(scene: Scene) -> list[Way]:
    if _has_memory(scene):
        return []
    return [
        Way(
            "model exchange, CVode",
            "tolerance",
            value,
            {},
            _opens(ModelExchangeTrial, scene, value),
        )
        for value in INTEGRATOR_TOLERANCES
    ]


def _general_ways(scene: Scene) -> list[Way]:
    own = own_step(scene)
    fixed = [
        way_by_scene(
            f"coupled, {exchange}",
            "macro_step",
            own * part,
            scene,
            {"execution.exchange": exchange, "execution.macro_step": own * part},
        )
        for exchange in EXCHANGES
        for part in GENERAL_REFINEMENTS
    ]
    chosen: dict[str, Any] = {"execution.macro_step": "auto"}
    if not scene.connections or not can_have(scene, chosen):
        return fixed
    return fixed + [
        way_by_scene(
            f"chosen steps, {exchange}",
            "coupling_tolerance",
            tolerance,
            scene,
            {**chosen, "execution.exchange": exchange, "execution.coupling_tolerance": tolerance},
        )
        for exchange in EXCHANGES
        for tolerance in COUPLING_TOLERANCES
    ]


def _not_repeated(scene: Scene) -> list[str]:
    """Return the names of components that take values of other components and do not restore their states."""
    targets = {connection.target[0] for connection in scene.connections}
    return [
        one.name
        for one in scene.components
        if one.name in targets and not description_of(one.fmu).coSimulation.canGetAndSetFMUstate
    ]


def _has_memory(scene: Scene) -> bool:
    """Return whether a stop relaxes: only the FMU of the body itself has that law."""
    return any(getattr(stop, "relaxation_time", 0.0) > 0.0 for stop in scene.stops)
