"""Archives of numpy: dense matrices by name (`numpy.savez`), or a sparse one (`scipy.sparse.save_npz`); no pickles."""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.matrices import Sparse
from vibroimpact.orchestrator.structures.readers.apart import MOST_BYTES
from vibroimpact.orchestrator.structures.readers.found import Found, in_columns
from vibroimpact.orchestrator.structures.readers.refusal import one_refusal
from vibroimpact.orchestrator.structures.readers.wanted import Wanted, listed

_SUFFIX = ".npy"
_LONGEST_HEADER = 10_000
_MOST_MEMBERS = 10_000
_SPARSE = {
    "csc": ("indices", "indptr"),
    "csr": ("indices", "indptr"),
    "bsr": ("indices", "indptr"),
    "dia": ("offsets",),
    "coo": ("row", "col"),
}
"""Names of the places of the entries, by the format of a sparse matrix."""


def read(content: bytes, wanted: Wanted) -> Found:
    """Return the wanted matrices of an archive; a sparse one is alone in its file and has no name.

    Raises
    ------
    UsageError
        The archive is damaged or holds pickles; a matrix is missing, complex or not square.
    """
    with one_refusal("a whole .npz file"), zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = _members(archive)
        if {"format", "data", "shape"} <= members.keys():
            return Found({wanted.only(): in_columns(_sparse(archive, members))})
        chosen = wanted.among(members)
        return Found({role: in_columns(_array(archive, members[name])) for role, name in chosen.items()})


def _members(archive: zipfile.ZipFile) -> Mapping[str, zipfile.ZipInfo]:
    """Return the arrays of an archive by name."""
    there = archive.infolist()
    total = sum(member.file_size for member in there)
    if len(there) > _MOST_MEMBERS or total > MOST_BYTES:
        raise UsageError(
            f"expected at most {_MOST_MEMBERS} arrays of {MOST_BYTES} bytes, got {len(there)} of {total}."
        )
    return {one.filename.removesuffix(_SUFFIX): one for one in there if one.filename.endswith(_SUFFIX)}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """Return one array; its size is compared with its header before it is read."""
    with archive.open(member) as file:
        version = npy.read_magic(file)
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, kind = header(file, max_header_size=_LONGEST_HEADER)
        if kind.hasobject:
            raise UsageError(
                f"{member.filename}: expected an array of numbers, got pickled objects. "
                "Write a sparse matrix by scipy.sparse.save_npz."
            )
        there, expected = member.file_size - file.tell(), math.prod(shape) * kind.itemsize
        if there != expected:
            raise UsageError(f"{member.filename}: expected {expected} bytes of values, got {there}.")
        values = np.frombuffer(bytearray(file.read()), dtype=kind)
    return values.reshape(shape, order="F" if by_columns else "C")


def _sparse(archive: zipfile.ZipFile, members: Mapping[str, zipfile.ZipInfo]) -> Sparse:
    """Return the matrix of `scipy.sparse.save_npz`, whose places are checked."""
    from scipy import sparse

    kind = _array(archive, members["format"]).item()
    kind = kind.decode("latin-1") if isinstance(kind, bytes) else str(kind)
    names = _SPARSE.get(kind, ())
    if not names or not set(names) <= members.keys():
        expected = f"a sparse matrix of format {', '.join(_SPARSE)} with its places"
        raise UsageError(f"expected {expected}, got {kind[:20]!r} with {listed(members)}.")
    data, *places = (_array(archive, members[name]) for name in ("data", *names))
    shape = tuple(int(size) for size in _array(archive, members["shape"]).ravel())
    given = (data, tuple(places)) if kind == "coo" else (data, *places)
    return getattr(sparse, f"{kind}_array")(given, shape=shape)
