"""The effects of a scene, with the cost and the changes of each: runs with and without the effect, in turn."""

from __future__ import annotations

import gc
import math
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

import vibroimpact.orchestrator.study.clock as clock
from vibroimpact.analysis.dataset.results import SECONDS, ResultTable
from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.run.summary import effects as called_effects
from vibroimpact.orchestrator.run.summary import laws
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import BodyAlone, StructureBody
from vibroimpact.orchestrator.scene.fields import rule_of
from vibroimpact.orchestrator.scene.models import DAMPING, MOTION_KEYS, StopTable
from vibroimpact.orchestrator.study.errors import errors_of
from vibroimpact.orchestrator.study.measuring_effects import measuring_changes
from vibroimpact.orchestrator.study.motion import (
    CHAOS,
    OF_MOTIONS,
    REPLICATES,
    Motion,
    is_chaotic,
    motion_of,
    motions_in_words,
    values_of_motions,
)
from vibroimpact.orchestrator.study.observation import Observation
from vibroimpact.orchestrator.study.references import disturbed_scenes, observed, scales_of
from vibroimpact.orchestrator.study.statistics import Statistics, statistics_of
from vibroimpact.orchestrator.study.ways.replays import ReplayTrial
from vibroimpact.orchestrator.study.ways.way import SceneTrial, opened_trial

PAIRS = 5
"""Number of pairs of runs, one with the effect and one without, in turn."""
RECORDED = ("impacts", "extrema", "strobe")
"""Keys of `[record]` that each switch off a part of the record of a run."""
SERIES = "record.time_series"
NOT_RECORDED = "nothing but what is kept"
NO_CHANGE = "nothing"
TABLE = ResultTable(
    "effects",
    ("share", "effect", "1", "share of the time of a run, median"),
    ("seconds", "effect pair", SECONDS, "processor time with the effect less that without, pair by pair"),
    ("run_seconds", "effect", SECONDS, "median processor time of a run of the scene"),
    ("change", "effect", "1", "largest relative change without it"),
    *OF_MOTIONS,
    ("name", "effect", "1", "effect", "text"),
    ("asked_by", "effect", "1", "what asks for it", "text"),
    ("changes", "effect", "1", "what is otherwise without it", "text"),
    ("statistics", "effect", "1", "what is otherwise as a whole", "text"),
    ("orbit", "effect", "1", "class of the motion", "text"),
    ("orbit_without", "effect", "1", "class without it", "text"),
)

Change = Callable[[dict[str, Any]], None]


@dataclass(frozen=True, slots=True)
class Effect:
    """Something that a scene asks for, and the scene without it."""

    name: str
    """Name of the effect, in words."""
    asked_by: str
    """The keys that ask for the effect."""
    base: Scene
    """The scene with the effect. Motions are compared without a time series, whose samples take most of the time
    and would hide the rest.
    """
    without: Scene
    """The scene without the effect."""
    keeps_motion: bool = False
    """Whether the motion is the same without the effect, which only says what is recorded or how points run."""


@dataclass(frozen=True, slots=True)
class Share:
    """An effect with its cost and its changes."""

    effect: Effect
    seconds: np.ndarray[Any, Any]
    """Processor time of the effect in each pair of runs, s, shape (pair,); negative where the run without the effect
    took longer.
    """
    full: float
    """Median processor time of a run of the scene, s."""
    changes: str
    """Difference of the run without the effect, in words."""
    change: float
    """Largest relative change of the observed quantities; NaN where the runs cannot be compared."""
    motions: tuple[Motion, Motion] | None = None
    """The motions with and without the effect, where impacts are lost or a motion is chaotic."""
    statistics: Statistics | None = None
    """Distance between the distributions in the same cases, of a replay and of a general scene."""

    @property
    def share(self) -> float:
        """Median share of the time of a run."""
        return float(np.median(self.seconds)) / self.full

    @property
    def statistics_in_words(self) -> str:
        """Difference between the motions as a whole; empty where impacts are compared one by one."""
        return motions_in_words(self.motions, self.statistics)


def effects_of(scene: Scene) -> list[Effect]:
    """Return the effects that a scene without a sweep could leave out, each with the scene without the effect."""
    found = list(_found(_observing(scene)))
    return [effect for effect in found if effect is not None]


def _observing(scene: Scene) -> Scene:
    """Return a scene that names its observed point, which is otherwise that of its first stop or contact."""
    body = scene.bodies[0]
    if not isinstance(body, StructureBody) or isinstance(body, BodyAlone) or scene.record.observed:
        return scene
    return scene.with_values({"record.observed": [body.first_observed(scene.stops)]})


def _found(scene: Scene) -> Iterator[Effect | None]:
    if scene.is_one_body:
        yield from _of_numbers(scene)
        links = range(1, len(parse_toml(scene.text).get("link", ())) + 1)
        for key, what in (laws(scene) | {f"link[{number}]": "" for number in links}).items():
            table, _, place = key.removesuffix("]").partition("[")
            yield _without(scene, f"{what} {table}".strip(), key, _removes(table, int(place) - 1))
        if scene.body.ELEMENT == "mode" and hasattr(scene.body, "modes") and scene.body.size > 1:
            half = scene.body.size // 2
            yield _without(
                scene, f"modes {half + 1} to {scene.body.size}", "body.modes", _sets("body", "modes", half)
            )
        if scene.body.has_residual_vectors:
            yield _without(scene, "residual vectors", "body.residual", _sets("body", "residual", False))
        for name in RECORDED if scene.replay is None else ():
            if getattr(scene.record, name) and (name == "impacts" or scene.period is not None):
                yield _without(
                    scene, f"record of {name}", f"record.{name}", _sets("record", name, False), keeps=True
                )
        if scene.record.time_series is not None:
            change = _sets("record", "time_series", None)
            yield _without(scene, "time series", SERIES, change, keeps=True)
        for name, key, change in measuring_changes(scene):
            yield _without(scene, name, key, change, keeps=True, series=True)
        if scene.execution.how == "coupled":
            change = _only_fused
            yield _without(scene, "stops as FMUs of their own", "execution.how", change, keeps=True)
        if scene.replay is not None:
            yield from _of_replay(scene)
    else:
        if called_effects(scene)["time series"]:
            yield _without(scene, "samples", "record.variables", _no_samples, keeps=True)
        for component in scene.components:
            yield _without_component(scene, component.name)
        for table, name in (("event", "watched event"), ("contact", "contact of bodies")):
            for number in range(len(parse_toml(scene.text).get(table, ()))):
                yield _without(
                    scene, f"{name} {number + 1}", f"{table}[{number + 1}]", _removes(table, number)
                )
        if scene.execution.guard and "guard" in parse_toml(scene.text).get("execution", {}):
            yield _without(
                scene, "guard process", "execution.guard", _sets("execution", "guard", False), keeps=True
            )


def _of_replay(scene: Scene) -> Iterator[Effect | None]:
    """Yield the effects of a replay: the recorded drive of the body, and the numbers of the sensor."""
    assert scene.replay is not None
    if scene.replay.drive is not None:
        yield _without(scene, "what the recording drives", "replay.drive", _no_drive)
    sensor = parse_toml(scene.text).get("sensor", {})
    numbers = [name for name in ("gain", "offset") if name in sensor]
    if numbers:
        keys = ", ".join(f"sensor.{name}" for name in numbers)
        yield _without(scene, "numbers of the sensor", keys, _drops("sensor", numbers))


def _no_drive(document: dict[str, Any]) -> None:
    for name in ("drive", "from", "drive_offset"):
        document["replay"].pop(name, None)


def _drops(table: str, names: Sequence[str]) -> Change:
    def change(document: dict[str, Any]) -> None:
        for name in names:
            del document[table][name]

    return change


def _without_component(scene: Scene, name: str) -> Effect | None:
    """Return a component as an effect, with its connections; the variables of all other components are compared."""
    document = parse_toml(scene.text)
    document.pop("sweep", None)
    record = document.get("record", {})
    others = [variable for variable in record.get("variables", ()) if not variable.startswith(f"{name}.")]
    if not others:
        return None
    record["variables"] = others
    base = Scene.from_dict(document, scene.source)
    del document["component"][name]
    for table in ("connection", "contact", "event"):
        kept = [entry for entry in document.pop(table, ()) if name not in _owners(entry)]
        if kept:
            document[table] = kept
    try:
        return Effect(f"component {name}", f"component.{name}", base, Scene.from_dict(document, scene.source))
    except SceneError:
        return None


def _owners(entry: Mapping[str, Any]) -> set[str]:
    """Return the components that a connection, a contact or an event names."""
    named = [
        *(entry.get(key) for key in ("from", "to", "variable", "body", "stop")),
        *entry.get("between", ()),
    ]
    return {str(one).partition(".")[0] for one in named if one is not None}


def _of_numbers(scene: Scene) -> Iterator[Effect | None]:
    """Yield the effects that numbers other than 0 ask for, all numbers of one effect together."""
    called: dict[str, list[str]] = {}
    for key, value in scene.constants().items():
        effect = rule_of(scene.field(key)).effect
        if effect and value != 0.0:
            called.setdefault(effect, []).append(key)
    if len(scene.forces) == 1 and scene.clock is None and scene.has_several_forces:
        yield _without(scene, "forcing", "forcing", lambda document: document.pop("forcing"))
    elif len(scene.forces) == 1 and np.any(scene.forces[0].amplitude):
        called["forcing"] = ["forcing.amplitude"]
    if getattr(scene.body, "rayleigh", None) is not None:
        called.setdefault(DAMPING, []).append("body.rayleigh")
    for name, keys in called.items():
        yield _without(scene, name, ", ".join(keys), _zeros(keys))
    if len(scene.forces) > 1:
        yield from _of_forces(scene)
    yield from _of_moving_stops(scene)


def _of_forces(scene: Scene) -> Iterator[Effect | None]:
    """Yield each of several forces as an effect; a force that sets the clock has the amplitude 0, others are absent."""
    for place, (key, force) in enumerate(zip(scene.forcing_keys, scene.forces, strict=True)):
        if not np.any(force.amplitude):
            continue
        name, asked_by = f"force {place + 1}, {force.signal}", f"{key}.amplitude"
        without = _without(scene, name, asked_by, _removes("forcing", place))
        if without is not None and without.without.clock == without.base.clock:
            yield without
        else:
            yield _without(scene, name, asked_by, _zeros([asked_by]))


def _of_moving_stops(scene: Scene) -> Iterator[Effect | None]:
    """Yield the motion of each stop as an effect; a sine that sets the clock has the amplitude 0."""
    for place, stop in enumerate(scene.stops):
        if not isinstance(stop, StopTable) or not stop.moves:
            continue
        key, names = scene.stop_keys[place], [name for name in MOTION_KEYS if name in stop.model_fields_set]
        asked_by = ", ".join(f"{key}.{name}" for name in names)
        name = f"motion of {key}"
        yield _without(scene, name, asked_by, _drops_of_stop(place, names)) or _without(
            scene, name, f"{key}.motion_amplitude", _zeros([f"{key}.motion_amplitude"])
        )


def _drops_of_stop(place: int, names: Sequence[str]) -> Change:
    def change(document: dict[str, Any]) -> None:
        for name in names:
            del document["stop"][place][name]

    return change


def _without(
    scene: Scene, name: str, key: str, change: Change, *, keeps: bool = False, series: bool = False
) -> Effect | None:
    """Return an effect, compared with or without a time series; None where the scene is invalid without it."""
    document = parse_toml(scene.text)
    document.pop("sweep", None)
    if key != SERIES and not series and scene.is_one_body:
        document.get("record", {}).pop("time_series", None)
    base = Scene.from_dict(document, scene.source)
    change(document)
    try:
        return Effect(name, key, base, Scene.from_dict(document, scene.source), keeps)
    except SceneError:
        return None


def _sets(table: str, name: str, value: object) -> Change:
    def change(document: dict[str, Any]) -> None:
        if value is None:
            document[table].pop(name, None)
        else:
            document.setdefault(table, {})[name] = value

    return change


def _removes(table: str, number: int) -> Change:
    def change(document: dict[str, Any]) -> None:
        del document[table][number]
        if not document[table]:
            del document[table]

    return change


def _zeros(keys: Sequence[str]) -> Change:
    def change(document: dict[str, Any]) -> None:
        for key in keys:
            owner, _, name = key.partition(".")
            table, _, place = owner.partition("[")
            within = document[table][int(place[:-1]) - 1] if place else document[table]
            name = name.partition("[")[0]
            value = within.get(name)
            if name == "rayleigh":
                within.pop(name)
            elif isinstance(value, list):
                within[name] = [0.0] * len(value)
            elif value is not None:
                within[name] = 0.0

    return change


def _no_samples(document: dict[str, Any]) -> None:
    for name in ("variables", "rate"):
        document["record"].pop(name, None)


def _only_fused(document: dict[str, Any]) -> None:
    document["execution"]["how"] = "fused"
    for name in ("macro_step", "exchange", "guard"):
        document["execution"].pop(name, None)


def shares_of(scene: Scene, effects: Sequence[Effect]) -> Generator[Share, None, None]:
    """Yield the cost and the changes of each effect of a scene without a sweep, by runs with and without it in turn."""
    compared = _Compared(scene)
    with opened(scene) as full:
        whole = float(np.median([clock.CLOCK.processor_time(full) for _ in range(PAIRS)]))
    for effect in effects:
        yield _share(effect, whole, compared)


def dearest_first(share: Share) -> float:
    """Return the sorting key of a share: its negative share of the time, infinite for a failed share."""
    return -share.share if share.share == share.share else math.inf


@contextmanager
def opened(scene: Scene) -> Iterator[SceneTrial | ReplayTrial]:
    """Open a scene, and close it at the end."""
    trial = opened_trial(scene)
    try:
        yield trial
    finally:
        trial.close()


def _share(effect: Effect, whole: float, compared: _Compared) -> Share:
    try:
        with opened(effect.base) as full, opened(effect.without) as trial:
            reference, alone = full.run(), trial.run()
            gc.collect()
            time_of = clock.CLOCK.processor_time
            pairs = np.array([(time_of(full), time_of(trial)) for _ in range(PAIRS)])
        share = Share(effect, pairs[:, 0] - pairs[:, 1], whole, NOT_RECORDED, 0.0)
        return share if effect.keeps_motion else compared.share(share, alone, reference)
    except ComponentError as error:
        return _failed(effect, error)


class _Compared:
    """Compares runs with and without an effect of a scene, impact by impact or as whole motions.

    The scene has all of its effects.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene, self._scales = scene, scales_of(scene)
        self._motions: dict[Scene, Motion | None] = {}

    def share(self, share: Share, alone: Observation, reference: Observation) -> Share:
        """Return a share with the changes of the run without its effect."""
        errors = errors_of(alone, reference, self._scales)
        lost = (
            errors.failure.replace("missed", "loses")
            .replace("that are none", "more")
            .replace("that is none", "more")
        )
        change = math.nan if lost else errors.worst()
        words = lost or (NO_CHANGE if change == 0.0 else f"up to {100.0 * change:.3g} %")
        share = replace(share, changes=words, change=change)
        if alone.failure:
            return share
        if not self._scene.is_one_body:
            return self._by_samples(share, alone, reference)
        base = share.effect.base
        if base not in self._motions:
            self._motions[base] = motion_of(base)
        full = self._motions[base]
        if full is None or not (lost or full.chaotic):
            return share
        share = replace(share, changes=lost or full.change, change=math.nan)
        if self._scene.replay is not None:
            share = replace(share, statistics=statistics_of(alone, reference, ()))
        without = motion_of(share.effect.without)
        return share if without is None else replace(share, motions=(full, without))

    def _by_samples(self, share: Share, alone: Observation, reference: Observation) -> Share:
        """Add the distributions of the samples of a general scene where its motion is chaotic."""
        replicates = [observed(one) for one in disturbed_scenes(share.effect.base, REPLICATES)]
        if not is_chaotic(reference, replicates, self._scales):
            return share
        known = [one for one in replicates if not one.failure]
        changes = f"{CHAOS}, {share.changes}"
        return replace(share, changes=changes, statistics=statistics_of(alone, reference, known))


def _failed(effect: Effect, error: Exception) -> Share:
    words = f"does not run without it: {str(error).splitlines()[0]}"
    return Share(effect, np.full(PAIRS, math.nan), math.nan, words, math.nan)


def not_called(scene: Scene) -> list[str]:
    """Return the names of the effects that a scene does not ask for, which are not simulated."""
    return [name for name, there in called_effects(scene).items() if not there]


def dataset_of_shares(
    scene: Scene, shares: Sequence[Share], attributes: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Return the dataset of kind `effects`, with the cost and the changes of each effect."""
    motions = [share.motions for share in shares]
    values = {
        "share": [share.share for share in shares],
        "seconds": np.array([share.seconds for share in shares]).reshape(-1, PAIRS),
        "run_seconds": [share.full for share in shares],
        "change": [share.change for share in shares],
        **values_of_motions(motions, [share.statistics for share in shares]),
        "name": [share.effect.name for share in shares],
        "asked_by": [share.effect.asked_by for share in shares],
        "changes": [share.changes for share in shares],
        "statistics": [share.statistics_in_words for share in shares],
        "orbit": [pair[0].orbit if pair else "" for pair in motions],
        "orbit_without": [pair[1].orbit if pair else "" for pair in motions],
    }
    found = {
        "title": f"What effects cost: {scene.title or scene.source}",
        "not_simulated": ", ".join(not_called(scene)),
        "scene": scene.text,
        **(attributes or {}),
    }
    return TABLE.dataset(values, found, units=scene.units)
