"""The engine of a scene, the laws of its stops, and its effects, in words."""

from __future__ import annotations

from collections.abc import Set

from vibroimpact.orchestrator.importer.specification import (
    COUPLING_TOLERANCE,
    ComponentSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.run.called_effects import called_by_components, called_by_numbers, shipped_kind
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.run.time_series import follow_energies
from vibroimpact.orchestrator.scene.body_models import StructureBody
from vibroimpact.orchestrator.scene.forcing_clock import signals_of, sines_of, sweeps_frequencies
from vibroimpact.orchestrator.scene.keys import MODES
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.measuring_models import FALLING_FORCE, MEASURED_SENSOR
from vibroimpact.orchestrator.scene.models import AMPLITUDE, DAMPING, FALLING_RESTITUTION
from vibroimpact.orchestrator.scene.scene import Scene

EFFECTS_OF_THE_SHORT_FORM = (
    *("forcing", "recorded drive", DAMPING, "stops", FALLING_RESTITUTION, AMPLITUDE, "energies"),
    *("sensor", "load cell", "exciter", FALLING_FORCE, "noise", "AD conversion"),
)
"""Effects that tables and numbers of the short form ask for, and the package's components in a general scene."""

SHOWN_FREQUENCIES = 5
"""Maximum number of natural frequencies in words."""


def engine(scene: Scene, execution: str = "auto") -> str:
    """Return the engine of a scene in words, by the scene's own execution or a campaign's (`fused`, `lanes`, ...).

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene.scene import parse_scene
    >>> text = "[body]\\nmass = 1\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
    >>> engine(parse_scene(text, "free.toml"))
    'fused: Oscillator, one mass, closed form between impacts'
    """
    if not scene.is_one_body:
        names = ", ".join(map(_named, scene.components))
        return f"coupled: {names}; {scene.execution.exchange} exchange {_steps(scene)}"
    if scene.replay is not None:
        return f"replay from sample to sample: {_body(scene)}"
    if scene.execution.how == "coupled":
        return f"coupled: {_body(scene)}{'; an ImpactStop for each stop' if scene.stops else ''}"
    by_lanes = goes_by_lanes(scene) if execution == "auto" else execution == "lanes"
    return f"{'lanes, many points at once' if by_lanes else 'fused'}: {_body(scene)}"


def _steps(scene: Scene) -> str:
    """Return the communication steps of a scene of components in words."""
    if scene.execution.adapts:
        tolerance = scene.execution.coupling_tolerance or COUPLING_TOLERANCE
        return f"in steps with an error of {tolerance:g}"
    return f"every {scene.macro_step:g} {'s' if scene.units == 'SI' else 'units of time'}"


def _named(component: ComponentSpec) -> str:
    if component.run_as != "model_exchange":
        return component.name
    return f"{component.name} (model exchange, tolerance {component.tolerance:g})"


def _body(scene: Scene) -> str:
    body = scene.body
    if isinstance(body, StructureBody):
        count = f"{body.size} mode{'' if body.size == 1 else 's'}"
        return f"{body.FMU}, {', '.join(body.names)}: {count} in all"
    if not body.IS_STRUCTURE:
        yields = any(not LAWS[stop.law].is_rigid for stop in scene.stops)
        how = "as a structure because a stop yields" if yields else "closed form between impacts"
        return f"{body.FMU}, one mass, {how}"
    swept = [axis.values for axis in scene.sweep if axis.key == MODES]
    modes = f"{min(swept[0]):g} to {max(swept[0]):g}" if swept else ""
    if body.KEEPS_MODES:
        count = modes or str(body.size)
        return f"{body.FMU}, a structure of {count} {'mode' if count == '1' else 'modes'}"
    used = modes or ("auto" if body.finds_modes else body.kept_modes)
    reduced = f" by {used} mode{'' if used == 1 else 's'}" if used != body.size else ""
    return f"{body.FMU}, a structure of {body.size} {'mass' if body.size == 1 else 'masses'}{reduced}"


def natural_frequencies(scene: Scene) -> str:
    """Return the first natural angular frequencies of the body of a scene in words, rad/s in SI.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene.scene import parse_scene
    >>> text = "[body]\\nmass = 1\\nstiffness = 4\\n[record]\\nrecorded_time = 5"
    >>> natural_frequencies(parse_scene(text, "free.toml"))
    'natural frequencies, rad/s: 2'
    """
    found = body_points(scene).natural_frequencies
    unit = ", rad/s" if scene.units == "SI" else ""
    more = f" and {found.size - SHOWN_FREQUENCIES} more" if found.size > SHOWN_FREQUENCIES else ""
    return f"natural frequencies{unit}: {', '.join(f'{one:.6g}' for one in found[:SHOWN_FREQUENCIES])}{more}"


def laws(scene: Scene) -> dict[str, str]:
    """Return the contact law of each stop and contact of the short form, by its key."""
    return dict(zip(scene.stop_keys, (stop.law for stop in scene.stops), strict=True))


def contacts(scene: Scene) -> dict[str, str]:
    """Return the partners of each contact of a general scene in words, by the key of the contact."""
    meetings = enumerate(scene.meetings, start=1)
    exchanged = {one.name for one in scene.components if one.run_as == "model_exchange"}
    return {f"contact[{number}]": _met(contact, exchanged) for number, contact in meetings}


def fused_form(scene: Scene) -> str:
    """Return a remark on the fused form of a scene of own bodies that meet each other only; empty for other scenes."""
    own = all(shipped_kind(component) in ("Oscillator", "Chain", "Beam") for component in scene.components)
    others = scene.connections or scene.events or scene.stop_contacts
    if scene.is_one_body or not own or others or not scene.pairs:
        return ""
    return "these bodies and contacts are one structure, too, and faster as [[body]] and [[contact]]"


def out_of_lanes(scene: Scene) -> str:
    """Return a remark on observed points that keep a sweep out of lanes; empty for other scenes."""
    alone = scene.record.model_copy(update={"observed": scene.record.observed[:1]})
    if not scene.record.observed[1:] or not goes_by_lanes(scene.model_copy(update={"record": alone})):
        return ""
    return "none, as record.observed has more than one entry: the points run one by one"


def clock_remark(scene: Scene) -> str:
    """Return a remark on the forcing period of several sines; empty where it is the period of the first sine.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene.scene import parse_scene
    >>> text = "[body]\\nmass = 1\\nstiffness = 1\\n[record]\\nrecorded_periods = 5\\n"
    >>> sines = [f"[[forcing]]\\namplitude = 1\\nangular_frequency = {w}\\n" for w in (1.0, 1.5, 2**0.5)]
    >>> clock_remark(parse_scene(text + sines[0] + sines[1], "two.toml"))
    'a forcing period is the common period of 2 sines: 2 periods of the first'
    >>> clock_remark(parse_scene(text + sines[0] + sines[2], "two.toml"))
    'quasi-periodic: 2 sines without a common period; a forcing period is one of the first'
    """
    clock, sines = scene.clock, len(sines_of(scene.forces))
    if clock is not None and signals_of(scene.forces):
        return "a forcing period is one of the first sine, with which the other signals do not repeat"
    if clock is None or sines < 2 or clock.periods == 1 == int(clock.is_common):
        return ""
    if clock.is_common:
        return f"a forcing period is the common period of {sines} sines: {clock.periods} periods of the first"
    near = "".join(
        f"; forcing[{number}] is nearly {p}/{q} of the first frequency" for number, p, q in clock.near
    )
    swept = "a frequency is swept" if sweeps_frequencies(scene.sweep) else "quasi-periodic"
    return f"{swept}: {sines} sines without a common period; a forcing period is one of the first{near}"


def _met(contact: StopContactSpec | PairSpec, exchanged: Set[str]) -> str:
    if isinstance(contact, PairSpec):
        return f"{contact.name}, {contact.law}"
    how = "force held over a step"
    if contact.body in exchanged:
        how = "impacts set its velocity" if contact.force is None else "impulses and forces on its states"
    return f"{contact.body}.{contact.displacement} on {contact.stop}, {how}"


def effects(scene: Scene) -> dict[str, bool]:
    """Return whether a scene asks for each effect at one or more of its points, by the name of the effect."""
    common = {
        "time series": scene.record.time_series is not None,
        "continuation": any(axis.continuation for axis in scene.sweep),
        "guard process": scene.execution.guard,
    }
    if not scene.is_one_body:
        called = called_by_components(scene)
        found = {
            "connections": bool(scene.connections),
            "contacts": bool(scene.contacts),
            "watched events": bool(scene.events),
        }
        return {name: name in called for name in EFFECTS_OF_THE_SHORT_FORM} | found | common
    called, followed = called_by_numbers(scene), scene.body.IS_STRUCTURE
    return {
        "forcing": bool(scene.forces),
        "recorded drive": scene.replay is not None and scene.replay.drive is not None,
        DAMPING: DAMPING in called or getattr(scene.body, "rayleigh", None) is not None,
        "stops": bool(scene.stops),
        FALLING_RESTITUTION: FALLING_RESTITUTION in called,
        AMPLITUDE: AMPLITUDE in called,
        "energies": followed and follow_energies(scene.sampled),
        **{name: bool(keys) for name, keys in chain_effects(scene).items()},
        **common,
    }


def chain_effects(scene: Scene) -> dict[str, list[str]]:
    """Return the keys of a scene of the short form that ask for each part of the measuring chain, by its name."""
    sensor, exciter = scene.sensor, scene.exciter
    readings = sensor is not None and (
        scene.replay is not None or any(name in MEASURED_SENSOR for name in scene.sampled)
    )
    return {
        "sensor": ["sensor"] if readings else [],
        "load cell": ["load_cell"] if scene.load_cell is not None else [],
        "exciter": ["exciter"] if exciter is not None else [],
        FALLING_FORCE: ["exciter.distance"] if scene.falling_force else [],
        "noise": ["noise"] if scene.noise is not None else [],
        "AD conversion": ["daq"] if scene.daq is not None else [],
    }


def in_one_line(scene: Scene, execution: str = "auto") -> str:
    """Return engine, laws and effects as one line."""
    stops = [f"{key} {what}" for key, what in (laws(scene) | contacts(scene)).items()]
    listed = ("stops" if scene.stops else "", "contacts")
    called = [name for name, there in effects(scene).items() if there and name not in listed]
    parts = engine(scene, execution), ", ".join(stops), ", ".join(called), clock_remark(scene)
    return "; ".join(part for part in parts if part)
