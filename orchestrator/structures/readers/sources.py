"""Matrices of a structure from the files of its program: the file of each matrix, and a common size."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.readers.apart import content_hash, read_file_apart
from vibroimpact.orchestrator.structures.readers.found import Found, unpacked
from vibroimpact.orchestrator.structures.readers.union import in_order, refuse_twice, united
from vibroimpact.orchestrator.structures.readers.wanted import ROLES, Wanted

_CHILD = "vibroimpact.orchestrator.structures.readers.child"
_STIFFNESS, _MASS, _FREEDOMS, _MODEL = ".sti", ".mas", ".dof", ".inp"
"""Ends of the names of CalculiX's files."""
_LIBRARIES = ("scipy.sparse", "scipy.io")


@dataclass(frozen=True, slots=True)
class Sources:
    """The files of a structure's matrices.

    Attributes
    ----------
    stiffness, mass, damping : str
        Path of the file of each matrix; its name in `file` where that is given. Empty: its usual name in `file`.
    file : str
        Path of a file of several matrices; a `.sti` file of CalculiX stands for the files of its job.
    freedoms : str
        Path of the table of the degrees of freedom, or of a `.dof` file, beside which an `.inp` file is read.
    folder : Path
        Folder of relative paths.
    """

    stiffness: str = ""
    mass: str = ""
    damping: str = ""
    file: str = ""
    freedoms: str = ""
    folder: Path = Path()

    def files(self) -> dict[Path, Wanted]:
        """Return the files of matrices, and the matrices to take from each.

        Raises
        ------
        UsageError
            A matrix has no file.
        """
        given = {role: getattr(self, role) for role in ROLES}
        if self.file:
            return self._files_of_one(given)
        for role in ("stiffness", "mass"):
            if not given[role]:
                raise UsageError(f"{role}: expected a file of the {role} matrix, got none.")
        found: dict[Path, Wanted] = {}
        for role, text in given.items():
            if text:
                path = self.folder / text
                before = found[path].names if path in found else {}
                found[path] = Wanted({**before, role: ""})
        return found

    def _files_of_one(self, given: Mapping[str, str]) -> dict[Path, Wanted]:
        """Return the files where `file` is given."""
        path = self.folder / self.file
        if not _is_job(path):
            optional = frozenset({"damping"} if not given["damping"] else ())
            return {path: Wanted(given, optional)}
        for role, text in given.items():
            if text:
                raise UsageError(f"{role}: expected no name beside a file of CalculiX, got {text!r}.")
        return {path: Wanted({"stiffness": ""}), _beside(path, _MASS): Wanted({"mass": ""})}

    def table(self) -> Path | None:
        """Return the path of the table of the degrees of freedom; None without one."""
        if self.freedoms:
            return self.folder / self.freedoms
        return _beside(self.folder / self.file, _FREEDOMS) if self.file and _is_job(Path(self.file)) else None

    def model(self) -> Path | None:
        """Return the path of CalculiX's model beside its degrees of freedom; None without one."""
        table = self.table()
        if table is None or not _is_kind(table, _FREEDOMS):
            return None
        path = _beside(table, _MODEL)
        return path if path.is_file() else None

    def all_paths(self) -> tuple[Path, ...]:
        """Return the paths of all files that are read."""
        return (*self.files(), *(path for path in (self.table(), self.model()) if path is not None))

    def hashes(self) -> dict[str, str]:
        """Return the SHA-256 of each file by its path in `folder`.

        Raises
        ------
        UsageError
            A file cannot be read.
        """
        return {self._name_of(path): content_hash(path) for path in self.all_paths()}

    def _name_of(self, path: Path) -> str:
        inside = path.is_relative_to(self.folder)
        return (path.relative_to(self.folder) if inside else path).as_posix()


def _is_kind(path: Path, end: str) -> bool:
    """Return whether a name ends so, also before `.gz`."""
    return path.name.lower().removesuffix(".gz").endswith(end)


def _is_job(path: Path) -> bool:
    return _is_kind(path, _STIFFNESS)


def _beside(path: Path, end: str) -> Path:
    """Return the path of a job's file with another end: packed as the given one, or plain where only that exists."""
    packed = ".gz" if path.name.lower().endswith(".gz") else ""
    plain = path.with_suffix("") if packed else path
    found = plain.with_suffix(end + packed)
    return found if found.exists() or not packed else plain.with_suffix(end)


def read_matrices(sources: Sources) -> Matrices:
    """Return the matrices of a structure, each file read in a process of its own.

    Parameters
    ----------
    sources : Sources

    Returns
    -------
    Matrices
        Degrees of freedom without a table are named by their numbers, from 1.

    Raises
    ------
    UsageError
        A file is missing, damaged, or of another kind; the matrices and the table differ in size; a name occurs twice.
        One line that begins with the path.
    """
    files = sources.files()
    found = united({path: _read(path, "read", wanted.options()) for path, wanted in files.items()})
    unknowns = int(found.matrices["stiffness"].shape[0])
    names, coordinates = found.freedoms, found.coordinates
    table, model = sources.table(), sources.model()
    if table is not None:
        listed = _read(table, "read_freedoms", {})
        if not names:
            _refuse_unfit(table, listed.freedoms, unknowns)
            names = listed.freedoms
        coordinates = in_order(table, names, listed)
    if model is not None:
        coordinates = _coordinates_of_nodes(model, names)
    names = names or tuple(str(number) for number in range(1, unknowns + 1))
    matrices = found.matrices
    return Matrices(matrices["stiffness"], matrices["mass"], matrices.get("damping"), names, coordinates)


def _read(path: Path, reader: str, options: Mapping[str, Any]) -> Found:
    return read_file_apart(path, f"{_CHILD}:{reader}", options, unpacked, _LIBRARIES)


def _refuse_unfit(table: Path, names: Sequence[str], unknowns: int) -> None:
    """Raise UsageError unless a table names each unknown, and each name once."""
    if len(names) != unknowns:
        half = " Matrices of a cyclic symmetry are not supported." if 2 * len(names) == unknowns else ""
        expected = f"expected {unknowns} degrees of freedom, as the matrices"
        raise UsageError(f"{table}: {expected}, got {len(names)}.{half}")
    refuse_twice(table, names)


def _coordinates_of_nodes(model: Path, names: Sequence[str]) -> Floats:
    """Return the coordinates of the nodes in the names, shape (freedom, 3); NaN for a node that the model lacks."""
    numbers, places = read_file_apart(model, f"{_CHILD}:read_nodes", {}, _nodes)
    row_of = {number: row for row, number in enumerate(numbers.astype(np.int64).tolist())}
    rows = np.array([row_of.get(int(name.partition(".")[0]), len(places)) for name in names])
    found: Floats = np.concatenate([places, np.full((1, 3), np.nan)])[rows]
    return found


def _nodes(facts: Any, buffers: Sequence[bytearray]) -> tuple[Floats, Floats]:
    """Return the numbers and coordinates of nodes from a reader's answer."""
    numbers, places = (np.frombuffer(buffer, dtype=np.float64) for buffer in buffers)
    if places.size != 3 * numbers.size or not np.all(np.abs(numbers) < 2.0**31):
        raise ValueError("numbers and coordinates of nodes differ in number")
    return numbers, places.reshape(-1, 3)
