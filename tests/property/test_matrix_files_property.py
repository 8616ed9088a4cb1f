"""Any symmetric matrix is read back from any format; any damage is refused in a line, or leaves a sound matrix."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support.damaged_bytes import damaged, read_or_refused
from support.matrix_files import ONE_MATRIX, SEVERAL, Floats, calculix

from vibroimpact.orchestrator.structures.readers.calculix import read_freedoms, read_nodes
from vibroimpact.orchestrator.structures.readers.child import Reader, reader_of
from vibroimpact.orchestrator.structures.readers.found import Found
from vibroimpact.orchestrator.structures.readers.freedoms import read_table
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

WANTED = Wanted({"stiffness": ""})
DAMAGED = tuple(sorted({*ONE_MATRIX, "model.npz"}))
"""Formats whose readers are safe in this process; `soak.grammar_matrices` damages the others."""
WORDS = ("*NODE", "*node, nset=a", "**", "12.3", "1.7", "name", "node", "direction", "9.5", *'xyz ,;\t\n#"1a')
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def matrices(draw: st.DrawFn) -> Floats:
    size = draw(st.integers(1, 6))
    rows = draw(st.lists(st.one_of(st.just(0.0), NUMBERS), min_size=size * size, max_size=size * size))
    lower = np.tril(np.array(rows).reshape(size, size))
    return lower + np.tril(lower, -1).T


def written(name: str, matrix: Floats) -> bytes:
    return ONE_MATRIX[name](matrix) if name in ONE_MATRIX else SEVERAL[name]({"K": matrix})


def read(name: str, content: bytes) -> Floats:
    reader: Reader = reader_of(name, content)
    found: Floats = reader(content, WANTED).matrices["stiffness"].toarray()
    return found


@settings(max_examples=80, deadline=None)
@given(st.sampled_from(sorted({*ONE_MATRIX, *SEVERAL})), matrices())
def test_a_matrix_is_read_back_to_the_bit(name: str, matrix: Floats) -> None:
    rounded = np.array([[float(f"{one:.13e}") for one in row] for row in matrix])
    expected = rounded if name.endswith("sti") else matrix
    assume(np.all(np.isfinite(expected)))
    np.testing.assert_array_equal(read(name, written(name, matrix)), expected)


@settings(max_examples=150, deadline=None)
@given(st.sampled_from(DAMAGED), st.data())
def test_damage_is_refused_in_a_line_or_leaves_a_sound_matrix(name: str, data: st.DataObject) -> None:
    matrix = np.diag([2.0, 3.0, 1e-9]) + math.pi
    content = data.draw(damaged(written(name, matrix)))
    got = read_or_refused(lambda: read(name, content))
    if got is not None:
        assert np.all(np.isfinite(got))
    if got is not None and name.endswith(".npz"):  # its numbers have checksums
        np.testing.assert_array_equal(got, matrix)


@settings(max_examples=60, deadline=None)
@given(matrices(), st.data())
def test_a_cut_file_of_calculix_is_refused_or_smaller(matrix: Floats, data: st.DataObject) -> None:
    content = calculix(np.clip(matrix, -1e300, 1e300))
    cut = content[: data.draw(st.integers(0, len(content) - 1))]
    got = read_or_refused(lambda: read("model.sti", cut))
    assert got is None or len(got) < len(matrix)


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from((read_table, read_freedoms, read_nodes)),
    st.one_of(st.text(max_size=80), st.lists(st.sampled_from(WORDS), max_size=30).map("".join)),
)
def test_any_text_names_freedoms_or_nodes_or_is_refused_in_a_line(
    reader: Callable[[bytes], Found | tuple[Floats, Floats]], text: str
) -> None:
    found = read_or_refused(lambda: reader(text.encode("utf-8", "surrogatepass")))
    if isinstance(found, Found):
        assert found.freedoms
        assert found.coordinates is None or found.coordinates.shape == (len(found.freedoms), 3)
    elif found is not None:
        assert found[1].shape == (len(found[0]), 3)
        assert np.all(np.isfinite(found[1]))
