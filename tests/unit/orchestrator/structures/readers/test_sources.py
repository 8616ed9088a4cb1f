"""Matrices from several files fit together, and no file harms the process that asks for it."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.matrix_files import ONE_MATRIX, SEVERAL, drawn_matrix, market, npz
from support.places import TESTS

from vibroimpact.fmus import reader_process
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import Sources, apart, child, found, read_matrices
from vibroimpact.orchestrator.structures.readers.wanted import listed

K, M, C = (drawn_matrix(np.random.default_rng(seed), 4) for seed in (1, 2, 3))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, matrix in (("k", K), ("m", M), ("c", C)):
        (tmp_path / f"{name}.mtx").write_bytes(market(matrix))
    (tmp_path / "all.npz").write_bytes(npz({"K": K, "M": M, "C": C}))
    (tmp_path / "freedoms.csv").write_text("node,direction,x\n1,z,0\n2,z,1\n3,z,2\n4,z,3\n")
    return tmp_path


def refusal(sources: Sources) -> str:
    with pytest.raises(UsageError) as refused:
        read_matrices(sources)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_each_matrix_has_its_file(folder: Path) -> None:
    got = read_matrices(Sources("k.mtx", "m.mtx", "c.mtx", freedoms="freedoms.csv", folder=folder))
    matrices: tuple[Any, ...] = (got.stiffness, got.mass, got.damping)
    for one, matrix in zip(matrices, (K, M, C), strict=True):
        np.testing.assert_array_equal(one.toarray(), matrix)
    assert got.freedoms == ("1.z", "2.z", "3.z", "4.z")
    assert got.coordinates is not None
    assert got.coordinates[:, 0].tolist() == [0.0, 1.0, 2.0, 3.0]
    assert got.rigid("z").tolist() == [1.0] * 4
    assert got.combination({"2.z": 1.0, "4.z": -1.0}).tolist() == [0.0, 1.0, 0.0, -1.0]


def test_one_file_has_all_matrices_and_freedoms_are_numbered(folder: Path) -> None:
    got = read_matrices(Sources(file="all.npz", folder=folder))
    assert got.damping is not None
    np.testing.assert_array_equal(got.damping.toarray(), C)
    assert (got.freedoms, got.coordinates) == (("1", "2", "3", "4"), None)
    assert read_matrices(Sources("k.mtx", "m.mtx", folder=folder)).damping is None
    swapped = read_matrices(Sources("M", "K", file="all.npz", folder=folder))
    np.testing.assert_array_equal(swapped.stiffness.toarray(), M)
    twice = read_matrices(Sources("all.npz", "all.npz", folder=folder))
    np.testing.assert_array_equal(twice.mass.toarray(), M)


@pytest.mark.parametrize("name", ["general.mtx", "csr.npz", "model.sti", "model.npz", "model.mat", "new.mat"])
@pytest.mark.parametrize("forks", [True, False], ids=["by a fork", "by the server"])
def test_a_file_of_every_format_is_read_in_the_other_process_as_here(
    tmp_path: Path, name: str, forks: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reader_process, "FORKS", forks)
    path = tmp_path / name
    path.write_bytes(SEVERAL[name]({"K": K, "M": M}) if name in SEVERAL else ONE_MATRIX[name](K))
    options = {"names": {"stiffness": ""} | ({"mass": ""} if name in SEVERAL else {}), "optional": []}
    got = apart.read_file_apart(path, f"{child.__name__}:read", options, found.unpacked, ("scipy.io",))
    facts, buffers = child.read(str(path), options)
    here = found.unpacked(facts, [bytearray(buffer) for buffer in buffers])
    assert list(got.matrices) == list(here.matrices)
    for role, matrix in got.matrices.items():
        assert (matrix != here.matrices[role]).nnz == 0
        matrix.data[0] = 1.0  # writable, as any array


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"stiffness": "k.mtx"}, "mass: expected a file of the mass matrix, got none"),
        ({"stiffness": "k.mtx", "mass": "none.mtx"}, "none.mtx: expected a file that can be read, got"),
        ({"stiffness": "k.mtx", "mass": "."}, ": expected a regular file, got another kind"),
        ({"stiffness": "k.mtx", "mass": "empty.mtx"}, "empty.mtx: expected a file of 1 to"),
        ({"stiffness": "k.mtx", "mass": "five.mtx"}, "five.mtx: expected 4 unknowns, as in k.mtx, got 5"),
        ({"stiffness": "k.mtx", "mass": "m.mtx", "freedoms": "two.csv"}, "two.csv: expected 4 degrees of freedom"),
        (
            {"stiffness": "k.mtx", "mass": "m.mtx", "freedoms": "same.csv"},
            "same.csv: expected each degree of freedom once, got 'a' again (3)",
        ),
        ({"file": "k.mtx"}, "k.mtx: expected a file of several matrices"),
        ({"file": "all.npz", "damping": "B"}, "all.npz: expected a matrix 'B' (damping), got 'K', 'M', 'C'"),
        ({"file": "freedoms.csv"}, "freedoms.csv: expected a file of matrices (.mtx"),
        ({"file": "a\0b"}, "expected the path of a file, got one with a null character"),
    ],
)  # fmt: skip
def test_files_that_do_not_fit_are_refused_with_their_names(
    folder: Path, given: Mapping[str, Any], said: str
) -> None:
    (folder / "five.mtx").write_bytes(market(np.eye(5)))
    (folder / "empty.mtx").write_bytes(b"")
    (folder / "two.csv").write_text("name\na\nb\n")
    (folder / "same.csv").write_text("name\na\nb\na\nd\n")
    assert said in refusal(Sources(**given, folder=folder))


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"way": "crash"},
            "expected a whole file, got one that crashes the library which reads it (SIGSEGV)",
        ),
        ({"way": "memory"}, "expected a file that fits into the memory, got a larger one"),
        ({"way": "error"}, "expected a whole file, got KeyError: 'what no reader foresaw'"),
        ({"way": "", "facts": {"sizes": {"stiffness": 3}}}, "got one that its library misreads"),
        ({"way": "", "facts": {"sizes": {"a": 4, "b": 4}}}, "got one that its library misreads"),
        ({"way": "", "facts": {"sizes": []}}, "got one that its library misreads"),
        ({"way": "", "facts": {"freedoms": 3}}, "got one that its library misreads"),
        ({"way": "", "facts": {"coordinates": True}}, "got one that its library misreads"),
    ],
)
def test_a_reader_that_goes_wrong_ends_in_one_line(
    folder: Path, options: Mapping[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # the server, which is asked where a fork has crashed, starts anew and finds this reader
    monkeypatch.setenv("PYTHONPATH", str(TESTS))
    reader_process._server.close()
    path = folder / "k.mtx"
    with pytest.raises(UsageError) as refused:
        apart.read_file_apart(path, "support.harmful_reader:read", options, found.unpacked)
    assert str(refused.value).startswith(f"{path}: ")
    assert said in str(refused.value)


def test_a_reader_writes_nothing(folder: Path) -> None:
    before = (folder / "k.mtx").read_bytes()
    with pytest.raises(UsageError, match=r"k\.mtx: expected"):
        apart.read_file_apart(
            folder / "k.mtx", "support.harmful_reader:read", {"way": "write"}, found.unpacked
        )
    assert (folder / "k.mtx").read_bytes() in (before, b"")  # opened, but never written


def nastran(path: Path, name: str, entries: Mapping[tuple[str, str], float]) -> None:
    """Write a DMIG file of a symmetric matrix by its degrees of freedom, such as `12.3`."""
    lines = [f"DMIG    {name:8}       0       6       2       0"]
    for (column, row), value in entries.items():
        lines += [f"DMIG,{name},{','.join(column.split('.'))},,{','.join(row.split('.'))},{value}"]
    path.write_text("\n".join(lines) + "\n")


def test_files_with_names_are_brought_into_one_order(tmp_path: Path) -> None:
    nastran(tmp_path / "k.pch", "KAAX", {("1.3", "1.3"): 2.0, ("2.3", "1.3"): -1.0, ("2.3", "2.3"): 3.0})
    nastran(tmp_path / "m.pch", "MAAX", {("2.3", "2.3"): 0.5})
    sources = Sources("k.pch", "m.pch", folder=tmp_path)
    got = read_matrices(sources)
    assert got.freedoms == ("1.z", "2.z")
    assert got.stiffness.toarray().tolist() == [[2.0, -1.0], [-1.0, 3.0]]
    assert got.mass.toarray().tolist() == [[0.0, 0.0], [0.0, 0.5]]
    (tmp_path / "places.csv").write_text("name,x\n2.z,20\n1.z,10\n")
    placed = read_matrices(replace(sources, freedoms="places.csv"))
    assert placed.freedoms == got.freedoms
    assert placed.coordinates is not None
    assert placed.coordinates[:, 0].tolist() == [10.0, 20.0]
    for wrong, said in (("2.z,1\n1.x,2\n", "got none named '1.z'"), ("1.z,1\n2.z,2\n3.z,3\n", "got 3 names")):
        (tmp_path / "places.csv").write_text(f"name,x\n{wrong}")
        expected = "places.csv: expected the 2 degrees of freedom of the matrices"
        assert f"{expected}, {said}" in refusal(replace(sources, freedoms="places.csv"))


def test_hashes_name_all_files_that_are_read(folder: Path) -> None:
    sources = Sources("k.mtx", "m.mtx", freedoms=str(folder / "freedoms.csv"), folder=folder)
    hashes = sources.hashes()
    assert list(hashes) == ["k.mtx", "m.mtx", "freedoms.csv"]
    assert hashes["k.mtx"] == hashlib.sha256((folder / "k.mtx").read_bytes()).hexdigest()


def test_a_message_lists_few_names() -> None:
    assert listed([str(number) for number in range(99)]).endswith("'7' and 91 more")
    assert len(listed(["a" * 1000])) < 50
