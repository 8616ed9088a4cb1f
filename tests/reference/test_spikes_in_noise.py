"""Spikes six to sixteen times as high as the noise: the automatic threshold finds each once, and adds few others."""

from __future__ import annotations

from itertools import islice, product

import numpy as np
import pytest
from support.spike_signals import NOISES, SHAPES, SpikeRecord, channel

from vibroimpact.analysis.spikes.identify import SpikeSettings, identify

RATIOS = (6.0, 8.0, 10.0, 12.0, 16.0)


@pytest.mark.parametrize(
    ("records", "samples"), [(60, 10_000), pytest.param(420, 40_000, marks=pytest.mark.long)]
)
def test_spikes_of_eight_times_the_noise_are_found_once_and_nothing_else(records: int, samples: int) -> None:
    kinds = list(product(SHAPES, NOISES, RATIOS))
    rounds = ((seed, *kind) for seed in range(1 + records // len(kinds)) for kind in kinds)
    there, found, others = dict.fromkeys(RATIOS, 0), dict.fromkeys(RATIOS, 0), 0
    for seed, shape, noise, ratio in islice(rounds, records):
        rng = np.random.default_rng([seed, SHAPES.index(shape), NOISES.index(noise), int(ratio)])
        record = SpikeRecord(rng, shape, ratio, noise, samples)
        report = identify(record.channel)
        instants = np.array([report.excursions.up[group.first] for group in report.groups])
        once, none = record.found_once(instants)
        there[ratio] += record.starts.size
        found[ratio] += once
        others += none
        # a threshold that hides spikes has to give a remark
        if record.starts.size - once > 10:
            assert report.doubts, (shape, noise, ratio, seed)
    for ratio in RATIOS[1:]:
        assert found[ratio] >= 0.95 * there[ratio], (ratio, found, there)
    assert others < 0.1 * records


@pytest.mark.parametrize("shape", SHAPES)
def test_all_half_cycles_of_a_spike_count_as_its_samples(shape: str) -> None:
    """A ringing cell has no half cycle of four samples above the threshold, but enough samples in all half cycles."""
    rng = np.random.default_rng(7)
    record = SpikeRecord(rng, shape, 10.0, "white")
    report = identify(record.channel, SpikeSettings(noise=1.0))
    instants = np.array([report.excursions.up[group.first] for group in report.groups])
    assert record.found_once(instants) == (record.starts.size, 0)


@pytest.mark.parametrize(
    ("part", "drift", "kept"),
    [
        (0.2, 0.0, np.float64),
        (0.3, 0.4, np.float32),
        (0.4, 0.0, np.float64),
        (0.5, 1.0, np.float64),
        (0.6, 2.0, np.float32),
        (1.0, 0.4, np.float64),
        (2.0, 0.0, np.float32),
    ],
)
def test_a_quiet_record_of_a_converter_has_no_spike_and_an_impact_of_forty_steps_is_one(
    part: float, drift: float, kept: type
) -> None:
    rng, step, count = (
        np.random.default_rng([int(10 * part), int(10 * drift)]),
        2.44140625e-3 / 0.0218,
        40_000,
    )
    signal = rng.normal(0.13, part, count) + drift * np.arange(count) / count
    for impacts in (0, 1):
        signal[6000:6050] += impacts * 40.0 * np.sin(np.pi * np.arange(50) / 50.0)
        values = (np.round(signal) * step).astype(kept).astype(np.float64)
        report = identify(channel(values, 1.0 / 60_000.0))
        assert len(report.groups) == impacts
        assert report.noise >= step / np.sqrt(12.0)
        assert report.threshold >= 1.5 * step
        if part < 0.9:
            (remark,) = [text for text in report.remarks if "grid" in text]
            assert f"{step:.4g}" in remark
        assert report.verdict == "sure."


def test_a_dead_channel_is_told() -> None:
    dead = identify(channel(np.full(1000, 1.25), 1e-3))
    assert not dead.groups
    assert dead.verdict == "not sure, because all 1000 samples are 1.25: the channel is dead."


def test_the_levels_of_a_switch_are_no_steps() -> None:
    signal = np.zeros(2000)
    for start in range(100, 2000, 200):
        signal[start : start + 12] = 5.0
    assert len(identify(channel(signal, 1e-3), SpikeSettings(method="threshold")).groups) == 10
