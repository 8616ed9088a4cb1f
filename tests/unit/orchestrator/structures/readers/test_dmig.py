"""DMIG cards of Nastran, written by the tests: fields of each kind read back, and damage is one refusal."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.damaged_bytes import damaged, read_or_refused
from support.nastran_files import DIGITS, STYLES, Style, dmig

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import Sources, read_matrices
from vibroimpact.orchestrator.structures.readers import dmig as cards
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

FREEDOMS = ("3.x", "3.rz", "12.z", "12.rx", "12.ry", "700001", "8000000.y")
DRAW = np.random.default_rng(5)
FULL = DRAW.standard_normal((7, 7)) * 10.0 ** DRAW.integers(-9, 9, (7, 7))
SYMMETRIC = np.triu(FULL) + np.triu(FULL, 1).T
MASS = np.diag([2.0, 0.0, 1.5, 0.25, 0.0, 4.0, 1.0])
ALONE = Wanted({"stiffness": ""})
HEAD = b"DMIG    KAAX           0       6       2       0                       2\n"


def rounded(matrix: Any, style: Style) -> Any:
    """Return the numbers of a matrix as a style writes them."""
    return np.array([float(f"{value:.{DIGITS[style]}E}") for value in matrix.ravel()]).reshape(matrix.shape)


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("symmetric", [True, False])
def test_fields_of_each_kind_read_back_to_their_last_digit(style: Style, symmetric: bool) -> None:
    known = SYMMETRIC if symmetric else FULL
    found = cards.read(dmig("KAAX", known, FREEDOMS, style, symmetric=symmetric), ALONE)
    assert found.freedoms == FREEDOMS
    np.testing.assert_array_equal(found.matrices["stiffness"].toarray(), rounded(known, style))


def test_matrices_of_a_deck_share_their_degrees_of_freedom(tmp_path: Path) -> None:
    path = tmp_path / "model.pch"
    deck = b"$ a comment\nSOL 103\nBEGIN BULK\nGRID*                  3               0 1.500000000D+00 2.5\n"
    deck += b"*        -3.+1\nGRID,12,,1.,2.,3.\nGRID           7       5      1.      2.      3.\n"
    deck += b"CBAR    1\n        2\n"
    path.write_bytes(
        deck
        + dmig("KAAX", SYMMETRIC[:5, :5], FREEDOMS[:5])
        + dmig("PAX", FULL, FREEDOMS, symmetric=False, form=9)
        + dmig("MAAX", MASS, FREEDOMS, "small", kind=1)
        + dmig("BAAX", FULL[:2, :2], FREEDOMS[:2], "free", symmetric=False)
        + b"ENDDATA\n"
    )
    found = read_matrices(Sources(file=str(path)))
    assert found.freedoms == tuple(name for name in FREEDOMS)
    np.testing.assert_array_equal(found.mass.toarray(), MASS)
    np.testing.assert_array_equal(found.stiffness.toarray()[:5, :5], rounded(SYMMETRIC[:5, :5], "large"))
    assert found.stiffness.nnz == 25
    assert found.damping is not None
    np.testing.assert_array_equal(found.damping.toarray()[:2, :2], rounded(FULL[:2, :2], "free"))
    assert found.coordinates is not None
    np.testing.assert_array_equal(found.coordinates[:2], [[1.5, 2.5, -30.0]] * 2)
    np.testing.assert_array_equal(found.coordinates[2:5], [[1.0, 2.0, 3.0]] * 3)
    assert np.isnan(found.coordinates[5:]).all()


def test_the_lower_triangle_of_a_symmetric_matrix_is_as_good_as_the_upper() -> None:
    lower = dmig("KAAX", np.tril(SYMMETRIC), FREEDOMS, symmetric=False).replace(
        b"       1       2       0", b"       6       2       0", 1
    )
    assert lower.startswith(b"DMIG        KAAX       0       6")
    found = cards.read(lower, ALONE)
    np.testing.assert_array_equal(found.matrices["stiffness"].toarray(), rounded(SYMMETRIC, "large"))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"DMIG,KAAX,0,9,2\n", "KAAX: expected form 6 .symmetric. or 1 .square., got 9"),
        (b"DMIG,KAAX,0,6,4\n", "KAAX: expected real numbers, type 1 or 2, got type 4"),
        (b"DMIG,KAAX,0,six,2\n", "line 1: KAAX: expected an integer, got 'six'"),
        (HEAD + HEAD, "line 2: KAAX: expected one head of the matrix, got another"),
        (b"DMIG,KAAX,1,1,,1,1,2.\n", "line 1: KAAX: expected the head of the matrix, got a column"),
        (HEAD + b"DMIG,KAAX,1,7,,1,1,2.\n", "a component from 0 to 6, got 1 and 7"),
        (HEAD + b"DMIG,KAAX,1,1,,-4,1,2.\n", "line 2: KAAX: expected a node and a component"),
        (HEAD + b"DMIG,KAAX,1,1,,1,1,2.,3.\n", "expected a real number, got the imaginary part '3.'"),
        (HEAD + b"DMIG,KAAX,1,1,,1,1,2.\n+,1,2,1_0\n", "line 3: KAAX: expected a number, got '1_0'"),
        (HEAD + b"DMIG,KAAX,1,1,,1,2,2.\nDMIG,KAAX,1,2,,1,1,2.\n", "number at .1.[xy], 1.[xy]., got two"),
        (HEAD + b"DMIG,KAAX,1,1,,1,1,1.+999\n", "KAAX: row 1, column 1: expected a finite number, got inf"),
        (HEAD, "expected 1 to 1000000 unknowns, got 0"),
        (b"GRID,1,,a\n" + HEAD, "line 1: GRID: expected a number, got 'a'"),
        (b"DMIG,MAAX,0,6,2\n", "expected a matrix 'KAAX' .stiffness., got 'MAAX'"),
        (b"BEGIN BULK\n", "expected a matrix 'KAAX' .stiffness., got none"),
    ],
)
def test_damaged_cards_are_refused_with_their_line(content: bytes, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        cards.read(content, Wanted({"stiffness": "KAAX"}))


@settings(max_examples=40)
@given(st.sampled_from(STYLES), st.data())
def test_a_damaged_deck_is_read_or_refused_in_one_line(style: Style, data: st.DataObject) -> None:
    content = data.draw(damaged(b"GRID,3,,1.,2.,3.\n" + dmig("KAAX", SYMMETRIC, FREEDOMS, style)))
    found = read_or_refused(lambda: cards.read(content, ALONE))
    if found is not None:
        assert np.isfinite(found.matrices["stiffness"].data).all()
        assert len(set(found.freedoms)) == len(found.freedoms)
