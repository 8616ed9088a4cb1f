"""Scene files: what is simulated, what is recorded and what is swept.

`load_scene` reads a TOML file into a frozen `Scene` or raises one `SceneError` with everything that is wrong.
The keys are described in `docs/scene.md`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any, Literal

import tomli_w
from pydantic import BaseModel, Field, field_serializer
from pydantic.fields import FieldInfo

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import Either, Message, message
from vibroimpact.orchestrator.scene.body_models import Body
from vibroimpact.orchestrator.scene.changes import changed_document, changed_values
from vibroimpact.orchestrator.scene.draft import with_swept_keys
from vibroimpact.orchestrator.scene.fields import field_of, known_keys
from vibroimpact.orchestrator.scene.file import (
    parse_scene_toml,
    read_scene_text,
    refuse_no_mapping,
    text_of_tables,
)
from vibroimpact.orchestrator.scene.general.scene import GeneralScene
from vibroimpact.orchestrator.scene.keys import (
    SINGLE_TABLES,
    Key,
    coordinate_name,
    is_missing,
    number_of,
    numbers_of,
    numeric_key,
    replacement,
    with_alternatives,
)
from vibroimpact.orchestrator.scene.measuring_models import (
    Daq,
    Exciter,
    LoadCell,
    Noise,
    Sensor,
    channels_in,
)
from vibroimpact.orchestrator.scene.models import Execution, Forcing, Record, Stop
from vibroimpact.orchestrator.scene.problems import lines_of
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY, Replay
from vibroimpact.orchestrator.scene.resting_start import with_resting_start
from vibroimpact.orchestrator.scene.sweep import SweepAxis, run_count
from vibroimpact.orchestrator.scene.tables import read_tables
from vibroimpact.orchestrator.scene.views import ViewedScene

__all__ = ["Scene", "load_scene", "parse_scene"]


class Scene(ViewedScene):
    """A validated scene; it never changes, `with_values` and `with_sweep` make another.

    Attributes
    ----------
    source : str
        Where the scene came from, for messages.
    text : str
        The TOML text, for provenance.
    title : str
        What the scene is called; may be empty.
    units : {"SI", "nondimensional"}
        The meaning of all numbers.
    body : OscillatorBody, ChainBody or BeamBody
        The body that moves; a general scene has none.
    general : GeneralScene or None
        What a scene of `[component.NAME]` tables asks of the importer; None in the short form.
    forcing : Forcing or None
        What drives it; None without a `[forcing]` table.
    stops : tuple of RestitutionStop, KelvinVoigtStop, HertzStop or HuntCrossleyStop
        The stops in the order of the file.
    sensor : Sensor or None
        Where a beam is observed, and what a sensor there reads; None without a `[sensor]` table.
    load_cell, exciter, noise, daq : LoadCell, Exciter, Noise, Daq, or None
        The measuring chain beside `[sensor]`; None without their tables.
    replay : Replay or None
        Recorded channels that drive the body and that its motion is compared with; None without `[replay]`.
    record : Record
        What is recorded; periods in a forced scene, times in any other. In a general scene `impacts` says
        whether located events are recorded.
    sweep : tuple of SweepAxis
        The swept keys in the order of the file; see `vibroimpact.orchestrator.scene.sweep.expand`.
    execution : Execution
        How the points run.
    found : mapping
        What was found out about the scene before it runs, by attribute of its datasets; `study.preparation`
        does.
    """

    source: str
    text: str = Field(repr=False)
    title: str
    units: Literal["SI", "nondimensional"]
    body_given: Body | None = Field(None, alias="body")
    forcing: Forcing | None = None
    stops: tuple[Stop, ...] = ()
    sensor: Sensor | None = None
    load_cell: LoadCell | None = None
    exciter: Exciter | None = None
    noise: Noise | None = None
    daq: Daq | None = None
    record: Record
    sweep: tuple[SweepAxis, ...]
    execution: Execution
    general: GeneralScene | None = None
    replay: Replay | None = None
    found: Mapping[str, str | float | int] = Field(default_factory=dict, exclude=True, repr=False)

    def __hash__(self) -> int:
        return hash((self.source, self.text))

    @field_serializer("general")
    def _without_folders(self, general: GeneralScene | None) -> dict[str, Any] | None:
        """Leave the folders of FMU files out, so that a scene is the same wherever it lies."""
        if general is None:
            return None
        document = asdict(general)
        for component in document["components"]:
            component["fmu"] = component["fmu"].name
        del document["start_units"]  # they follow from the FMUs
        if not general.contacts:
            del document["contacts"]  # campaigns from before there were any go on
        return document

    @property
    def body(self) -> Body:
        """The body of a scene of the short form.

        Raises
        ------
        UsageError
            For a general scene.
        """
        if self.body_given is None:
            raise UsageError(f"{self.source}: body: expected a scene with [body], got a general scene.")
        return self.body_given

    @property
    def period(self) -> float | None:
        """Forcing period 2 pi / angular_frequency; None unforced and under a constant force."""
        if self.forcing is None or self.forcing.angular_frequency == 0.0:
            return None
        return 2.0 * math.pi / self.forcing.angular_frequency

    @property
    def sampling_rate(self) -> float:
        """Nominal rate of the time series, 1/s: that of `[daq]` where it samples channels; 0 without a time series."""
        if self.general is not None:
            return (self.general.rate or 0.0) if self.general.variables else 0.0
        series = self.record.time_series
        if series is None:
            return 0.0
        return self.daq.rate if self.daq is not None and self.channels else series.rate or 0.0

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels of the measuring chain that the time series samples, in its order."""
        series = self.record.time_series
        return () if series is None else channels_in(series.variables)

    @property
    def falling_force(self) -> bool:
        """Whether the force of the exciter falls with the distance: at one point of the sweep, then held at all."""
        swept = [axis.values for axis in self.sweep if axis.key == "exciter.distance"]
        return self.exciter is not None and (self.exciter.distance > 0.0 or any(map(any, swept)))

    @property
    def is_measured(self) -> bool:
        """Whether its runs go by blocks of samples; no other run pays for a measuring chain."""
        return bool(self.channels) or self.falling_force

    @property
    def is_guarded(self) -> bool:
        """Whether its points run in a process that an FMU may crash or hang."""
        return self.general.guard if self.general is not None else self.execution.guard

    @property
    def files(self) -> tuple[Path, ...]:
        """Files beside its own that a run of it reads: recordings that drive it, FMUs."""
        folder = Path(self.source).parent
        recordings = self.replay.recordings if self.replay is not None else ()
        components = self.general.components if self.general is not None else ()
        return (*(folder / name for name in recordings), *(component.fmu for component in components))

    @property
    def runs(self) -> int:
        """How many runs the sweep has; 1 without one."""
        return run_count(self.sweep)

    def value(self, key: str) -> float:
        """Return the number that a key such as `stop[1].position` has in this scene.

        Raises
        ------
        UsageError
            When the scene has no such number.
        """
        if self.general is not None:
            return self.general.value(key)
        parts = numeric_key(key)
        return self._number(key, parts, self._numbered_tables().get(parts.owner))

    def field(self, key: str) -> FieldInfo:
        """Return the field of the model that a numeric key of the short form names; `fields` reads it.

        Raises
        ------
        UsageError
            When the scene has no such key.
        """
        parts = numeric_key(key)
        owner = self._numbered_tables().get(parts.owner)
        if owner is None or parts.name not in known_keys(type(owner)):
            raise UsageError(f"{self.source}: {key}: expected a key of this scene, got an absent one.")
        return field_of(type(owner), parts.name)

    def _number(self, key: str, parts: Key, owner: BaseModel | None) -> float:
        number = number_of(owner, parts)
        if number is None:
            raise UsageError(f"{self.source}: {key}: expected a number of this scene, got nothing.")
        return number

    def at(self, values: Mapping[str, float]) -> Scene:
        """Return this scene at a point of its sweep: with other numbers, not validated again, and the text it has.

        Parameters
        ----------
        values : mapping of str to float
            New values of sweepable keys. Values of the scene's own sweep are known to be valid; others are for
            `with_values`. An angular_frequency replaces a frequency that the scene gives, and a damping its
            damping_ratio; and the other way round.

        Examples
        --------
        >>> text = "[body]\\nmass = 1\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
        >>> parse_scene(text, "free.toml").at({"body.mass": 2.0}).body.mass
        2.0
        """
        if self.general is not None:
            return self.model_copy(update={"general": self.general.at(values)})
        tables = self._numbered_tables()
        for key, value in values.items():
            if key == RECORDING_KEY:  # which recording is replayed: no number of any table
                continue
            parts = numeric_key(key)
            owner = tables.get(parts.owner)
            if owner is None:
                raise UsageError(f"{self.source}: {key}: expected a key of this scene, got an absent table.")
            if parts.element is not None:
                self._number(key, parts, owner)
            tables[parts.owner] = owner.model_copy(update=replacement(owner, parts, value))
        others = {name: tables.pop(name) for name in (*SINGLE_TABLES, "execution")}
        others["body_given"] = others.pop("body")
        return self.model_copy(update={**others, "stops": tuple(tables.values())})

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> Scene:
        """Read a scene file (TOML, UTF-8, at most 1 MiB).

        Raises
        ------
        SceneError
            With all problems of the file, each on one line.
        """
        if not isinstance(path, str | PathLike):
            raise UsageError(f"scene: expected the path of a file, got {type(path).__name__}.")
        return load_scene(path)

    @classmethod
    def from_text(cls, text: str, source: str = "scene") -> Scene:
        """Read a scene from TOML text.

        Parameters
        ----------
        text : str
        source : str
            The name of the text in messages; files that the scene names count from its folder.

        Raises
        ------
        SceneError
            With all problems of the text, each on one line.

        Examples
        --------
        >>> scene = Scene.from_text("[body]\\nmass = 1\\nstiffness = 4\\n[record]\\nrecorded_time = 5")
        >>> scene.value("body.stiffness")
        4.0
        """
        for given, what in ((text, "TOML text"), (source, "the name of the scene as text")):
            if not isinstance(given, str):
                raise UsageError(f"scene: expected {what}, got {type(given).__name__}.")
        return parse_scene(text, source)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any], source: str = "scene") -> Scene:
        """Read a scene from the tables of its file; numbers and arrays of NumPy or xarray, tuples and paths will do.

        Parameters
        ----------
        tables : mapping
        source : str
            The name of the scene in messages; files that it names count from its folder.

        Raises
        ------
        SceneError
            With all problems of the tables, each on one line.

        Examples
        --------
        >>> body = {"mass": 1.0, "stiffness": 4.0, "damping_ratio": 0.1}
        >>> scene = Scene.from_dict({"body": body, "record": {"recorded_time": 5.0}})
        >>> round(scene.body.damping, 12)
        0.4
        """
        return parse_scene(text_of_tables(tables, source), source)

    def with_values(self, values: Mapping[str, Any]) -> Scene:
        """Return this scene with other values of some keys, checked as if its file said so.

        Parameters
        ----------
        values : mapping
            By key, as messages write it: `stop[1].restitution`, `record.time_series`, `title`. Of two keys for one
            thing, such as `damping` and `damping_ratio`, the new one takes the place of the other.

        Raises
        ------
        SceneError
            With all problems, each on one line: also for a key that the scene sweeps.

        Examples
        --------
        >>> scene = Scene.from_text("[body]\\nmass = 1\\nstiffness = 4\\n[record]\\nrecorded_time = 5")
        >>> scene.with_values({"body.mass": 2.0}).body.mass
        2.0
        """
        refuse_no_mapping(values, "keys and their new values", self.source)
        document = changed_values(parse_scene_toml(self.text, self.source), values, self.source)
        return self.from_dict(document, self.source)

    def with_sweep(self, axes: Mapping[str, Any]) -> Scene:
        """Return this scene with another sweep.

        Parameters
        ----------
        axes : mapping
            For each swept key its values, or the table that a file would have: `start`, `stop`, `points`, `path`.
            No key: no sweep.

        Raises
        ------
        SceneError
            With all problems, each on one line.

        Examples
        --------
        >>> scene = Scene.from_text("[body]\\nmass = 1\\nstiffness = 4\\n[record]\\nrecorded_time = 5")
        >>> scene.with_sweep({"body.damping": [0.1, 0.2], "body.stiffness": {"start": 1, "stop": 4, "points": 4}}).runs
        8
        """
        refuse_no_mapping(axes, "swept keys and their values", self.source)
        tables = {key: axis if isinstance(axis, Mapping) else {"values": axis} for key, axis in axes.items()}
        document = parse_scene_toml(self.text, self.source)
        document.pop("sweep", None)
        return self.from_dict(document | ({"sweep": tables} if tables else {}), self.source)

    def unswept(self, varied: Iterable[str] = ()) -> Scene:
        """Return this scene without its sweep.

        Parameters
        ----------
        varied : iterable of str
            Keys that the caller varies. Where the file leaves one of them to the sweep, it has the first swept value.

        Raises
        ------
        SceneError
            Another swept key has no value of its own, and needs one.

        Examples
        --------
        >>> text = "[body]\\nmass = 1\\n[record]\\nrecorded_time = 5\\n[sweep]\\n'body.stiffness' = { values = [1, 4] }"
        >>> Scene.from_text(text).unswept(varied=["body.stiffness"]).value("body.stiffness")
        1.0
        """
        if not self.sweep:
            return self
        document = parse_scene_toml(self.text, self.source)
        document.pop("sweep", None)
        keys = with_alternatives(varied)
        if self.general is None:
            axes = [axis for axis in self.sweep if axis.key != RECORDING_KEY]
            document = with_swept_keys(document, tuple(axis for axis in axes if axis.key in keys))
        try:
            return self.from_dict(document, self.source)
        except SceneError as error:
            lines = [self._left_to_the_sweep(axis) for axis in self.sweep if is_missing(document, axis.key)]
            raise SceneError(lines) if lines else error from error

    def _left_to_the_sweep(self, axis: SweepAxis) -> Message:
        value = f"{axis.values[0]:g}"
        return message(
            f"{self.source}: {axis.key}: expected a value beside those of the sweep, which is left out here, got none. "
            "Add it to the scene, or give it: ",
            Either(
                f'with_values({{"sweep": {{}}, "{axis.key}": {value}}})',
                f"--set 'sweep={{}}' --set '{axis.key}={value}'",
            ),
            ".",
        )

    def to_toml(self) -> str:
        """Return the text of a scene file that says the same; that of `from_file`, comments and all."""
        return self.text

    def constants(self) -> dict[str, float]:
        """Return the numbers of what moves that a sweep could vary and this one does not, by key, defaults too."""
        if self.general is not None:
            numbers = self.general.numbers()
        else:
            tables = [(name, owner) for name, owner in self._numbered_tables().items() if name != "execution"]
            numbers = chain.from_iterable(numbers_of(owner, name) for name, owner in tables if owner)
        swept = {axis.key for axis in self.sweep}
        return {key: value for key, value in numbers if key not in swept}

    def sweep_coordinate_name(self, key: str) -> str:
        """Return the name that a swept key has as a coordinate of the dataset."""
        return coordinate_name(key, [axis.key for axis in self.sweep])

    def _numbered_tables(self) -> dict[str, BaseModel | None]:
        """Return the tables that hold numbers, as keys name them."""
        stops = {f"stop[{number}]": stop for number, stop in enumerate(self.stops, start=1)}
        tables = {name: self.body_given if name == "body" else getattr(self, name) for name in SINGLE_TABLES}
        return {**stops, **tables, "execution": self.execution}


def load_scene(path: str | PathLike[str], changes: Sequence[str] = (), *, for_orbits: bool = False) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : path-like
        A TOML file, UTF-8, at most 1 MiB.
    changes : sequence of str
        `KEY=VALUE`, made before anything is checked: see `changes.changed_document`.
    for_orbits : bool
        Whether a start that is not written may be on a stop: see `parse_scene`.

    Raises
    ------
    SceneError
        With all problems of the file, each on one line.
    """
    source = str(path)
    return parse_scene(read_scene_text(Path(path), source), source, changes, for_orbits=for_orbits)


def parse_scene(text: str, source: str, changes: Sequence[str] = (), *, for_orbits: bool = False) -> Scene:
    """Read a scene from TOML text.

    Parameters
    ----------
    text : str
        The TOML text.
    source : str
        The name of the text in messages, usually its file.
    changes : sequence of str
        `KEY=VALUE`; the text of the scene is then one that says the same as the changed tables.
    for_orbits : bool
        Whether the scene is read to look for periodic orbits, which need no start: a start that is not written is then
        on the stop where a stop excludes 0.

    Raises
    ------
    SceneError
        With all problems of the text, each on one line.
    """
    written, changed = changed_document(parse_scene_toml(text, source), changes)
    document = with_resting_start(written) if for_orbits else written
    fields, problems = read_tables(document, Path(source).parent)
    if problems:
        raise SceneError(lines_of(problems, source, changed))
    if changed or document != written:
        text = tomli_w.dumps(document)
    return Scene(source=source, text=text, **fields)
