"""Modes written into files: the table of a body in TOML or CSV, exact, or universal datasets (UFF 55) of six digits."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import tomli_w

from vibroimpact.analysis.files.atomic import write_atomically
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files.node_places import DOUBLE
from vibroimpact.orchestrator.structures.modes_files.universal import MARK
from vibroimpact.orchestrator.structures.readers.found import DIRECTIONS

_UNIVERSAL = frozenset({".uff", ".unv"})
ENDINGS = (".toml", ".csv", ".uff", ".unv")
"""Endings of the names of the files that are written."""
_LONGEST_LABEL = 9
"""Digits of the largest label of a node."""


def write_modes(path: os.PathLike[str] | str, modes: Modes) -> None:
    """Write modes as the table `[body]` of a scene (`.toml`), as rows (`.csv`), or as datasets 55 (`.uff`, `.unv`).

    A table in CSV has no damping matrix and no origin. A universal file has six digits of each number, points named
    `node.direction` such as `12.z`, and damping ratios; it has no participation.

    Raises
    ------
    UsageError
        The name of the file has another end, or the modes do not fit into a universal file.
    OSError
        The file cannot be written.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix == ".toml":
        text = tomli_w.dumps({"body": modes.table()})
    elif suffix == ".csv":
        text = "".join(f"{line}\n" for line in _rows(modes))
    elif suffix in _UNIVERSAL:
        text = "".join(f"{line}\n" for line in _universal(modes))
    else:
        raise UsageError(f"{path}: expected a file of modes ending in {', '.join(ENDINGS)}, got {suffix!r}.")
    write_atomically(path, text.encode())


def _rows(modes: Modes) -> Iterator[str]:
    """Yield the lines of a table: a row for each quantity, then one for each point."""
    _refuse_damping_matrix(modes, "a table")
    named = {"angular_frequency": modes.natural, "damping_ratio": modes.damping_ratios}
    named |= {} if modes.participation is None else {"participation": modes.participation}
    for name, values in (*named.items(), *modes.shapes.items()):
        yield ",".join((name, *map(repr, values.tolist())))


def _refuse_damping_matrix(modes: Modes, words: str) -> None:
    if modes.damping is not None:
        raise UsageError(
            f"expected damping ratios alone for {words}, got a damping matrix. Write a .toml file."
        )


def _universal(modes: Modes) -> Iterator[str]:
    """Yield the lines of a universal file: units of SI, the places of nodes, then a dataset of each mode."""
    _refuse_damping_matrix(modes, "a universal file")
    nodes, values = _at_nodes(modes)
    places = {
        int(name.partition(".")[0]): place
        for name, place in modes.coordinates.items()
        if name in modes.shapes
    }
    yield from (MARK, f"{164:6d}", f"{1:10d}{'SI: Meter (newton)':20}{2:10d}")
    yield f"{1.0:25.17E}{1.0:25.17E}{1.0:25.17E}".replace("E", "D")
    yield from (f"{273.15:25.17E}".replace("E", "D"), MARK)
    if places:
        yield from (MARK, f"{DOUBLE:6d}")
        for label, where in sorted(places.items()):
            yield f"{label:10d}{1:10d}{1:10d}{11:10d}"
            yield "".join(f"{each:25.16E}" for each in where).replace("E", "D")
        yield MARK
    width = values.shape[1]
    for place, (natural, ratio) in enumerate(zip(modes.natural, modes.damping_ratios, strict=True)):
        frequency = natural / (2.0 * np.pi)
        yield from (MARK, f"{55:6d}", *("NONE",) * 4, f"Mode {place + 1}")
        yield "".join(f"{each:10d}" for each in (1, 2, 2 if width == 3 else 3, 8, 2, width))
        yield "".join(f"{each:10d}" for each in (2, 4, 1, place + 1))
        yield "".join(f"{each:13.5E}" for each in (frequency, 1.0, ratio, 0.0))
        for node, row in zip(nodes, values[:, :, place], strict=True):
            yield f"{node:10d}"
            yield "".join(f"{each:13.5E}" for each in row)
        yield MARK


def _at_nodes(modes: Modes) -> tuple[list[int], Floats]:
    """Return labels of nodes, and the shapes at them, shape (node, direction, mode)."""
    places: dict[int, dict[int, Floats]] = {}
    for name, shape in modes.shapes.items():
        label, _, direction = name.partition(".")
        is_label = label.isascii() and label.isdigit() and len(label) <= _LONGEST_LABEL
        if not is_label or direction not in DIRECTIONS:
            raise UsageError(
                f"expected points node.direction such as 12.z for a universal file, got {name!r}."
            )
        places.setdefault(int(label), {})[DIRECTIONS.index(direction)] = shape
    width = 6 if any(direction > 2 for rows in places.values() for direction in rows) else 3
    values = np.zeros((len(places), width, len(modes.natural)))
    nodes = sorted(places)
    for row, node in enumerate(nodes):
        for place, shape in places[node].items():
            values[row, place] = shape
    return nodes, values
