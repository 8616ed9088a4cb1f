"""Nastran OUTPUT4 files, written by the tests: each kind reads back to its last digit, and damage is one refusal."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.damaged_bytes import damaged, read_or_refused
from support.nastran_files import LAYOUTS, Layout, op4_binary, op4_text

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import Sources, op4, read_matrices
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

BOTH = Wanted({"stiffness": "", "mass": ""})


def matrix(size: int, seed: int, share: float = 0.4) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a symmetric matrix with zeros."""
    draw = np.random.default_rng(seed)
    full = draw.standard_normal((size, size)) * 10.0 ** draw.integers(-9, 9, (size, size))
    full[draw.random((size, size)) > share] = 0.0
    return np.triu(full) + np.triu(full, 1).T


STIFFNESS, MASS = matrix(9, 1), matrix(9, 2)
NAMED = {"KAA": STIFFNESS, "MAA": MASS}
SQUARES = st.integers(1, 7).flatmap(
    lambda size: arrays(
        np.float64,
        (size, size),
        elements=st.one_of(st.just(0.0), st.floats(-1e30, 1e30, allow_subnormal=False)),
    )
)


def read(content: bytes, wanted: Wanted = BOTH) -> dict[str, Any]:
    """Return the matrices of a file in full, by their roles."""
    return {role: found.toarray() for role, found in op4.read(content, wanted).matrices.items()}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("word", [4, 8])
def test_binary_files_of_both_byte_orders_read_back_bit_by_bit(layout: Layout, order: str, word: int) -> None:
    found = read(op4_binary(NAMED, layout, order=order, word=word))
    np.testing.assert_array_equal(found["stiffness"], STIFFNESS)
    np.testing.assert_array_equal(found["mass"], MASS)


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_files_of_single_precision_read_back_to_their_precision(layout: Layout, order: str) -> None:
    found = read(op4_binary(NAMED, layout, order=order, double=False))
    np.testing.assert_array_equal(found["stiffness"], STIFFNESS.astype(np.float32).astype(np.float64))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("letter", ["E", "D"])
@pytest.mark.parametrize("digits", [9, 16])
@pytest.mark.parametrize("double", [True, False])
def test_text_files_read_back_to_their_last_digit(
    layout: Layout, letter: str, digits: int, double: bool
) -> None:
    found = read(op4_text(NAMED, layout, letter=letter, digits=digits, double=double))
    for role, known in (("stiffness", STIFFNESS), ("mass", MASS)):
        rounded = np.array([float(f"{value:.{digits}E}") for value in known.ravel()]).reshape(known.shape)
        np.testing.assert_array_equal(found[role], rounded)


@settings(max_examples=40)
@given(SQUARES, st.sampled_from(LAYOUTS), st.sampled_from("<>"), st.sampled_from([4, 8]), st.booleans())
def test_any_matrix_reads_back_from_binary_and_text(
    full: np.ndarray[Any, np.dtype[np.float64]], layout: Layout, order: str, word: int, text: bool
) -> None:
    content = (
        op4_text({"K": full}, layout) if text else op4_binary({"K": full}, layout, order=order, word=word)
    )
    np.testing.assert_array_equal(read(content, Wanted({"stiffness": "K"}))["stiffness"], full)


@pytest.mark.parametrize("content", [op4_binary, op4_text])
def test_a_file_is_read_by_its_names_and_its_kind_is_found(tmp_path: Path, content: Any) -> None:
    path = tmp_path / "matrices.op4"
    wide = np.ones((3, 2))
    path.write_bytes(content({"PAX": wide} | NAMED | {"BAA": 2.0 * MASS, "K2": STIFFNESS}, "big"))
    found = read_matrices(Sources(file=str(path), stiffness="K2", damping="BAA"))
    np.testing.assert_array_equal(found.stiffness.toarray(), STIFFNESS)
    np.testing.assert_array_equal(found.mass.toarray(), MASS)
    assert found.damping is not None
    np.testing.assert_array_equal(found.damping.toarray(), 2.0 * MASS)
    assert found.freedoms == tuple(str(number) for number in range(1, 10))


@pytest.mark.parametrize("write", [op4_binary, op4_text])
@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"kind": 4}, "KAA: expected a matrix of real numbers, got complex ones"),
        ({"kind": 7}, "a type 1 to 4, got 9 columns, form 6, type 7"),
        ({"form": 3}, r"KAA: expected a square matrix in full, form 1 or 6, got form 3 \(diagonal\)"),
        ({"form": 77}, "a form 1 to 9"),
    ],
)
def test_matrices_that_are_none_of_a_structure_are_refused_by_name(
    write: Any, changed: dict[str, int], said: str
) -> None:
    with pytest.raises(UsageError, match=said):
        read(write(NAMED, **changed))


@pytest.mark.parametrize("write", [op4_binary, op4_text])
def test_a_wide_matrix_a_missing_one_and_one_that_comes_twice_are_refused(write: Any) -> None:
    with pytest.raises(UsageError, match="K: expected a square matrix, got one of 2 x 3"):
        read(write({"K": np.ones((2, 3))}), Wanted({"stiffness": "K"}))
    with pytest.raises(UsageError, match="expected a matrix 'KGG' .stiffness., got 'KAA', 'MAA'"):
        read(write(NAMED), Wanted({"stiffness": "KGG"}))
    with pytest.raises(UsageError, match="expected a matrix KAA once, got it 2 times"):
        read(write(NAMED) + write(NAMED))


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused_with_their_place(value: float) -> None:
    full = STIFFNESS.copy()
    full[4, 2] = value
    with pytest.raises(UsageError, match="KAA: row 5, column 3: expected a finite number"):
        read(op4_binary({"KAA": full, "MAA": MASS}))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("word", [4, 8])
def test_a_binary_file_that_ends_early_is_refused_at_every_length(layout: Layout, word: int) -> None:
    whole = op4_binary({"KAA": STIFFNESS[:4, :4], "MAA": MASS[:4, :4]}, layout, word=word)
    for length in range(0, len(whole), 4 if word == 4 else 12):
        with pytest.raises(UsageError, match="expected"):
            read(whole[:length])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_text_file_that_ends_early_is_refused_at_every_line(layout: Layout) -> None:
    lines = op4_text({"KAA": STIFFNESS[:4, :4], "MAA": MASS[:4, :4]}, layout).splitlines(keepends=True)
    for count in range(len(lines) - 1):
        with pytest.raises(UsageError, match="expected"):
            read(b"".join(lines[:count]))


@settings(max_examples=40)
@given(st.data())
def test_a_damaged_file_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    layout, text = data.draw(st.sampled_from(LAYOUTS)), data.draw(st.booleans())
    content = data.draw(damaged(op4_text(NAMED, layout) if text else op4_binary(NAMED, layout)))
    for matrix in (read_or_refused(lambda: read(content)) or {}).values():
        assert np.isfinite(matrix).all()


@pytest.mark.parametrize(
    ("at", "value", "said"),
    [
        (32, 40, "byte 76: expected 40, the length of the record, got 1"),
        (32, 4000, "byte 32: expected a record of 4000 bytes, got the end of the file"),
        (32, -8, "byte 32: expected the length of a record, got -8"),
        (36, 11, "expected the head of a matrix, got a record of 28 bytes"),
        (40, 8, "rows 1 to 2, got rows 8 to 9"),
        (40, -1, "of a column above 0"),
        (44, 2, "expected 2 words of a column, got 4"),
    ],
)
def test_records_that_lie_are_refused_with_their_place(at: int, value: int, said: str) -> None:
    content = bytearray(op4_binary({"K": np.array([[1.0, 2.0], [2.0, 5.0]])}))
    struct.pack_into("<i", content, at, value)
    with pytest.raises(UsageError, match=said):
        read(bytes(content), Wanted({"stiffness": "K"}))


def test_a_string_that_leaves_its_column_is_refused() -> None:
    content = bytearray(op4_binary({"K": np.eye(2)}, "sparse"))
    assert struct.unpack_from("<i", content, 48) == (1 + (3 << 16),)
    for length in (0, 2, 9):
        struct.pack_into("<i", content, 48, 1 + (length << 16))
        with pytest.raises(UsageError, match="K: column 1: expected a string within the column, got one of"):
            read(bytes(content), Wanted({"stiffness": "K"}))


@pytest.mark.parametrize("at", [84, 92])  # the length and the row of the first string
@pytest.mark.parametrize("value", [2**61 + 3, 2**63 - 1, -(2**63), 0, 3])
def test_long_words_that_overflow_are_refused(at: int, value: int) -> None:
    content = bytearray(op4_binary({"K": np.eye(2)}, "big", word=8))
    assert struct.unpack_from("<qq", content, 84) == (2, 1)
    struct.pack_into("<q", content, at, value)
    with pytest.raises(
        UsageError, match=r"K: column 1: expected (a string within the column|rows 1 to 2), got"
    ):
        read(bytes(content), Wanted({"stiffness": "K"}))


def test_a_text_line_with_wider_numbers_is_refused_with_its_line() -> None:
    content = op4_text({"K": np.eye(2)}).replace(b" 1.0000000000000000E+00", b" 1.00000000000000000E+01", 1)
    with pytest.raises(
        UsageError, match="line 3: expected 1 numbers of 23 characters, 3 in a line, got '1.00"
    ):
        read(content, Wanted({"stiffness": "K"}))


def test_a_text_whose_long_string_has_a_line_of_another_length_is_refused_with_its_line() -> None:
    lines = op4_text({"K": np.full((7, 7), 1.5)}).split(b"\n")
    lines[3] = lines[3][:-1]
    lines[2] += b"0"
    with pytest.raises(
        UsageError, match="K: line 3: expected numbers of 23 characters, 3 in a line, got '1.5"
    ):
        read(b"\n".join(lines), Wanted({"stiffness": "K"}))


@pytest.mark.parametrize("wrong", [b"nan", b"1_0", b"0x1", b"1 2", b"", b"1e", b"--1"])
def test_texts_that_are_no_numbers_are_refused_with_their_line(wrong: bytes) -> None:
    content = op4_text({"K": np.eye(3)}).replace(b" 1.0000000000000000E+00", wrong.rjust(23), 1)
    with pytest.raises(UsageError, match="line 3: expected .*numbers of 23 characters"):
        read(content, Wanted({"stiffness": "K"}))


@pytest.mark.parametrize("end", [b"\r\n", b"   \n", b" \0\n"])
def test_blanks_at_the_ends_of_lines_do_not_matter(end: bytes) -> None:
    found = read(op4_text(NAMED, "sparse").replace(b"\n", end) + b"\x1a")
    np.testing.assert_array_equal(found["stiffness"], STIFFNESS)
