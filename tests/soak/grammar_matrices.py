"""Files of matrices: sound ones are read equal; cut, damaged and odd ones are read, or refused in a line."""

from __future__ import annotations

import gzip
import random
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from support import matrix_files, nastran_files

from soak import _drawn_files as files
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.readers import Sources, read_matrices

CASES, SAMPLE, SECONDS = files.CASES, 20, files.SECONDS

SEVERAL: Mapping[str, Callable[[Mapping[str, Any]], bytes]] = {
    **matrix_files.SEVERAL,
    **{
        f"{layout}{word}{order == '>'}.op4": partial(
            nastran_files.op4_binary, layout=layout, word=word, order=order
        )
        for layout in nastran_files.LAYOUTS
        for word in (4, 8)
        for order in "<>"
    },
    **{
        f"{layout}_text.op4": partial(nastran_files.op4_text, layout=layout)
        for layout in nastran_files.LAYOUTS
    },
}
NASTRAN = "model.pch"
"""A file of DMIG cards, which names its degrees of freedom; its table may have them in another order."""
KINDS = sorted({*matrix_files.ONE_MATRIX, *SEVERAL, NASTRAN})
DIGITS = {".sti": 1e-13, ".pch": 1e-9, "text.op4": 1e-15}
"""Relative rounding of texts with fewer digits than the numbers, by the end of the name."""
INSERTED = (
    b" ", b"\n", b"\r", b"\t", b"\0", b"%", b"#", b",", b"-", b"9" * 30, b"1e999", b"nan", b"0x1p3", b"\x1b[31m",
    b"\xe2\x80\xae", b"1 1 1\n", b"999999999 999999999 1\n", b"%%MatrixMarket matrix array real general\n9 9\n",
)  # fmt: skip
HEADS = ("name", "node", "direction", "x", "y", "z", "note", "")
"""Heads of a drawn table."""
CELLS = (
    "1",
    "12",
    "z",
    "3",
    "rx",
    "tip",
    "1.5",
    "nan",
    "inf",
    "-0",
    "1e999",
    '"',
    "",
    "a b",
    "\u202e",
    "x" * 60,
)


def _names(draw: random.Random, size: int) -> tuple[list[str], str]:
    """Return names of degrees of freedom, and their table."""
    numbers = draw.sample(range(1, 1000), size)
    directions = [draw.choice("xyz") for _ in numbers]
    names = [f"{number}.{direction}" for number, direction in zip(numbers, directions, strict=True)]
    mark = draw.choice(",;\t")
    if draw.random() < 0.5:
        return names, "".join(
            f"{line}{mark}\n" for line in (f"name{mark}x", *(f"{name}{mark}1" for name in names))
        )
    rows = zip(numbers, directions, strict=True)
    return names, f"node{mark}direction\n" + "".join(f"{node}{mark}{way}\n" for node, way in rows)


def _named(name: str, written: dict[str, Any]) -> dict[str, Any]:
    """Return the matrices by the names of a file; Nastran's have eight characters at most."""
    return (
        {"KAA": written["stiffness"], "MAA": written["mass"]} if name.endswith((".op4", NASTRAN)) else written
    )


def _odd_table(draw: random.Random) -> str:
    rows = [HEADS, *(CELLS for _ in range(draw.randrange(6)))]
    mark = draw.choice(",;\t ")
    return "\n".join(mark.join(draw.choice(one) for _ in range(draw.randint(1, 4))) for one in rows)


def _read(sources: Sources) -> Matrices | str:
    """Return the matrices, or the refusal; any other error propagates."""
    try:
        return read_matrices(sources)
    except UsageError as refusal:
        return files.badly_said(refusal, _subject(refusal)) or ""


def _subject(refusal: UsageError) -> Path:
    """Return the file that a refusal has to name: one of those of the case."""
    text = str(refusal)
    return next((path for path in Path().iterdir() if text.startswith(f"{path}: ")), Path("no file is named"))


def _differs(found: Matrices, written: dict[str, Any], names: list[str], digits: float) -> str | None:
    for role, matrix in written.items():
        got = getattr(found, role).toarray()
        if got.shape != matrix.shape or not np.allclose(got, matrix, rtol=digits, atol=0.0):
            return f"another {role} matrix"
    return None if list(found.freedoms) == names else f"freedoms {found.freedoms} for {names}"


def _unsound(found: Matrices) -> str | None:
    """Return the fault of matrices that were read from a damaged file."""
    size = len(found.freedoms)
    for one in (found.stiffness, found.mass):
        one.check_format(full_check=True)
        if one.shape != (size, size) or not np.all(np.isfinite(one.data)):
            return f"a matrix of {one.shape} with numbers that are not finite, or other sizes than {size}"
    return None


def _contents(name: str, written: dict[str, Any], names: list[str]) -> tuple[dict[str, bytes], Sources]:
    """Return the files of matrices by name, and their description."""
    if name == NASTRAN:
        cards = [nastran_files.dmig(each, one, names) for each, one in _named(name, written).items()]
        return {name: b"".join(cards)}, Sources(file=name, freedoms="freedoms.csv")
    if name in SEVERAL:
        return {name: SEVERAL[name](_named(name, written))}, Sources(file=name, freedoms="freedoms.csv")
    contents = {f"{role}_{name}": matrix_files.ONE_MATRIX[name](one) for role, one in written.items()}
    stiffness, mass = contents
    return contents, Sources(stiffness, mass, freedoms="freedoms.csv")


def check(seed: int) -> str | None:
    """Read the matrices of one structure."""
    draw = random.Random(seed)
    chance = np.random.default_rng(seed)
    name, size = draw.choice(KINDS), draw.randint(1, 12)
    written = {role: matrix_files.drawn_matrix(chance, size) for role in ("stiffness", "mass")}
    names, table = _names(draw, size)
    if name == NASTRAN:
        names.sort(key=lambda one: int(one.partition(".")[0]))
        for matrix in written.values():
            matrix[np.diag_indices(size)] += 1.0  # a degree of freedom without a card is not there
    contents, sources = _contents(name, written, names)
    contents["freedoms.csv"] = table.encode()
    kind = draw.random()
    if kind > 0.4:
        wrong = draw.choice(sorted(contents))
        contents[wrong] = files.spoiled(draw, contents[wrong], INSERTED)
    if kind > 0.9:
        contents["freedoms.csv"] = _odd_table(draw).encode() or b"\n"
    for file, content in contents.items():
        Path(file).write_bytes(gzip.compress(content) if draw.random() < 0.1 else content)
    with files.bounded_memory() as grown:
        found = _read(sources)
    for file in contents:
        Path(file).unlink()
    if isinstance(found, str):
        return found or (f"a sound file is refused: {name}" if kind <= 0.4 else None) or grown()
    digits = next((each for end, each in DIGITS.items() if name.endswith(end)), 0.0)
    return (_differs(found, written, names, digits) if kind <= 0.4 else _unsound(found)) or grown()
