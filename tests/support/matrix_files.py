"""Files of matrices as other programs write them: texts with all digits, archives of numpy, and MATLAB's."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.io import savemat

from support.nastran_files import op4_binary, op4_text

Floats = NDArray[np.float64]


def market(matrix: Floats, symmetry: str = "general", *, dense: bool = False) -> bytes:
    """Return a Matrix Market file; `symmetry` is `general`, `symmetric` or `skew-symmetric`."""
    size = len(matrix)
    first = {"general": -size, "symmetric": 0, "skew-symmetric": 1}[symmetry]
    inside = [(row, column) for column in range(size) for row in range(size) if row - column >= first]
    if dense:
        body = "".join(f"{float(matrix[place])!r}\n" for place in inside)
        return f"%%MatrixMarket matrix array real {symmetry}\n{size} {size}\n{body}".encode()
    there = [place for place in inside if matrix[place]]
    body = "".join(f"{row + 1} {column + 1} {float(matrix[row, column])!r}\n" for row, column in there)
    head = f"%%MatrixMarket matrix coordinate real {symmetry}\n% a comment\n\n{size} {size} {len(there)}\n"
    return (head + body).encode()


def calculix(matrix: Floats) -> bytes:
    """Return a `.sti` file: the upper triangle by columns, with all entries of the diagonal."""
    size = len(matrix)
    there = [
        (row, column)
        for column in range(size)
        for row in range(column + 1)
        if row == column or matrix[row, column]
    ]
    lines = (f"{row + 1} {column + 1} {matrix[row, column]:20.13e}\n" for row, column in there)
    return "".join(lines).encode()


def npz(matrices: Mapping[str, Any]) -> bytes:
    """Return a packed archive of dense arrays by name."""
    content = io.BytesIO()
    np.savez_compressed(content, **matrices)
    return content.getvalue()


def sparse_npz(matrix: Floats, kind: str = "csc", *, packed: bool = True) -> bytes:
    """Return the archive of one sparse matrix of a format of scipy."""
    content = io.BytesIO()
    sparse.save_npz(content, sparse.coo_array(matrix).asformat(kind), compressed=packed)
    return content.getvalue()


def matlab(matrices: Mapping[str, Any], version: str = "5", *, packed: bool = False) -> bytes:
    """Return a MATLAB file of version 4 or 5."""
    content = io.BytesIO()
    savemat(content, dict(matrices), format=version, do_compression=packed)
    return content.getvalue()


def matlab_7_3(matrices: Mapping[str, Any]) -> bytes:
    """Return a MATLAB file of version 7.3; a sparse matrix is a group, and the dimensions of a full one are swapped."""
    content = io.BytesIO()
    with h5py.File(content, "w", userblock_size=512) as file:
        for name, matrix in matrices.items():
            if not sparse.issparse(matrix):
                file[name] = np.asarray(matrix).T
                file[name].attrs["MATLAB_class"] = b"double"
                continue
            columns = sparse.csc_array(matrix)
            group = file.create_group(name)
            group.attrs["MATLAB_class"] = b"double"
            group.attrs["MATLAB_sparse"] = np.uint64(columns.shape[0])
            group["jc"] = columns.indptr.astype(np.uint64)
            if columns.nnz:
                group["data"], group["ir"] = columns.data, columns.indices.astype(np.uint64)
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon Nov 30 08:00:00 2026 HDF5 schema 1.00 ."
    return head.ljust(124) + b"\x00\x02IM" + content.getvalue()[128:]


ONE_MATRIX: Mapping[str, Callable[[Floats], bytes]] = {
    "general.mtx": market,
    "symmetric.mtx": lambda matrix: market(matrix, "symmetric"),
    "dense.mtx": lambda matrix: market(matrix, dense=True),
    "lower.mtx": lambda matrix: market(matrix, "symmetric", dense=True),
    **{
        f"{kind}.npz": lambda matrix, kind=kind: sparse_npz(matrix, kind)  # type: ignore[misc]
        for kind in ("csc", "csr", "coo", "dia", "bsr")
    },
    "model.sti": calculix,
}
"""Writers of one symmetric matrix by the name of a file; a `.sti` file keeps 14 digits."""
SEVERAL: Mapping[str, Callable[[Mapping[str, Any]], bytes]] = {
    "model.npz": npz,
    "old.mat": lambda matrices: matlab(matrices, "4"),
    "model.mat": matlab,
    "packed.mat": lambda matrices: matlab(matrices, packed=True),
    "new.mat": matlab_7_3,
    "binary.op4": lambda matrices: op4_binary(matrices, "sparse"),
    "text.op4": lambda matrices: op4_text(matrices, "big"),
}
"""Writers of several matrices by the name of a file."""


def drawn_matrix(chance: np.random.Generator, size: int) -> Floats:
    """Return a symmetric matrix of numbers over 24 decades, half of which are 0."""
    values = chance.normal(size=(size, size)) * 10.0 ** chance.integers(-12, 12, (size, size))
    values[chance.random((size, size)) < 0.5] = 0.0
    return np.tril(values) + np.tril(values, -1).T
