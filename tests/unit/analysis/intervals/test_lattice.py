import numpy as np
import pytest
from numpy.typing import NDArray

from vibroimpact.analysis.intervals import interval_report, interval_train
from vibroimpact.analysis.intervals.delay_shares import expected_shares, lattice_share, observed_shares
from vibroimpact.analysis.intervals.lattice import interval_lattice

Floats = NDArray[np.float64]


def spike_train(
    rng: np.random.Generator, places: int, missed: float, spurious: float, jitter: float, drift: float = 0.0
) -> Floats:
    """Return spikes of a period-1 motion of 1 s: some missed, at most one spurious in an interval (thesis 5.4.3)."""
    true = np.arange(float(places)) + drift * np.sin(2.0 * np.pi * np.arange(places) / places)
    extra = np.flatnonzero(rng.random(places - 1) < spurious)
    kept = (true + jitter * rng.normal(size=places))[rng.random(places) >= missed]
    return np.sort(np.concatenate([kept, true[extra] + rng.random(len(extra))]))


@pytest.mark.parametrize(
    ("missed", "spurious", "jitter", "drift"),
    [(0.1, 0.0, 0.01, 0.0), (0.05, 0.02, 0.02, 0.0), (0.3, 0.1, 0.005, 0.0), (0.1, 0.04, 0.01, 3.0)],
)
def test_missed_and_spurious_spikes_lie_within_their_standard_errors_at_the_right_rate(
    missed: float, spurious: float, jitter: float, drift: float
) -> None:
    found = [
        interval_lattice(
            interval_train(spike_train(np.random.default_rng(k), 1500, missed, spurious, jitter, drift))
        )
        for k in range(80)
    ]
    assert not any(lattice.reason for lattice in found)
    scores = np.array([(f.missed.value - missed) / f.missed.standard_error for f in found])
    # of 80 normal scores 68 % +- 5.2 % are within 1; their mean scatters by .11
    assert 0.52 < np.mean(np.abs(scores) < 1.0) < 0.84
    assert abs(scores.mean()) < 0.4
    if spurious > 0.0:
        scores = np.array([(f.spurious.value - spurious) / f.spurious.standard_error for f in found])
        assert 0.52 < np.mean(np.abs(scores) < 1.0) < 0.84
        assert abs(scores.mean()) < 0.4
    else:
        assert all(lattice.counted_spurious == 0 for lattice in found)


def test_delay_points_of_missed_and_of_spurious_spikes_have_their_known_shares() -> None:
    # by hand: p = .1 gives .81, .081, .0081; s = .04 gives (1-s)^2/(1+s), s/(1+s), 2 s(1-s)/(1+s), s^2/(1+s)
    assert [lattice_share(0.1, 0.0, 1, j) for j in (1, 2, 3)] == pytest.approx([0.81, 0.081, 0.0081])
    assert lattice_share(0.1, 0.0, 2, 3) == pytest.approx(0.9**2 * 0.1**3)
    shares = expected_shares(0.0, 0.04)
    assert shares == pytest.approx([0.886154, 0.0, 0.038462, 2 * 0.036923, 0.001538], abs=1e-6)
    assert shares.sum() == pytest.approx(1.0)


@pytest.mark.parametrize(("missed", "spurious"), [(0.1, 0.0), (0.0, 0.04), (0.1, 0.04)])
def test_a_long_simulation_has_the_shares_that_the_probabilities_give(missed: float, spurious: float) -> None:
    train = interval_train(spike_train(np.random.default_rng(7), 100_000, missed, spurious, 0.002))
    observed = observed_shares(train, interval_lattice(train))
    expected = expected_shares(missed, spurious)
    # counts of about 1e5 points: 5 standard errors, plus spurious spikes on the lattice, which are invisible (2 %)
    margin = 5.0 * np.sqrt(expected / 1e5) + 1e-6 + 0.03 * spurious * (expected > 0.0)
    assert np.all(np.abs(observed - expected) < margin)


def test_the_interval_of_the_lattice_is_known_much_better_than_the_bins_of_the_density() -> None:
    lattice = interval_lattice(
        interval_train(spike_train(np.random.default_rng(1), 2000, 0.1, 0.04, 0.01) * 0.0452)
    )
    assert lattice.interval == pytest.approx(0.0452, rel=2e-5)
    # the scatter about the mean of 41 neighbours is slightly different from that of the spikes
    assert lattice.jitter == pytest.approx(0.01 * 0.0452, rel=0.2)


def test_nothing_missed_is_a_bound_not_a_certainty() -> None:
    lattice = interval_lattice(interval_train(np.arange(300.0)))
    assert lattice.missed.value == 0.0
    # exact binomial: 1 - .05^(1/299)
    assert lattice.missed.upper == pytest.approx(1.0 - 0.05 ** (1.0 / 299.0))


def test_masked_spans_are_no_missed_spikes() -> None:
    times = np.concatenate([np.arange(100.0), np.arange(150.0, 250.0)])
    lattice = interval_lattice(interval_train(times, masked=[(99.5, 149.5)]))
    assert (lattice.counted_missed, lattice.places) == (0, 198)


def test_a_train_without_a_clock_has_no_lattice() -> None:
    rng = np.random.default_rng(2)
    for times in (
        np.cumsum(rng.exponential(size=800)),
        np.cumsum(rng.normal(1.0, 0.15, 800)),
        np.sort(rng.uniform(0.0, 300.0, 400)),
    ):
        lattice = interval_lattice(interval_train(times))
        assert "no single lattice" in lattice.reason
        assert np.isnan(lattice.missed.value)


def test_two_spikes_per_cycle_are_no_lattice_of_missed_ones() -> None:
    report = interval_report(np.cumsum(np.tile([0.5, 0.7, 1.8], 100)), forcing_period=1.0)
    assert report.attrs["lattice"] == "no single lattice: the intervals repeat after 3"


def test_the_motion_is_read_through_missed_and_spurious_spikes() -> None:
    times = spike_train(np.random.default_rng(3), 1000, 0.2, 0.1, 0.01)
    report = interval_report(times, forcing_period=0.5)
    assert report.attrs["cycle"].startswith("P(1,2)")


def test_misses_that_come_in_a_rhythm_are_not_taken_for_chance() -> None:
    # every fifth spike is missed: as many delay points at (I, I) as at (I, 2I) and (2I, I) together
    times = np.arange(600.0)[np.arange(600) % 5 > 0]
    train = interval_train(times)
    lattice = interval_lattice(train)
    assert lattice.missed.value == pytest.approx(0.2, abs=0.01)
    shares, expected = observed_shares(train, lattice), expected_shares(lattice.missed.value, 0.0)
    assert abs(shares[0] - expected[0]) > 0.1
    assert "repeat after 4" in interval_report(times).attrs["lattice"]
