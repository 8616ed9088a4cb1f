"""Spikes in signals with known spikes; `spike_signals.py` makes the signals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from support.spike_signals import channel, pink, pulses, time_above

from vibroimpact.analysis.recording import Quality, TimeAxis
from vibroimpact.analysis.spikes import (
    Mechanics,
    SpikeSettings,
    calibrate,
    contact_time_measure,
    identify,
    measure_pulses,
    spike_report,
)
from vibroimpact.analysis.spikes.cycle import find_cycle
from vibroimpact.analysis.spikes.report import unobserved
from vibroimpact.fmus.core.measuring import LoadCell
from vibroimpact.fmus.errors import EstimationError, UsageError

# A half-sine of the load cell: peak 2.5, .8 ms long, every 50 ms, sampled at 40 kHz, threshold .3.
PEAK, LENGTH, PERIOD, RATE, THRESHOLD = 2.5, 0.8e-3, 0.05, 40_000.0, 0.3
COUNT = 41


def half_sines(offset: float = 0.3e-5) -> tuple[np.ndarray, np.ndarray]:
    time = np.arange(int(COUNT * PERIOD * RATE)) / RATE
    starts = 0.02 + offset + PERIOD * np.arange(COUNT)
    return time, pulses(time, starts, np.full(COUNT, PEAK), LENGTH)


def test_half_sines_have_the_contact_time_impulse_and_peak_of_their_formulas() -> None:
    # mu_H = (length/period)(1 - (2/pi) arcsin(H/A)) = .0147747373 and J = 2 A length / pi = 1.27324e-3, by hand
    _, signal = half_sines()
    report = spike_report(channel(signal, 1.0 / RATE), SpikeSettings(threshold=THRESHOLD))
    data = report.dataset
    assert data.sizes["spike"] == COUNT
    assert float(data["contact_time_measure"]) == pytest.approx(0.0147747373, rel=1e-3)
    assert data["spike_impulse"].values == pytest.approx(1.27324e-3, rel=2e-3)
    assert data.attrs["waveform"] == "half_sine"
    assert data.sel(waveform="half_sine")["spike_fit_length"].values == pytest.approx(LENGTH, rel=2e-3)
    # the share sqrt(1 - (H/A)^2) = .992774 of the impulse is between the two crossings of the threshold
    assert data["spike_impulse_above"].values == pytest.approx(0.992774 * 1.27324e-3, rel=2e-3)


def test_a_sampled_peak_falls_short_by_no_more_than_its_bound_and_the_band_limited_one_is_nearer() -> None:
    # deficit 1 - cos(pi h / (2 length)) = .0012045 at 40 kHz; offsets over a whole sampling interval
    sampled, limited = [], []
    for offset in np.linspace(0.0, 1.0 / RATE, 5):
        _, signal = half_sines(offset)
        found = measure_pulses(identify(channel(signal, 1.0 / RATE), SpikeSettings(threshold=THRESHOLD)))
        short = 1.0 - found.sampled_peak / PEAK
        assert np.all(short <= found.deficit / PEAK * 1.01 + 1e-9)
        assert found.deficit == pytest.approx(0.0012045 * PEAK, rel=0.02)
        sampled.append(np.max(short))
        limited.append(np.max(np.abs(1.0 - found.peak / PEAK)))
    assert max(sampled) > 0.001
    assert max(limited) < 0.5 * max(sampled)


@pytest.mark.parametrize("waveform", ["half_sine", "haversine", "bell"])
@pytest.mark.parametrize("part", [0.02, 0.1, 0.3])
def test_impulse_depends_neither_on_the_threshold_nor_on_the_waveform(waveform: str, part: float) -> None:
    time = np.arange(4000) / RATE
    length = LENGTH if waveform != "bell" else LENGTH / 5.0
    signal = pulses(time, np.array([0.05]), np.array([PEAK]), length, waveform)
    whole = {"half_sine": 2.0 / np.pi, "haversine": 0.5, "bell": np.sqrt(2.0 * np.pi)}[waveform]
    settings = SpikeSettings(threshold_part=part, minimum_samples=2)
    found = measure_pulses(identify(channel(signal, 1.0 / RATE), settings))
    assert found.waveform == waveform
    assert found.impulse == pytest.approx(whole * PEAK * length, rel=4e-3)


def test_contact_time_of_three_spikes_and_its_standard_error() -> None:
    # .0012 + .001 + .0014 over .15 s is .024; S_j - mu I_j is 0, -.2, .2 ms: error .2e-3 / sqrt(3) / .05
    found = contact_time_measure(np.array([0.0, 0.05, 0.1, 0.15]), np.array([1.2e-3, 1e-3, 1.4e-3, 9.0]))
    assert found.measure == pytest.approx(0.024)
    assert found.standard_error == pytest.approx(0.2e-3 / np.sqrt(3.0) / 0.05)
    with pytest.raises(EstimationError, match="at least 2 spikes, got 1"):
        contact_time_measure(np.array([0.0]), np.array([1e-3]))


def noise(kind: str, rng: np.random.Generator, length: int) -> np.ndarray:
    if kind == "white":
        return rng.standard_normal(length)
    if kind == "pink":
        return pink(rng, length)
    if kind == "laplace":
        return rng.laplace(size=length)
    return rng.standard_t(3.0, length)


@pytest.mark.parametrize("kind", ["white", "pink", "laplace", "student"])
def test_noise_alone_has_no_spikes_and_no_cycle(kind: str) -> None:
    # 25 records with .1 false alarms each: 2.5 are expected for an exact law. The four samples that a spike needs
    # exclude nearly all of them.
    rng = np.random.default_rng(5)
    settings = SpikeSettings(false_alarms=0.1)
    alarms = 0
    for _ in range(25):
        found = identify(channel(noise(kind, rng, 4000), 1e-3), settings)
        assert not found.cycle.found
        alarms += len(found.groups)
    assert alarms <= 2


@pytest.mark.parametrize("kind", ["white", "laplace", "student"])
def test_single_samples_of_noise_pass_the_threshold_as_often_as_stated(kind: str) -> None:
    # one sample is enough for a spike: 60 records at .1 false alarms have at most 6 in expectation. A Poisson law of
    # mean 6 exceeds 12 once in a hundred times.
    rng = np.random.default_rng(6)
    settings = SpikeSettings(method="threshold", minimum_samples=1, false_alarms=0.1)
    alarms = sum(len(identify(channel(noise(kind, rng, 2000), 1e-3), settings).groups) for _ in range(60))
    assert alarms <= 12


def test_a_decaying_ring_is_no_periodic_excitation_and_a_steady_one_is() -> None:
    time = np.arange(20_000) * 1e-3
    rng = np.random.default_rng(7)
    wave = np.sin(2.0 * np.pi * 5.0 * time)
    for decay in (0.02, 0.1, 0.5):
        ring = find_cycle(np.exp(-decay * time) * wave + 1e-3 * rng.standard_normal(len(time)))
        assert not ring.found, ring.reason
    steady = find_cycle(wave + 0.1 * rng.standard_normal(len(time)))
    assert steady.period == pytest.approx(200.0, rel=1e-4)
    assert steady.count >= 99


def test_the_period_of_a_wave_with_strong_harmonics_is_that_of_its_fundamental() -> None:
    place = np.arange(12_000)
    phase = 2.0 * np.pi * place / 329.9413
    signal = 0.3 * np.sin(phase) + 0.1 * np.cos(2.0 * phase + 1.0) + np.sin(3.0 * phase)
    found = find_cycle(signal + 0.01 * np.random.default_rng(8).standard_normal(len(place)))
    assert found.period == pytest.approx(329.9413, rel=1e-5)


def test_a_train_of_impacts_is_spikes_though_it_repeats_exactly() -> None:
    _, signal = half_sines()
    noisy = signal + 0.02 * np.random.default_rng(9).standard_normal(len(signal))
    found = identify(channel(noisy, 1.0 / RATE))
    assert found.method == "threshold"
    assert len(found.groups) == COUNT


def test_a_smooth_shock_too_small_for_a_threshold_is_found_in_a_periodic_signal() -> None:
    rng = np.random.default_rng(10)
    time = np.arange(12_000) * 6e-4
    wave = np.sin(2.0 * np.pi * 5.0 * time) + 0.02 * rng.standard_normal(len(time))
    shock = 0.3 * np.exp(-0.5 * ((time - 3.96) / 0.05) ** 2)
    assert not identify(channel(wave, 6e-4)).groups
    found = identify(channel(wave + shock, 6e-4))
    assert found.method == "cycle_median"
    assert len(found.groups) == 1
    assert measure_pulses(found).peak_time[0] == pytest.approx(3.96, abs=0.03)
    assert not identify(channel(wave + shock, 6e-4), SpikeSettings(method="threshold")).groups


def test_a_spike_and_its_ringing_are_one_spike_and_a_second_impact_is_another() -> None:
    time = np.arange(20_000) / 2e5
    ring = np.zeros(len(time))
    for start, peak in ((0.01, 1000.0), (0.06, 300.0)):
        later = np.maximum(time - start, 0.0)
        # first a half-sine of .2 ms, then ringing at 8 kHz that decays within 5 ms
        ring += pulses(time, np.array([start]), np.array([peak]), 2e-4)
        ring += (later > 2e-4) * 0.3 * peak * np.exp(-later / 1e-3) * np.sin(2.0 * np.pi * 8e3 * later)
    noisy = ring + 0.5 * np.random.default_rng(11).standard_normal(len(time))
    found = measure_pulses(identify(channel(noisy, 5e-6, "m s-2")))
    assert len(found) == 2
    assert np.all(found.excursions > 5)
    assert found.start == pytest.approx([0.01, 0.06], abs=1e-5)
    separate = identify(channel(noisy, 5e-6, "m s-2"), SpikeSettings(merge=0.0))
    assert len(separate.groups) > 10


def test_contacts_of_like_strength_in_quick_succession_are_so_many_spikes() -> None:
    # 5 lengths apart, with nothing in between: no ringing, which would be weaker
    time = np.arange(8000) / RATE
    starts = 0.05 + 5.0 * LENGTH * np.arange(6)
    signal = pulses(time, starts, np.array([2.0, 1.5, 1.8, 2.5, 1.6, 2.0]), LENGTH)
    signal += 0.01 * np.random.default_rng(19).standard_normal(len(time))
    found = measure_pulses(identify(channel(signal, 1.0 / RATE)))
    assert found.start == pytest.approx(starts, abs=5e-5)


def test_drift_larger_than_the_spikes_moves_neither_count_nor_impulse() -> None:
    time, signal = half_sines()
    rng = np.random.default_rng(12)
    drift = 5.0 * np.sin(2.0 * np.pi * time / 1.5)
    noisy = signal + 0.02 * rng.standard_normal(len(time))
    still = measure_pulses(identify(channel(noisy, 1.0 / RATE)))
    moved = measure_pulses(identify(channel(noisy + drift, 1.0 / RATE)))
    assert len(moved) == len(still) == COUNT
    assert moved.impulse.mean() == pytest.approx(still.impulse.mean(), rel=0.01)


def test_polarity_chooses_the_sign_of_the_spikes() -> None:
    time = np.arange(8000) / RATE
    signal = pulses(time, np.array([0.05, 0.15]), np.array([PEAK, -PEAK]), LENGTH)
    signal += 0.02 * np.random.default_rng(13).standard_normal(len(time))
    peaks = {
        polarity: np.sign(
            measure_pulses(identify(channel(signal, 1 / RATE), SpikeSettings(polarity=polarity))).peak
        )
        for polarity in ("both", "positive", "negative")
    }
    assert peaks["both"].tolist() == [1.0, -1.0]
    assert peaks["positive"].tolist() == [1.0]
    assert peaks["negative"].tolist() == [-1.0]


def test_the_curve_of_a_spike_below_the_baseline_lies_below_it() -> None:
    time = np.arange(8000) / RATE
    signal = pulses(time, np.array([0.05, 0.15]), np.array([PEAK, -PEAK]), LENGTH)
    signal += 0.01 * np.random.default_rng(13).standard_normal(len(time))
    data = spike_report(channel(signal, 1 / RATE)).dataset
    fitted = data.spike_fit_peak.sel(waveform="half_sine").values
    assert fitted == pytest.approx(data.spike_peak.values, rel=0.02)


def test_clipped_and_cut_off_spikes_are_said_to_be_so() -> None:
    time = np.arange(8000) / RATE
    signal = pulses(time, np.array([-LENGTH / 2.0, 0.05, 0.15]), np.full(3, PEAK), LENGTH)
    signal += 0.01 * np.random.default_rng(14).standard_normal(len(time))
    quality = np.where(signal > 2.0, np.uint8(Quality.clipped), np.uint8(0))
    quality[time > 0.1] = 0
    clipped = replace(channel(np.minimum(signal, 2.0), 1 / RATE), quality=quality)
    data = spike_report(clipped).dataset
    assert int(data["spikes_cut_off"]) == 1
    assert data["spike_clipped"].values.tolist() == [1, 0]
    assert "clipped" in data.attrs["remarks"]


def test_missing_samples_are_bridged_and_their_spike_is_marked() -> None:
    time, signal = half_sines()
    values = signal + 0.01 * np.random.default_rng(15).standard_normal(len(signal))
    values[(time > 0.0704) & (time < 0.07045)] = np.nan
    values[(time > 0.09) & (time < 0.1)] = np.nan
    report = spike_report(channel(values, 1.0 / RATE))
    data = report.dataset
    assert data.sizes["spike"] == COUNT
    # only the longer pause could hide a spike
    assert np.array(unobserved(report)) == pytest.approx(np.array([[0.09, 0.1]]), abs=2.0 / RATE)
    assert np.flatnonzero(data["spike_clipped"].values).tolist() == [1]


def test_velocity_needs_a_mass_for_a_force_and_none_for_an_acceleration() -> None:
    # J = 4e-4 N s, m = .02 kg, r = .6: V = .0125 m/s, by hand
    time = np.arange(4000) / RATE
    signal = pulses(time, np.array([0.05]), np.array([4e-4 * np.pi / (2.0 * LENGTH)]), LENGTH)
    force = spike_report(channel(signal, 1 / RATE), None, Mechanics(mass=0.02, restitution=0.6)).dataset
    assert force["spike_velocity"].values == pytest.approx(0.0125, rel=2e-3)
    shaken = channel(signal / 0.02, 1 / RATE, "m s-2")
    assert spike_report(shaken, None, Mechanics(restitution=0.6)).dataset[
        "spike_velocity"
    ].values == pytest.approx(0.0125, rel=2e-3)
    with pytest.raises(UsageError, match="Give mass too"):
        spike_report(channel(signal, 1 / RATE), None, Mechanics(restitution=0.6))
    with pytest.raises(UsageError, match=r"0 <= r <= 1, got 1\.2"):
        spike_report(shaken, None, Mechanics(restitution=1.2))


def test_known_impulses_give_the_sensitivity_that_was_used() -> None:
    # 21.8 mV/N is the load cell of thesis section 5.3
    rng = np.random.default_rng(16)
    time = np.arange(40_000) / RATE
    impulses = np.array([0.5, 1.0, 2.0, 4.0]) * 1e-3
    forces = pulses(time, np.array([0.1, 0.3, 0.5, 0.8]), impulses * np.pi / (2.0 * LENGTH), LENGTH)
    volts = channel(0.0218 * (forces + 0.01 * rng.standard_normal(len(time))), 1 / RATE, "V")
    report = spike_report(volts, None, Mechanics(known_impulses=impulses, mass=0.02, restitution=0.6))
    assert report.calibration is not None
    assert report.calibration.sensitivity == pytest.approx(0.0218, rel=0.01)
    assert report.dataset["spike_impulse"].attrs["units"] == "N s"
    assert report.dataset["spike_impulse"].values == pytest.approx(impulses, rel=0.03)
    given = spike_report(volts, None, Mechanics(sensitivity=0.0218)).dataset
    assert given["spike_impulse"].values == pytest.approx(impulses, rel=0.03)
    with pytest.raises(UsageError, match="one for each of the 4 spikes found, got 1"):
        spike_report(volts, None, Mechanics(known_impulses=impulses[:1]))
    with pytest.raises(UsageError, match="channel in volts"):
        spike_report(channel(forces, 1 / RATE), None, Mechanics(sensitivity=0.0218))
    assert calibrate(np.array([0.0436]), np.array([2.0])).sensitivity == pytest.approx(0.0218)


def test_hysteresis_keeps_noise_on_a_flank_from_splitting_a_spike() -> None:
    time = np.arange(4000) * 1e-3
    slow = pulses(time, np.array([1.0]), np.array([1.0]), 1.0)
    noisy = slow + 0.03 * np.random.default_rng(17).standard_normal(len(time))
    asked = SpikeSettings(threshold=0.5, merge=0.0, baseline_window=4.0, minimum_samples=1)
    counts = [
        len(identify(channel(noisy, 1e-3), replace(asked, hysteresis=part)).groups) for part in (1.0, 0.5)
    ]
    assert counts[0] > 1
    assert counts[1] == 1


def test_settings_out_of_range_are_refused_all_at_once() -> None:
    with pytest.raises(UsageError) as refused:
        SpikeSettings(method="cycle", hysteresis=2.0, minimum_samples=0, threshold=-1.0)
    assert len(str(refused.value).splitlines()) == 4
    assert "method: expected one of auto" in str(refused.value)


def test_uneven_samples_take_a_threshold_and_refuse_a_cycle() -> None:
    rng = np.random.default_rng(18)
    time = np.cumsum(rng.uniform(0.5e-4, 1.5e-4, 20_000))
    signal = pulses(time, np.array([0.5, 1.5]), np.array([1.0, 2.0]), 0.01)
    uneven = replace(channel(signal + 0.01 * rng.standard_normal(len(time)), 1e-4), axis=TimeAxis(time, None))
    found = measure_pulses(identify(uneven))
    assert found.impulse == pytest.approx(0.02 / np.pi * np.array([1.0, 2.0]), rel=0.03)
    with pytest.raises(EstimationError, match="evenly spaced"):
        identify(uneven, SpikeSettings(method="cycle_median"))


def test_time_above_a_threshold_is_that_of_the_half_sine_at_any_threshold() -> None:
    _, signal = half_sines()
    for threshold in (0.05, 0.5, 1.5, 2.2):
        found = measure_pulses(identify(channel(signal, 1 / RATE), SpikeSettings(threshold=threshold)))
        assert found.duration == pytest.approx(time_above(threshold, np.array([PEAK]), LENGTH)[0], rel=5e-3)


def test_a_load_cell_that_rings_after_each_of_many_impacts_keeps_its_threshold_near_its_noise() -> None:
    # the ring ranges from the noise to a twentieth of the peak: no gap separates it from the tail of the noise
    time = np.arange(160_000) / 20_000.0
    starts, impulses = 0.02430 + 0.10667 * np.arange(75), np.tile([0.05, 0.0375, 0.0116], 25)
    cell = LoadCell(1.0, natural_frequency=8e3, damping_ratio=0.05, contact_duration=1.5e-3)
    force = cell.follow(time, np.zeros(len(time)), starts, impulses)
    noise = np.random.default_rng(5).normal(0.0, 0.02, len(time))
    report = spike_report(channel(force + noise, 5e-5))
    assert report.dataset.sizes["spike"] == 75
    assert report.found.threshold < 20.0 * 0.02
    assert report.dataset.spike_impulse.values == pytest.approx(impulses, rel=0.01)
