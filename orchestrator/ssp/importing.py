"""Import of an SSP archive as a scene: its FMUs lie beside it, and each problem is one line."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path as FilePath
from pathlib import PurePosixPath
from typing import Any

import tomli_w
import tomlkit

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.analysis.files.scratch import ScratchFolder, show_as
from vibroimpact.fmus import components, fmu_path
from vibroimpact.fmus.errors import ComponentFileError, SceneError, UsageError
from vibroimpact.fmus.messages import reworded
from vibroimpact.fmus.packaging.archive import note_name, shown_name, unpack
from vibroimpact.fmus.packaging.members import OWN_DIGITS
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.fmus.shipped import FOLDERS
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.changes import changed_document
from vibroimpact.orchestrator.scene.component_facts import ComponentFacts, component_facts
from vibroimpact.orchestrator.scene.file import LARGEST_FILE
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.archive import SspArchive
from vibroimpact.orchestrator.ssp.flat import FlatSystem, Path, components_of
from vibroimpact.orchestrator.ssp.names import GAIN, SSD_FILE
from vibroimpact.orchestrator.ssp.parameter_sets import read_sets, with_sets
from vibroimpact.orchestrator.ssp.reading import read_structure
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.scene_tables import Chosen, scene_tables
from vibroimpact.orchestrator.ssp.structure import Component
from vibroimpact.orchestrator.ssp.values import named_few

MOST_COMPONENTS = 1000
#: Most parameters with two values that notes name.
MOST_NAMED = 5
_PLAIN = re.compile(r"[^A-Za-z0-9_.-]")
_scratch: list[ScratchFolder] = []
"""Folders of systems that run from their archives; they are deleted at the end of the process."""


@dataclass(frozen=True, slots=True)
class Imported:
    """A system as a scene."""

    scene: Scene
    """Its FMUs lie in a folder that is deleted at the end of the process."""
    notes: tuple[str, ...]
    """Choices for values that the system leaves open."""


def load_system(
    path: str | PathLike[str],
    changes: Sequence[str] = (),
    parameters: Sequence[str | PathLike[str]] = (),
    name: str | None = None,
) -> Imported:
    """Read an SSP archive as a scene.

    Parameters
    ----------
    path : Path
        The archive.
    changes : sequence of str
        `KEY=VALUE`, made before the scene is checked.
    parameters : sequence of Path
        Parameter sets (SSV), files or members of the archive: one is applied, several become a sweep.
    name : str, optional
        Name of the scene's file, by default the archive's; its FMUs lie in `NAME_fmus` beside it.

    Raises
    ------
    SceneError
        With all problems of the system, or of its scene.
    ComponentFileError
        The archive, or an FMU in it, is unsafe or damaged.
    UsageError
        The parameter sets make no sweep.
    """
    folder = ScratchFolder("ssp")
    place = FilePath(folder.name)
    name = _PLAIN.sub("_", FilePath(path).stem)[:100] if name is None else name
    source = str(place / f"{name}.toml")
    try:
        with _named_in_errors(FilePath(path), source), SspArchive(FilePath(path)) as archive:
            sets = [FilePath(one) for one in parameters]
            tables, notes = _read(archive, place / f"{name}_fmus", sets, _given_end(changes))
            scene = parse_scene(_text(tables), source, changes)
    except BaseException:
        folder.cleanup()
        raise
    _scratch.append(folder)
    show_as(source, str(path))
    return Imported(scene, tuple(notes))


def import_system(
    path: str | PathLike[str],
    output: str | PathLike[str],
    changes: Sequence[str] = (),
    parameters: Sequence[str | PathLike[str]] = (),
    *,
    force: bool = False,
) -> Imported:
    """Write an SSP archive as a scene file, with its FMUs in a folder beside it.

    Parameters
    ----------
    path, changes, parameters
        As in `load_system`.
    output : Path
        The scene file to write (TOML); the folder has its name, with `_fmus` in place of the ending.
    force : bool
        Whether to overwrite existing files with other content.

    Raises
    ------
    SceneError, ComponentFileError, UsageError
        As in `load_system`; or a file exists, or cannot be written.
    """
    target = FilePath(output)
    imported = load_system(path, changes, parameters, target.stem)
    fmus = f"{target.stem}_fmus"
    made = {target.parent / fmus / file.name: file.read_bytes() for file in _files(imported.scene, fmus)}
    made[target] = imported.scene.text.encode("utf-8")
    for file, content in made.items():
        _refuse_another(file, content, force)
    for file, content in made.items():
        try:
            file.parent.mkdir(exist_ok=True)
            write_atomically(file, content)
        except OSError as error:
            raise UsageError(
                f"{file}: expected a file that can be written, got: {error.strerror}."
            ) from error
    return imported


def _text(tables: Mapping[str, Any]) -> str:
    """Return the text of a scene in a readable form; in a plainer form if the readable one does not parse back."""
    plain = tomli_w.dumps(tables)
    if len(plain) > LARGEST_FILE:
        raise RefusalError(
            SSD_FILE, "a system that is a scene of 1 MiB at most", f"one of {len(plain)} bytes"
        )
    text = tomlkit.dumps(tables)
    try:
        return text if parse_toml(text) == tables else plain
    except ValueError:
        return plain


def _files(scene: Scene, fmus: str) -> list[FilePath]:
    folder = FilePath(scene.source).parent / fmus
    return sorted(folder.glob("*.fmu")) if folder.is_dir() else []


def _refuse_another(file: FilePath, content: bytes, force: bool) -> None:
    if force or not file.exists() or (file.is_file() and file.read_bytes() == content):
        return
    raise UsageError(
        f"{file}: expected a new file, or one that holds the same, got one that holds something else. "
        "Choose another name, or overwrite it with --force."
    )


@contextmanager
def _named_in_errors(path: FilePath, source: str) -> Iterator[None]:
    """Replace the unpacked path by the archive's in messages."""
    place = str(FilePath(source).parent)
    try:
        yield
    except RefusalError as refusal:
        raise SceneError([refusal.problem.line(str(path))]) from None
    except SceneError as error:

        def named(line: str) -> str:
            return _by_members(line, FilePath(source)).replace(source, str(path)).replace(f"{place}/", "")

        raise SceneError([reworded(line, named) for line in error.problems]) from None
    except ComponentFileError as error:
        line = _by_members(str(error), FilePath(source))
        raise ComponentFileError(line.replace(f"{place}/", f"{path}: ")) from None


def _by_members(line: str, source: FilePath) -> str:
    """Return a message with the names of members in place of the paths of their copies."""
    for file in source.with_name(f"{source.stem}_fmus").glob("*.fmu"):
        line = line.replace(str(file), shown_name(file))
    return line


def _given_end(changes: Sequence[str]) -> float | None:
    """Return the end of the run from the changes, if a system leaves it open."""
    key = "record.recorded_time"
    document, changed = changed_document({}, [one for one in changes if one.startswith(key)])
    if key not in changed:
        return None
    given = document["record"]["recorded_time"]
    # the scene's rules report other types
    return float(given) if isinstance(given, int | float) and abs(given) < 1e300 else 0.0


def _read(
    archive: SspArchive, folder: FilePath, parameters: Sequence[FilePath], end: float | None
) -> tuple[dict[str, Any], list[str]]:
    structure = read_structure(archive)
    if structure.stop_time is None:
        start = structure.start_time or 0.0
        structure = replace(structure, stop_time=None if end is None else start + end)
    each = dict(components_of(structure.system))
    if not each:
        raise RefusalError(SSD_FILE, "a system with components", "none")
    if len(each) > MOST_COMPONENTS:
        raise RefusalError(SSD_FILE, f"at most {MOST_COMPONENTS} components", f"{len(each)}")
    fmus, facts, notes = _fmus(archive, each, folder)
    flat = FlatSystem(structure.system, facts, facts.keys() - fmus.keys())
    tables, more = scene_tables(structure, flat, fmus, facts)
    if parameters:
        with_sets(tables, flat, facts, read_sets(archive, parameters))
    overruled = dict.fromkeys(flat.overruled)
    return tables, [
        *dict.fromkeys(archive.remarks),
        *notes,
        *_left_out(flat.ignored),
        *list(overruled)[:MOST_NAMED],
        *more,
    ]


def _left_out(ignored: Sequence[str]) -> Iterator[str]:
    """Yield the note on parameters without a variable, of the system and of outside sets."""
    names = dict.fromkeys(ignored)
    if names:
        yield f"parameters of no variable, which were left out: {named_few(names)}"


def _fmus(
    archive: SspArchive, each: Mapping[Path, Component], folder: FilePath
) -> tuple[dict[Path, Chosen], dict[Path, ComponentFacts], list[str]]:
    """Copy the FMUs into a folder; return the scene's choice of each but gains, and their facts."""
    folder.mkdir()
    files: dict[str, FilePath] = {}
    fmus: dict[Path, Chosen] = {}
    facts: dict[Path, ComponentFacts] = {}
    notes: list[str] = []
    for path, component in each.items():
        file = files.get(component.source)
        if file is None:
            file = files[component.source] = folder / _file_name(component.source, folder)
            archive.copy(component.source, file)
            note_name(file, f"{archive.path}: {component.source}")
        if component.is_gain and unpack(file).identifiers[0] == GAIN:
            facts[path] = component_facts(file)
            continue
        own = _own(component, file, path, notes)
        if own is None:
            fmus[path] = Chosen(f"{folder.name}/{file.name}", None, component.run_as)
            facts[path] = component_facts(file, component.run_as)
        else:
            version = None if component.fmi == "3.0" else component.fmi
            fmus[path] = Chosen(component.fmu, version, component.run_as)
            facts[path] = component_facts(own, component.run_as)
    used = {FilePath(chosen.fmu).name for chosen in fmus.values()}
    for file in files.values():
        if file.name not in used:
            file.unlink()
            file.with_name(f"{file.name}.shown").unlink()
    return fmus, facts, notes


def _own(component: Component, file: FilePath, path: Path, notes: list[str]) -> FilePath | None:
    """Return the shipped FMU from which a component was exported; None for any other FMU, also a replacement."""
    if not component.fmu:
        return None
    where = f"{SSD_FILE}: {'.'.join(path)[:60]}"
    if component.fmu not in components() or component.fmi not in FOLDERS:
        got = f"{quoted(component.fmu)}, FMI {quoted(component.fmi)}"
        hint = "Take the annotation out, and the FMU of the archive is used."
        raise RefusalError(f"{where}: annotation", f"one of {', '.join(components())}", got, hint)
    shipped = fmu_path(component.fmu, component.fmi)
    inside, own = unpack(file), unpack(shipped)
    if inside.identifiers[0] != own.identifiers[0]:
        return None
    if inside.token[: -OWN_DIGITS - 1] != own.token[: -OWN_DIGITS - 1]:
        notes.append(
            f"{'.'.join(path)}: its {component.fmu} is of another version of this package; the one installed is used"
        )
    return shipped


def _file_name(member: str, folder: FilePath) -> str:
    """Return a file name for a member that is unique on any system."""
    stem = _PLAIN.sub("_", PurePosixPath(member).stem)[:100].lstrip(".") or "fmu"
    there = {file.name.lower() for file in folder.iterdir()}
    name, count = f"{stem}.fmu", 1
    while name.lower() in there:
        count += 1
        name = f"{stem}_{count}.fmu"
    return name
