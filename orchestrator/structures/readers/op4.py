"""Nastran OUTPUT4 files (`.op4`): several named matrices in one file, of binary or text, dense or sparse."""

from __future__ import annotations

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.found import Found
from vibroimpact.orchestrator.structures.readers.op4_binary import BinaryFile, is_binary
from vibroimpact.orchestrator.structures.readers.op4_matrix import in_full, refuse_unfit
from vibroimpact.orchestrator.structures.readers.op4_text import TextFile
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

FIRST_BYTES = b"\x18\0\0\0", b"\0\0\0\x18", b"\x30\0\0\0", b"\0\0\0\x30"
"""First bytes of a binary file: the length of a head, 24 or 48, in both byte orders."""


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the wanted matrices of a Nastran OUTPUT4 file.

    Binary files of both byte orders, with words of four or eight bytes, and text files are read. Matrices are dense,
    sparse, or sparse with long columns ("bigmat").

    Raises
    ------
    UsageError
        The file is damaged or ends early, or a wanted matrix is not there, or not real and square.
    """
    file = BinaryFile(content) if is_binary(content) else TextFile(content)
    names = [head.name for head in file.heads]
    roles = wanted.among(names)
    for name in roles.values():
        if names.count(name) > 1:
            raise UsageError(f"expected a matrix {name} once, got it {names.count(name)} times.")
    return Found({role: _matrix(file, names.index(name)) for role, name in roles.items()})


def _matrix(file: BinaryFile | TextFile, place: int) -> Sparse:
    """Return the matrix at a place of the file."""
    head = file.heads[place]
    try:
        refuse_unfit(head)
        return in_full(head, *file.numbers(place))
    except UsageError as refused:
        raise refused.named(head.name) from None
