"""Intervals of real recordings: a neuron of the retina, and a ball on a bat, beat by beat."""

import numpy as np
import pytest
import scipy.io
from numpy.typing import NDArray
from support.real_data import recording_folder

from vibroimpact.analysis.intervals import interval_report, interval_train, seams
from vibroimpact.analysis.intervals.gaps import find_gaps
from vibroimpact.analysis.intervals.variability import coefficient_of_variation, fano_factor, rate

Floats = NDArray[np.float64]

SEAM, GRID = 3600.0, 0.02322
"""Time of the joint in the audio of the bounces, and frame length of its beat tracker, s."""


def retina(name: str) -> Floats:
    """Return the spikes of a train of 30 s."""
    content = scipy.io.loadmat(recording_folder("retina_spikes") / "08_spikes-1.mat")
    return np.asarray(content[name], dtype=np.float64).ravel()


def bounces() -> Floats:
    return np.loadtxt(recording_folder("ttd_bounces") / "ttd-world-record_beats.csv")


# numbers of the recording's notes: computed once from the file, with plain histograms
@pytest.mark.parametrize(
    ("name", "fano", "hertz", "variation"),
    [("SpikesLow", 0.7165, 25.0, 0.9642), ("SpikesHigh", 1.7781, 32.3, 2.0218)],
)
def test_a_neuron_has_its_rate_its_variation_and_its_fano_factor(
    name: str, fano: float, hertz: float, variation: float
) -> None:
    train = interval_train(retina(name), window=(0.0, 30.0))
    found = fano_factor(train, 0.05)
    assert found.value == pytest.approx(fano, abs=6e-5)
    # the value changes by a few percent with the offset of the bins; the report gives the range
    assert found.lowest < found.value < found.highest < 1.1 * found.value
    assert rate(train)[0] == pytest.approx(hertz, abs=1e-9)
    assert coefficient_of_variation(train) == pytest.approx(variation, abs=6e-5)


@pytest.mark.parametrize("name", ["SpikesLow", "SpikesHigh"])
def test_a_neuron_is_noise_on_log_intervals_and_raw_ones_flatten_as_their_surrogate(name: str) -> None:
    report = interval_report(retina(name), window=(0.0, 30.0), count_bin=0.05)
    assert report.attrs["slope_window"] == [1e-3, 1e-1]
    embedding = report["embedding"].values
    assert np.all(report["slope_log"].values >= 0.83 * embedding)
    assert np.all(np.abs(report["slope_raw"] - report["surrogate_slope_raw"]).values < 0.25)
    # without the surrogate this would be called a dimension
    assert float(report["slope_raw"][-1]) < 0.75 * 6.0
    assert report.attrs["dimension_log"].startswith("no saturation: noise-like")
    assert "surrogate" in report.attrs["dimension_raw"]


def test_a_neuron_on_a_grid_of_a_millisecond_is_warned_of_its_ties() -> None:
    content = scipy.io.loadmat(recording_folder("retina_spikes") / "08_spikes-2.mat")
    times = np.asarray(content["Spikes"], dtype=np.float64).ravel()
    report = interval_report(times, window=(0.0, 30.0), resolution=1e-3)
    assert float(report["rate"]) == pytest.approx(23.3, abs=0.05)
    assert "ties: only 145 of 699" in report.attrs["dimension_raw_warnings"]


def test_the_ball_bounces_156_49_times_a_minute_and_none_is_missed_beside_the_seams() -> None:
    times = bounces()
    spans = seams(SEAM, (float(times[0]), float(times[-1])))
    assert len(spans) == 5
    report = interval_report(times, masked=spans, resolution=GRID)
    assert 60.0 * float(report["rate"]) == pytest.approx(156.49, abs=0.005)
    assert report.sizes["gap"] == 0
    assert report.attrs["dimension_raw"].startswith("refused: only 19 distinct intervals")


def test_without_masks_the_gaps_are_the_five_seams_and_24_intervals_are_distinct() -> None:
    times = bounces()
    report = interval_report(times, resolution=GRID)
    beginnings, lengths = report["gap_start"].values, report["gap_length"].values
    seam = SEAM * np.arange(1, 6)
    # the tracker's beats end a little before the seam and start again a little after it
    assert np.all((beginnings < seam) & (beginnings + lengths > seam))
    assert "only 24 distinct intervals" in report.attrs["dimension_log"]


@pytest.mark.parametrize("part", [0.001, 0.01, 0.05])
def test_every_gap_is_found_where_beats_are_taken_out_at_random(part: float) -> None:
    times = bounces()
    spans = seams(SEAM, (float(times[0]), float(times[-1])))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        gone = rng.choice(np.arange(1, len(times) - 1), round(part * len(times)), replace=False)
        kept = np.delete(np.arange(len(times)), gone)
        train = interval_train(times[kept], masked=spans)
        true = (np.diff(kept) > 1) & train.kept
        gaps = find_gaps(train)
        # no gap is missed, and there is no false alarm
        assert np.array_equal(gaps.place, np.flatnonzero(true))
        right = gaps.missing == np.diff(kept)[gaps.place] - 1
        assert np.mean(right) > 0.99
