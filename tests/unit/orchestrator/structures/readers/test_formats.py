"""Matrices that the tests write are read back to the bit in each format; wrong files are refused in a line."""

from __future__ import annotations

import gzip
import io
import sys
import zipfile
from collections.abc import Mapping
from typing import Any

import h5py
import numpy as np
import pytest
from scipy import sparse
from scipy.io import mmwrite
from support.matrix_files import (
    ONE_MATRIX,
    SEVERAL,
    Floats,
    drawn_matrix,
    market,
    matlab,
    matlab_7_3,
    npz,
    sparse_npz,
)

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import child
from vibroimpact.orchestrator.structures.readers.found import Found
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

STIFFNESS = Wanted({"stiffness": ""})
BOTH = Wanted({"stiffness": "", "mass": "", "damping": ""}, frozenset({"damping"}))


def read(name: str, content: bytes, wanted: Wanted = STIFFNESS) -> Found:
    return child.reader_of(name, content)(content, wanted)


def refusal(name: str, content: bytes, wanted: Wanted = STIFFNESS) -> str:
    with pytest.raises(UsageError) as refused:
        read(name, content, wanted)
    return str(refused.value)


def close(got: Any, matrix: Floats, digits: float) -> None:
    np.testing.assert_allclose(got.toarray(), matrix, rtol=digits, atol=0.0)
    assert got.format == "csc"
    assert got.has_sorted_indices
    assert np.all(got.data != 0.0)


@pytest.mark.parametrize("name", sorted(ONE_MATRIX))
def test_a_matrix_is_read_back_to_the_bit(name: str) -> None:
    matrix = drawn_matrix(np.random.default_rng(1), 9)
    got = read(name, ONE_MATRIX[name](matrix)).matrices["stiffness"]
    close(got, matrix, 1e-13 if name.endswith(".sti") else 0.0)


@pytest.mark.parametrize(
    ("name", "is_sparse"),
    [*((name, False) for name in SEVERAL), *((name, True) for name in SEVERAL if "mat" in name)],
)
def test_matrices_of_one_file_are_read_by_their_usual_names(name: str, is_sparse: bool) -> None:
    chance = np.random.default_rng(2)
    full = {role: drawn_matrix(chance, 5) for role in ("K", "M", "C")}
    written = {role: sparse.csc_array(one) for role, one in full.items()} if is_sparse else full
    got = read(name, SEVERAL[name](written), BOTH).matrices
    for role, letter in (("stiffness", "K"), ("mass", "M"), ("damping", "C")):
        close(got[role], full[letter], 0.0)


@pytest.mark.parametrize("name", sorted(SEVERAL))
def test_a_matrix_is_read_by_its_name_and_damping_may_be_missing(name: str) -> None:
    one, other = np.diag([1.0, 2.0]), np.diag([3.0, 4.0])
    content = SEVERAL[name]({"K1": one, "mass": other, "K2": 2.0 * one})
    got = read(name, content, Wanted({"stiffness": "K2", "mass": "", "damping": ""}, frozenset({"damping"})))
    assert list(got.matrices) == ["stiffness", "mass"]
    close(got.matrices["stiffness"], 2.0 * one, 0.0)
    said = refusal(name, content, BOTH)
    assert "expected a stiffness matrix, named one of stiffness, K, KAA" in said
    assert "'K1'" in said
    assert "expected a matrix 'K3' (mass), got" in refusal(name, content, Wanted({"mass": "K3"}))


def test_scipys_own_files_are_read() -> None:
    matrix = drawn_matrix(np.random.default_rng(3), 6)
    whole = np.round(matrix)
    for written, full in ((matrix, matrix), (sparse.coo_array(matrix), matrix), (whole.astype(int), whole)):
        content = io.BytesIO()
        mmwrite(content, written, precision=17)
        close(read("a.mtx", content.getvalue()).matrices["stiffness"], full, 0.0)


def test_other_kinds_of_numbers_are_read() -> None:
    matrix = np.array([[4.0, 1.0], [1.0, 3.0]])
    for kind in (">f8", "f4", "i8", "u1"):
        close(read("a.npz", npz({"K": matrix.astype(kind)})).matrices["stiffness"], matrix, 0.0)
    by_columns = np.asfortranarray([[1.0, 2.0], [3.0, 4.0]])
    close(read("a.npz", npz({"K": by_columns})).matrices["stiffness"], np.array(by_columns), 0.0)


def test_a_skew_symmetric_matrix_keeps_its_signs() -> None:
    matrix = np.array([[0.0, 2.0, 0.0], [-2.0, 0.0, 5.0], [0.0, -5.0, 0.0]])
    for dense in (False, True):
        content = market(matrix, "skew-symmetric", dense=dense)
        close(read("a.mtx", content, Wanted({"damping": ""})).matrices["damping"], matrix, 0.0)


def test_a_format_is_known_by_its_first_bytes() -> None:
    matrix = np.diag([1.0, 2.0])
    for content in (market(matrix), npz({"K": matrix}), matlab({"K": matrix}), matlab_7_3({"K": matrix})):
        close(read("export.bin", content).matrices["stiffness"], matrix, 0.0)
    assert refusal("export.bin", b"1 1 2.0\n").startswith("expected a file of matrices (.mtx, .npz")


HEAD = b"%%MatrixMarket matrix coordinate real symmetric\n"
WRONG: Mapping[str, tuple[str, bytes, str]] = {
    "another banner": ("a.mtx", b"%MatrixMarket\n1 1 1\n1 1 1\n", "line 1: expected %%MatrixMarket matrix"),
    "complex": ("a.mtx", HEAD.replace(b"real", b"complex") + b"1 1 1\n1 1 1 0\n", "line 1: expected"),
    "a pattern": ("a.mtx", HEAD.replace(b"real", b"pattern") + b"1 1 1\n1 1\n", "line 1: expected"),
    "not square": ("a.mtx", HEAD + b"2 3 1\n1 1 1\n", "expected a square matrix, got one of 2 x 3"),
    "sizes that are none": ("a.mtx", HEAD + b"%\n2 2 x\n1 1 1\n", "line 3: expected the numbers of rows"),
    "huge sizes": ("a.mtx", HEAD + b"999999999999 999999999999 1\n1 1 1\n", "expected 1 to 1000000 unknowns"),
    "no sizes": ("a.mtx", HEAD, "expected a line of sizes, got the end of the file"),
    "too few entries": ("a.mtx", HEAD + b"2 2 3\n1 1 1\n2 2 1\n", "expected 3 entries, got 2. The file ends early"),
    "too many entries": ("a.mtx", HEAD + b"2 2 1\n1 1 1\n2 2 1\n", "expected 1 entries, got 2"),
    "a word": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n\n2 2 1,5\n", "line 5: expected a row, a column and a number, got"),
    "a number less": ("a.mtx", HEAD + b"2 2 2\n1 1\n2 2 1\n", "line 3: expected a row, a column and a number, got"),
    "a number more": ("a.mtx", HEAD + b"2 2 2\n1 1 1 1\n2 2 1\n", "line 3: expected a row, a column"),
    "a fraction as a row": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n2.0 2 1\n", "line 4: expected a row, a column"),
    "outside": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n3 2 1\n", "line 4: expected a row and a column from 1 to 2"),
    "counted from 0": ("a.mtx", HEAD + b"2 2 2\n0 0 1\n1 1 1\n", "line 3: expected a row and a column from 1"),
    "no number": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n2 2 nan\n", "line 4: expected a finite number, got '2 2 nan'"),
    "beyond numbers": ("a.mtx", HEAD + b"2 2 2\n1 1 1e999\n2 2 1\n", "line 3: expected a finite number"),
    "twice": ("a.mtx", HEAD + b"2 2 3\n1 1 1\n2 1 1\n1 2 1\n", "line 5: expected each entry once, got '1 2 1'"),
    "a cut end": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n2 2 1.2", "expected a line break at the end, got none"),
    "old line ends": ("a.mtx", HEAD + b"2 2 2\n1 1 1\r2 2 nan\n", "line 3: expected a row, a column and a number, got"),
    "another space": ("a.mtx", HEAD + b"2 2 2\n1 1 1\n2 2\xa01\n", "line 4: expected a row, a column"),
    "a skew diagonal": ("a.mtx", HEAD.replace(b"sym", b"skew-sym") + b"1 1 1\n1 1 1\n", "line 3: expected 0 on"),
    "names in one": ("a.mtx", HEAD + b"1 1 1\n1 1 1\n", ""),
    "an archive of text": ("a.npz", npz({"K": np.array([["a"]])}), "expected real numbers, got <U1"),
    "complex numbers": ("a.npz", npz({"K": np.array([[1j]])}), "expected real numbers, got complex numbers"),
    "a vector": ("a.npz", npz({"K": np.ones(3)}), "expected a matrix, got an array of 1 dimensions"),
    "infinite": ("a.npz", npz({"K": np.diag([1.0, np.inf])}), "row 2, column 2: expected a finite number, got inf"),
    "a pickle": ("a.npz", npz({"K": np.array([[None]])}), "K.npy: expected an array of numbers, got pickled objects"),
    "no archive": ("a.npz", b"PK\x03\x04" + bytes(80), "expected a whole .npz file, got one that cannot be read (Bad"),
    "no MATLAB file": ("a.mat", bytes(400), "expected a "),
    "a cut MATLAB file": ("a.mat", matlab({"K": np.eye(9)})[:500], "expected a whole MATLAB file"),
    "a cut file of 7.3": ("a.mat", matlab_7_3({"K": np.eye(9)})[:900], "expected a whole MATLAB file"),
    "a row less": ("a.sti", b"1 1  1.0\n1 2  1.0\n", "expected all entries of the diagonal, the last one at the end"),
    "an empty column": ("a.sti", b"1 1  1.0\n3 3  1.0\n", "got 2 up to column 3"),
    "an empty text": ("a.sti", b"\n", "expected 1 to 1000000 unknowns, got 0"),
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(WRONG))
def test_a_wrong_file_is_refused_with_the_place(kind: str) -> None:
    name, content, said = WRONG[kind]
    if kind == "names in one":
        text = refusal(name, content, BOTH)
        assert text.startswith("expected a file of several matrices, got one whose matrix has no name")
        return
    text = refusal(name, content)
    assert said in text
    assert "\n" not in text


def test_an_archive_that_lies_about_its_sizes_is_refused() -> None:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        array = io.BytesIO()
        np.lib.format.write_array_header_1_0(
            array, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}
        )
        archive.writestr("K.npy", array.getvalue() + bytes(800))
    said = refusal("a.npz", content.getvalue())
    assert said == "K.npy: expected 8000000000000 bytes of values, got 800."


def test_places_of_a_sparse_archive_are_checked() -> None:
    right = sparse_npz(np.diag([1.0, 2.0, 3.0]), packed=False)
    with zipfile.ZipFile(io.BytesIO(right)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for name, value in (("indices.npy", 7), ("indices.npy", -1), ("indptr.npy", 9)):
        array = bytearray(members[name])
        array[-4:] = int(value).to_bytes(4, "little", signed=True)
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w") as archive:
            for member, known in {**members, name: bytes(array)}.items():
                archive.writestr(member, known)
        assert "expected a whole .npz file" in refusal("a.npz", content.getvalue())


def test_a_file_of_matlab_7_3_follows_no_link_and_names_the_missing_package(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file["K"] = h5py.ExternalLink("/etc/other.h5", "K")
        file["text"] = "hello"
    assert "got none" in refusal("a.mat", content.getvalue())
    right = matlab_7_3({"K": np.eye(2)})
    monkeypatch.setitem(sys.modules, "h5py", None)
    assert "expected the package h5py" in refusal("a.mat", right)


def test_a_packed_file_is_unpacked_and_a_damaged_one_refused(tmp_path: Any) -> None:
    path = tmp_path / "k.mtx.gz"
    text = market(np.diag([1.0, 2.0]))
    packed = gzip.compress(text)
    path.write_bytes(packed)
    assert child.unpacked_content(path) == (text, "k.mtx")
    for wrong in (packed[:-9], packed[:20] + b"\xff" + packed[21:]):
        path.write_bytes(wrong)
        with pytest.raises(UsageError, match="expected a whole gzip file"):
            child.unpacked_content(path)


def test_a_packed_file_is_unpacked_up_to_a_limit(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "MOST_BYTES", 1000)
    path = tmp_path / "k.mtx.gz"
    path.write_bytes(gzip.compress(bytes(5000)))
    with pytest.raises(UsageError, match="got more than 1000 bytes"):
        child.unpacked_content(path)
