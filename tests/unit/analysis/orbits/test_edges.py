"""Starts side by side that end on different attractors."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.analysis.orbits.attractors.edges import neighbouring_pairs


@given(st.integers(0, 2**31), st.integers(1, 6), st.integers(1, 6))
@settings(max_examples=40)
def test_pairs_of_neighbours_are_those_counted_one_by_one(seed: int, rows: int, columns: int) -> None:
    labels = np.random.default_rng(seed).integers(-2, 3, (rows, columns)).astype(np.int16)
    counted: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for y, x in np.ndindex(labels.shape):
        for b, a in ((y + 1, x), (y, x + 1)):
            if (
                b < rows
                and a < columns
                and labels[y, x] != labels[b, a]
                and min(labels[y, x], labels[b, a]) >= 0
            ):
                ends = sorted(((int(labels[y, x]), y * columns + x), (int(labels[b, a]), b * columns + a)))
                (one, first), (other, second) = ends
                counted.setdefault((one, other), set()).add((first, second))
    found = {pair: {tuple(row) for row in places.tolist()} for pair, places in neighbouring_pairs(labels)}
    assert found == counted
    sizes = [len(places) for _, places in neighbouring_pairs(labels)]
    assert sizes == sorted(sizes, reverse=True)
