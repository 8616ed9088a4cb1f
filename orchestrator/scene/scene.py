"""Scene files: the simulated system, its record and its sweep.

`load_scene` reads a TOML file into a frozen `Scene`, or raises one `SceneError` with all problems of the file.
`docs/scene.md` describes the keys.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import tomli_w
from pydantic import Field

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.messages import Either, Message, message
from vibroimpact.orchestrator.scene.changes import (
    changed_document,
    changed_values,
    edited_text,
    with_resting_start,
)
from vibroimpact.orchestrator.scene.draft import with_swept_keys
from vibroimpact.orchestrator.scene.file import (
    parse_scene_toml,
    read_scene_text,
    refuse_no_mapping,
    text_of_tables,
)
from vibroimpact.orchestrator.scene.keys import coordinate_name, is_missing, with_alternatives
from vibroimpact.orchestrator.scene.own_structures import (
    apart_from_modes,
    with_bodies_in_text,
    with_given_modes,
)
from vibroimpact.orchestrator.scene.parts import Parts
from vibroimpact.orchestrator.scene.problems import lines_of
from vibroimpact.orchestrator.scene.replay_models import RECORDING_KEY
from vibroimpact.orchestrator.scene.several_bodies import with_one_body, with_one_body_in_text
from vibroimpact.orchestrator.scene.several_forces import with_one_force, with_one_force_in_text
from vibroimpact.orchestrator.scene.sweep import SweepAxis
from vibroimpact.orchestrator.scene.tables import read_tables
from vibroimpact.orchestrator.scene.views import ViewedScene

__all__ = ["Scene", "load_scene", "parse_scene"]


class Scene(ViewedScene, Parts):
    """A validated scene, which never changes; `with_values` and `with_sweep` return new scenes.

    Attributes
    ----------
    source : str
        Origin of the scene, for messages.
    text : str
        The TOML text, for provenance.
    title : str
        Title of the scene; may be empty.
    units : {"SI", "nondimensional"}
        System of units of all numbers.
    bodies : tuple of OscillatorBody, ChainBody, BeamBody or StructureBody, or of ComponentSpec
        One body of the package, or several as one structure; or the components, of any FMUs, in the order of the file.
    contacts : tuple of stops and contacts, or of StopContactSpec and PairSpec
        The stops of the body, then contacts of its points; or contacts between components. In the order of the file.
    connections : tuple of ConnectionSpec
        Connections from outputs to inputs of components.
    events : tuple of EventSpec
        Crossings in components, located by step revision.
    forces : tuple of Forcing or ConstantForcing
        The forces, in the order of the file; empty without a `[forcing]` table.
    sensor : Sensor or None
        Observed point of a beam, and the reading of a sensor there; None without a `[sensor]` table.
    load_cell, exciter, noise, daq : LoadCell, Exciter, Noise, Daq, or None
        The measuring chain besides `[sensor]`; None without their tables.
    replay : Replay or None
        Recorded channels that drive the body or are compared with its motion; None without `[replay]`.
    record : Record
        Recorded quantities; periods in a forced scene, times in any other scene. In a scene of components, `impacts`
        is whether located events are recorded.
    sweep : tuple of SweepAxis
        The swept keys in the order of the file; see `vibroimpact.orchestrator.scene.sweep.expand`.
    execution : Execution
        Way to run the points, and their limits.
    declared_units : mapping of str to str
        Declared unit of each number, recorded variable and swept key of components; `1` without a unit.
    doubts : tuple of str
        Open points in the descriptions of FMUs, each with the assumption: `FILE: ...`.
    remarks : mapping of str to int
        Number of other oddities in the description of an FMU, which change no number, by file.
    found : mapping
        Results of the preparation before a run, by attribute of its datasets; see `study.preparation`.
    """

    text: str = Field(repr=False)
    found: Mapping[str, str | float | int] = Field(default_factory=dict, exclude=True, repr=False)

    def __hash__(self) -> int:
        return hash((self.source, self.text))

    @classmethod
    def from_file(cls, path: str | PathLike[str]) -> Scene:
        """Return the scene of a file (TOML, UTF-8, at most 1 MiB).

        Raises
        ------
        SceneError
            The file is invalid; the message has all its problems, each on one line.
        """
        if not isinstance(path, str | PathLike):
            raise UsageError(f"scene: expected the path of a file, got {type(path).__name__}.")
        return load_scene(path)

    @classmethod
    def from_text(cls, text: str, source: str = "scene") -> Scene:
        """Return the scene of a TOML text.

        Parameters
        ----------
        text : str
        source : str
            The name of the text in messages; paths in the scene are relative to its folder.

        Raises
        ------
        SceneError
            The text is invalid; the message has all its problems, each on one line.

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
        """Return the scene of tables; numbers and arrays of NumPy or xarray, tuples and paths are allowed.

        Parameters
        ----------
        tables : mapping
        source : str
            The name of the scene in messages; paths in the scene are relative to its folder.

        Raises
        ------
        SceneError
            The tables are invalid; the message has all their problems, each on one line.

        Examples
        --------
        >>> body = {"mass": 1.0, "stiffness": 4.0, "damping_ratio": 0.1}
        >>> scene = Scene.from_dict({"body": body, "record": {"recorded_time": 5.0}})
        >>> round(scene.body.damping, 12)
        0.4
        """
        return parse_scene(text_of_tables(tables, source), source)

    def with_values(self, values: Mapping[str, Any]) -> Scene:
        """Return this scene with other values of some keys, checked like a file with these values.

        Parameters
        ----------
        values : mapping
            New values by key, in the notation of messages: `stop[1].restitution`, `record.time_series`, `title`. A new
            key replaces its alternative, such as `damping_ratio` for `damping`.

        Raises
        ------
        SceneError
            The changed scene is invalid, or sweeps a changed key; the message has all problems, each on one line.

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
            Values of each swept key, or its table as in a file: `start`, `stop`, `points`, `path`. An empty mapping
            removes the sweep.

        Raises
        ------
        SceneError
            The sweep is invalid; the message has all problems, each on one line.

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
            Keys that the caller varies; if only the sweep gives one of them, it has its first swept value.

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
        if self.is_one_body:
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
        """Return the text of an equal scene file; for a scene of `from_file` the same text with its comments."""
        return self.text

    def sweep_coordinate_name(self, key: str) -> str:
        """Return the name of a swept key as a coordinate of the dataset."""
        return coordinate_name(key, [axis.key for axis in self.sweep])


def load_scene(path: str | PathLike[str], changes: Sequence[str] = (), *, for_orbits: bool = False) -> Scene:
    """Return the scene of a file.

    Parameters
    ----------
    path : path-like
        A TOML file, UTF-8, at most 1 MiB.
    changes : sequence of str
        Changes `KEY=VALUE`, made before the checks: see `changes.changed_document`.
    for_orbits : bool
        Whether a missing start may be on a stop: see `parse_scene`.

    Raises
    ------
    SceneError
        The file is invalid; the message has all its problems, each on one line.
    """
    source = str(path)
    return parse_scene(read_scene_text(Path(path), source), source, changes, for_orbits=for_orbits)


def parse_scene(text: str, source: str, changes: Sequence[str] = (), *, for_orbits: bool = False) -> Scene:
    """Return the scene of a TOML text.

    Parameters
    ----------
    text : str
        The TOML text.
    source : str
        The name of the text in messages, usually its file.
    changes : sequence of str
        Changes `KEY=VALUE`; the scene then has a new text with the changed tables.
    for_orbits : bool
        Whether the scene is for a search of periodic orbits, which need no start. A missing start is then on the
        stop, if a stop excludes 0.

    Raises
    ------
    SceneError
        The text is invalid; the message has all its problems, each on one line.
    """
    written = parse_scene_toml(text, source)
    changed: tuple[str, ...] = ()
    before, after = apart_from_modes(written, changes)
    if before:
        written, changed = changed_document(written, before)
    given, wrong = with_given_modes(written, Path(source).parent)
    if wrong:
        raise SceneError(lines_of(wrong, source, changed))
    if given != written:
        text = edited_text(text, lambda text: with_bodies_in_text(text, given), given)
        written = given
    if after:
        written, changed_modes = changed_document(written, after)
        changed = (*changed, *changed_modes)
    one_body = with_one_body(with_resting_start(written) if for_orbits else written)
    document = with_one_force(one_body)
    fields, problems = read_tables(document, Path(source).parent)
    if problems:
        raise SceneError(lines_of(problems, source, changed))
    if changed:
        text = tomli_w.dumps(document)
    else:
        text = text if one_body == written else edited_text(text, with_one_body_in_text, one_body)
        text = text if document == one_body else edited_text(text, with_one_force_in_text, document)
    return Scene(source=source, text=text, **fields)
