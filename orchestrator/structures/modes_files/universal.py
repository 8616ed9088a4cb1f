"""Universal files: the datasets of a text, and modes from data at nodes (dataset 55) in units of dataset 164.

The formats are those of SDRC I-DEAS, as the University of Cincinnati keeps them (Universal File Datasets Summary).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes_files.given import MOST_MODES, MOST_NUMBERS, GivenModes
from vibroimpact.orchestrator.structures.modes_files.nodal_data import (
    LINES_BEFORE_NODES,
    NodalMode,
    reals_of,
    shape_of,
)
from vibroimpact.orchestrator.structures.modes_files.node_places import DOUBLE, SINGLE, Place, places_of
from vibroimpact.orchestrator.structures.readers.found import DIRECTIONS

MARK = "    -1"
"""Line before and after a dataset."""
SIGNATURE = re.compile(rb"(?:[ ]*\r?\n)*[ ]{4}-1[ ]*\r?\n")
_NODAL, _UNITS = 55, 164
_BINARY = re.compile(r"[ ]{1,5}\d{1,5}[bB](?:[ ]*\d+){2}[ ]+(\d{1,12})[ ]+(\d{1,12})(?:[ ]+\d+)*[ ]*")
_SI = 1.0, 1.0
_FACTOR_WIDTH = 25


@dataclass(frozen=True, slots=True)
class Dataset:
    """A dataset of text.

    Attributes
    ----------
    kind : int
        Its number, such as 55.
    first : int
        Line of its first record in the file.
    lines : list of str
    """

    kind: int
    first: int
    lines: list[str]


@dataclass(slots=True)
class _Text:
    """A file, read line by line."""

    content: bytes
    at: int = 0
    number: int = 0

    def line(self) -> str | None:
        """Return the next line; None at the end of the file."""
        if self.at >= len(self.content):
            return None
        end = self.content.find(b"\n", self.at)
        end = len(self.content) if end < 0 else end
        found = self.content[self.at : end].decode("latin-1").rstrip()
        self.at, self.number = end + 1, self.number + 1
        return found


def datasets(content: bytes) -> Iterator[Dataset]:
    """Yield the datasets of text of a universal file; binary ones are passed over.

    Raises
    ------
    UsageError
        A dataset has no number or no end.
    """
    text = _Text(content)
    while (line := text.line()) is not None:
        if not line:
            continue
        if line != MARK:
            raise UsageError(f"line {text.number}: expected the mark of a dataset (-1), got {line[:60]!r}.")
        head = text.line() or ""
        binary = _BINARY.fullmatch(head)
        if binary is not None:
            _pass_over(text, int(binary[1]), int(binary[2]))
            continue
        if not head.strip().isdigit() or len(head) > 10:
            raise UsageError(f"line {text.number}: expected the number of a dataset, got {head[:60]!r}.")
        yield _dataset(text, int(head))


def _pass_over(text: _Text, lines: int, size: int) -> None:
    """Pass over a binary dataset: some lines of text, then some bytes."""
    for _ in range(min(lines, len(text.content))):
        if text.line() is None:
            break
    text.at += size
    if (text.line() or text.line()) != MARK:
        raise UsageError(f"line {text.number}: expected the end of a binary dataset (-1), got another line.")


def _dataset(text: _Text, kind: int) -> Dataset:
    """Return a dataset up to the mark at its end."""
    first, lines = text.number + 1, []
    while (line := text.line()) != MARK:
        if line is None:
            raise UsageError(
                f"line {text.number}: expected the end of dataset {kind} (-1), got the end of the file."
            )
        lines.append(line)
    return Dataset(kind, first, lines)


def read(content: bytes) -> GivenModes:
    """Return the modes of a universal file.

    Datasets 55 of normal and of complex modes are read. Shapes are normalised by the modal masses of their records.
    The points are `node.direction`, such as `12.z`, of all values that are not 0 in every mode. Datasets 15 and 2411
    have the places of their nodes.

    Raises
    ------
    UsageError
        A dataset is damaged, no dataset has modes, or a mode has no modal mass.
    """
    modes: list[NodalMode] = []
    left_out: Counter[str] = Counter()
    remarks: list[str] = []
    units = _SI
    numbers = 0
    places: dict[int, Place] = {}
    for dataset in datasets(content):
        if dataset.kind == _UNITS:
            units = _units(dataset)
            continue
        if dataset.kind in (SINGLE, DOUBLE):
            places |= places_of(dataset.kind, dataset.first, dataset.lines, units[0])
            continue
        if dataset.kind != _NODAL:
            continue
        if len(dataset.lines) < LINES_BEFORE_NODES:
            raise UsageError(f"line {dataset.first}: expected the records of dataset 55, got fewer lines.")
        found = shape_of(dataset.first, dataset.lines)
        if isinstance(found, str):
            left_out[found] += 1
            continue
        modes.append(_in_si(found, units))
        numbers += found.values.size
        if len(modes) > MOST_MODES or numbers > MOST_NUMBERS:
            raise UsageError(f"line {dataset.first}: expected at most {MOST_MODES} modes, got more.")
    if not modes:
        got = ", ".join(left_out) or "none"
        raise UsageError(f"expected modes at nodes (dataset 55), got {got}.")
    if units != _SI:
        remarks.append("The units of the file are converted to SI.")
    remarks += [f"Datasets of {why} are left out ({times})." for why, times in left_out.items()]
    return _given(_without_conjugates(modes, remarks), remarks, places)


def _units(dataset: Dataset) -> tuple[float, float]:
    """Return the units of length and force in the file per unit of SI."""
    try:
        if len(dataset.lines) < 2:
            raise ValueError("expected two lines, got fewer")
        found = reals_of(dataset.lines[1], _FACTOR_WIDTH, 3)
        if min(found) <= 0.0:
            raise ValueError(f"expected factors > 0, got {found}")
    except ValueError as problem:
        raise UsageError(f"line {dataset.first + 1}: dataset 164: {problem}.") from None
    return found[0], found[1]


def _in_si(mode: NodalMode, units: tuple[float, float]) -> NodalMode:
    """Return a mode in kg and m: its modal mass has the file's unit force x s^2 / length."""
    length, force = units
    if units == _SI:
        return mode
    rotations = np.where(np.arange(mode.values.shape[1]) < 3, 1.0, length)
    with np.errstate(all="ignore"):  # what overflows is refused with its point
        return mode.scaled(mode.modal_mass * length / force, rotations)


def _without_conjugates(modes: list[NodalMode], remarks: list[str]) -> list[NodalMode]:
    """Return the modes without those of negative frequency, which are conjugates of others."""
    kept = [mode for mode in modes if not mode.is_conjugate]
    if kept and len(kept) < len(modes):
        remarks.append(f"Modes of negative frequency are left out ({len(modes) - len(kept)}).")
    return kept or modes


def _given(modes: list[NodalMode], remarks: list[str], places: Mapping[int, Place]) -> GivenModes:
    """Return the modes over all nodes and directions."""
    for number, times in Counter(mode.number for mode in modes).items():
        if times > 1:
            raise UsageError(f"expected each mode once, got mode {number} {times} times.")
    nodes = np.unique(np.concatenate([mode.nodes for mode in modes]))
    width = max(mode.values.shape[1] for mode in modes)
    if len(nodes) * width * len(modes) > MOST_NUMBERS:
        raise UsageError(f"expected at most {MOST_NUMBERS} values of shapes, got more.")
    is_complex = any(np.iscomplexobj(mode.values) or isinstance(mode.modal_mass, complex) for mode in modes)
    shapes = np.zeros((len(nodes), width, len(modes)), dtype=np.complex128 if is_complex else np.float64)
    for place, mode in enumerate(modes):
        shapes[np.searchsorted(nodes, mode.nodes), : mode.values.shape[1], place] = mode.values
    flat = shapes.reshape(-1, len(modes))
    there = np.flatnonzero((flat != 0.0).any(axis=1))
    points = tuple(f"{nodes[place // width]}.{DIRECTIONS[place % width]}" for place in there.tolist())
    owners = (int(nodes[place // width]) for place in there.tolist())
    return GivenModes(
        [mode.natural for mode in modes],
        points,
        flat[there],
        [mode.damping_ratio for mode in modes],
        [mode.modal_mass for mode in modes],
        is_angular=True,
        remarks=tuple(remarks),
        coordinates={name: places[node] for name, node in zip(points, owners, strict=True) if node in places},
    )
