import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.correlation import correlation_sums
from vibroimpact.fmus.core import near_pairs, radius_ladder

Floats = NDArray[np.float64]

RADII = radius_ladder(2.0**-10, 8.0)

# grids of quarters and of thirds: ties among distances, and with radii of the ladder
numbers = st.one_of(
    st.floats(-4.0, 4.0, allow_subnormal=False),
    st.integers(-16, 16).map(lambda k: k / 4.0),
    st.integers(-12, 12).map(lambda k: k / 3.0),
    st.just(float("nan")),
)
sequences = st.lists(numbers, min_size=2, max_size=60).map(lambda values: np.array(values))


def brute_force(values: Floats, embedding: int, window: int) -> tuple[list[int], int]:
    """Return near pairs for every radius, and pairs of whole vectors, counted one by one."""
    vectors = np.lib.stride_tricks.sliding_window_view(values, embedding)
    distances = [
        float(np.max(np.abs(vectors[i] - vectors[j])))
        for i in range(len(vectors))
        for j in range(i + window + 1, len(vectors))
    ]
    return [sum(d < radius for d in distances) for radius in RADII], sum(d == d for d in distances)


@given(sequences, st.integers(1, 5), st.integers(0, 7))
@settings(max_examples=60)
def test_near_pairs_are_those_of_a_count_one_by_one(values: Floats, embedding: int, window: int) -> None:
    found = near_pairs(values, RADII, embedding, window=window)
    for m in range(1, min(embedding, len(values)) + 1):
        expected, pairs = brute_force(values, m, window)
        assert found[m - 1].tolist() == expected
        if pairs and m == embedding:
            assert correlation_sums(values, m, theiler=window, radii=RADII).pairs[-1] == pairs


@given(sequences, st.randoms(use_true_random=False))
@settings(max_examples=40)
def test_without_a_window_single_numbers_may_come_in_any_order(values: Floats, order: object) -> None:
    shuffled = values.copy()
    order.shuffle(shuffled)  # type: ignore[attr-defined]
    assert np.array_equal(near_pairs(values, RADII, 1), near_pairs(shuffled, RADII, 1))


@given(sequences, st.integers(1, 6))
@settings(max_examples=40)
def test_c_grows_with_the_radius_and_falls_with_the_embedding(values: Floats, embedding: int) -> None:
    near = near_pairs(values, RADII, embedding)
    assert np.all(np.diff(near, axis=1) >= 0)
    assert np.all(np.diff(near, axis=0) <= 0)
