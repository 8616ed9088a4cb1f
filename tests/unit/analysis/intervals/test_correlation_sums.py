import math

import numpy as np
import pytest
from numpy.typing import NDArray

from vibroimpact.analysis.intervals.correlation import correlation_sums, fitted_slopes
from vibroimpact.analysis.intervals.dimension import interval_dimension
from vibroimpact.analysis.intervals.trains import interval_train
from vibroimpact.fmus.core import MOST_RADII, near_pairs, radius_ladder
from vibroimpact.fmus.errors import EstimationError, UsageError

Floats = NDArray[np.float64]


def henon(number: int) -> Floats:
    """Return x of the Henon map (a = 1.4, b = .3) on its attractor."""
    values, x, y = np.empty(number + 100), 0.1, 0.1
    for k in range(len(values)):
        x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
        values[k] = x
    return values[100:]


def logistic(number: int) -> Floats:
    """Return the logistic map at 4; its invariant density is the arcsine law, with dimension 1."""
    values, x = np.empty(number), 0.3
    for k in range(number):
        x = 4.0 * x * (1.0 - x)
        values[k] = x
    return values


def test_uniform_points_of_the_unit_square_have_the_correlation_sum_of_their_area() -> None:
    # (2 eps - eps^2)^2 is the probability that two uniform points of the square are within eps in both coordinates.
    # Delay vectors of a uniform sequence are such points, and pairs that share a number are a vanishing part.
    values = np.random.default_rng(1).random(20_000)
    radii = radius_ladder(1.0 / 64.0, 0.5)
    sums = correlation_sums(values, 2, theiler=1, radii=radii).sums[1]
    expected = (2.0 * radii - radii**2) ** 2
    # for 2e4 points the relative scatter of C is at most about sqrt(2 / (N eps))
    assert np.all(np.abs(sums / expected - 1.0) < 0.02)


def test_self_matches_are_never_counted_however_small_the_radius() -> None:
    values = np.random.default_rng(2).random(500)
    radii = radius_ladder(1e-12, 1e-9)
    assert not near_pairs(values, radii, 4).any()


def test_the_slopes_of_the_henon_map_saturate_at_its_dimension_of_1_2() -> None:
    # 1.20 to 1.25 in the literature (Grassberger and Procaccia 1983: 1.21 +- .01 by this method, 1.25 +- .02)
    sums = correlation_sums(henon(8000), 5, theiler=1)
    slopes = fitted_slopes(sums)
    assert np.all(np.abs(slopes[1:] - 1.21) < 0.05)
    # over the two decades of this statement the local slope stays there
    middle = (sums.radii > 0.01) & (sums.radii < 0.3)
    assert np.all(np.abs(sums.local_slopes[2, middle] - 1.21) < 0.2)


def test_the_slopes_of_the_logistic_map_do_not_grow_with_the_embedding_beyond_1() -> None:
    slopes = fitted_slopes(correlation_sums(logistic(6000), 4, theiler=1))
    # the two singularities of its density make the slope approach 1 slowly, from below
    assert np.all((slopes > 0.88) & (slopes < 1.05))


def test_the_slopes_of_white_noise_are_those_of_the_embedding() -> None:
    slopes = fitted_slopes(correlation_sums(np.random.default_rng(3).random(6000), 4, theiler=1))
    # the edges of the cube reduce the slope, more in higher dimensions
    assert np.all((slopes < np.arange(1, 5) + 0.05) & (slopes > 0.9 * np.arange(1, 5)))


def test_a_periodic_orbit_has_slope_0_at_every_embedding() -> None:
    values = np.tile([0.5, 0.7, 1.8], 200)
    sums = correlation_sums(values, 5)
    assert np.array_equal(fitted_slopes(sums), np.zeros(5))
    # a third of all pairs are the same point
    assert sums.sums[:, 0] == pytest.approx(1.0 / 3.0, abs=0.01)


def test_no_vector_reaches_over_a_gap() -> None:
    rng = np.random.default_rng(4)
    first, second = rng.random(200), rng.random(150)
    joined = np.concatenate([first, [np.nan], second])
    radii = radius_ladder(0.05, 1.0)
    sums = correlation_sums(joined, 3, radii=radii)
    # whole vectors: 198 and 148 of three values
    assert sums.pairs[2] == math.comb(198 + 148, 2)
    assert sums.near[2, -1] == sums.pairs[2]


def test_the_count_does_not_depend_on_the_number_of_threads() -> None:
    values = np.random.default_rng(5).normal(size=3000)
    radii = radius_ladder(0.01, 4.0)
    one = near_pairs(values, radii, 3, threads=1)
    assert np.array_equal(one, near_pairs(values, radii, 3, threads=3))


def test_a_block_boundary_loses_no_pair() -> None:
    # every pair of equal numbers is near, in any embedding and for any length about the block of 512
    for number in (2, 511, 512, 513, 1024, 1030):
        near = near_pairs(np.ones(number), radius_ladder(0.5, 1.0), 2)
        assert near[0, 0] == math.comb(number, 2)
        assert near[1, 0] == math.comb(number - 1, 2)


def test_radii_are_eight_to_the_octave_and_hold_their_ends() -> None:
    radii = radius_ladder(0.3, 5.0)
    assert radii[0] <= 0.3 < radii[1]
    assert radii[-2] < 5.0 <= radii[-1]
    assert np.array_equal(radii[8:], 2.0 * radii[:-8])


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: radius_ladder(0.0, 1.0), "0 < lowest < highest|1e-300 <= lowest"),
        (lambda: radius_ladder(1e-6, 1.0), f"at most {MOST_RADII}"),
        (lambda: near_pairs(np.ones(3), np.array([0.1, 0.2, 0.3]), 1), "radius_ladder"),
        (lambda: near_pairs(np.ones(3), radius_ladder(0.5, 1.0), 17), "embedding: expected 1 to 16, got 17"),
        (lambda: near_pairs(np.ones(3), radius_ladder(0.5, 1.0), 1, window=-1), "window"),
    ],
)
def test_what_cannot_be_counted_is_refused_with_the_reason(call: object, words: str) -> None:
    with pytest.raises(UsageError, match=words):
        call()  # type: ignore[operator]


def test_values_that_are_one_point_or_too_few_have_no_sums() -> None:
    with pytest.raises(EstimationError, match="one point, of dimension 0"):
        correlation_sums(np.ones(50), 2)
    with pytest.raises(EstimationError, match="at least one pair"):
        correlation_sums(np.array([1.0, 2.0, 3.0]), 3)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.02, 0.05, 0.1])
def test_a_dimension_that_noise_made_is_not_called_that_of_the_motion(noise: float) -> None:
    motion = henon(1500)
    intervals = motion + noise * np.std(motion) * np.random.default_rng(2).normal(size=len(motion))
    _, attributes = interval_dimension(interval_train(np.cumsum(2.0 + intervals)), "raw")
    words = attributes["dimension_raw"]
    assert "low-dimensional" in words
    assert ("with noise in it" in words) is (noise > 0.0)
