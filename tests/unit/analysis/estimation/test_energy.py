import math
from dataclasses import replace

import numpy as np
import pytest
from support.impact_records import THESIS, WORKED, record_of

from vibroimpact.analysis.estimation import Known, estimate_impacts
from vibroimpact.analysis.estimation.energy import EnergyBalance, sensitivities, unknowns_by_speed
from vibroimpact.analysis.estimation.physics import Parameters
from vibroimpact.analysis.estimation.segments import segment
from vibroimpact.analysis.estimation.smoothing import choose_window, smoother
from vibroimpact.fmus.errors import EstimationError

#: Regression splines of .15 periods: exact to more digits than are needed for noiseless samples.
FINE = 0.15


def balance_of(parameters, per_period=400, periods=6):
    record = record_of(parameters, periods=periods, per_period=per_period)
    channel = record.channel()
    w = parameters.angular_frequency
    found = segment(
        channel.time, channel.values, channel.good, fastest=w, stop_position=parameters.stop_position
    )
    flights = [flight for flight in found.flights if flight.usable]
    balance = EnergyBalance(found.signal, flights, w, FINE * 2.0 * math.pi / w)
    halves = balance.energies(channel.values[None], record.truth, parameters.stop_position)
    return record.truth, balance, halves


def forcing_energy(truth, halves):
    """Return the work of the force over one flight, per unit mass."""
    work = math.cos(truth.phase) * halves.work_cos[0] + math.sin(truth.phase) * halves.work_sin[0]
    # work of opposite sign adds to the speed after an impact
    return truth.natural_frequency**2 * truth.static_deflection * (work[1] - work[0])


def test_the_window_is_that_of_the_motion_and_the_size_of_the_noise():
    record = record_of(WORKED, periods=6, per_period=400)
    channel, w = record.channel(), WORKED.angular_frequency
    found = segment(channel.time, channel.values, channel.good, fastest=w, stop_position=WORKED.stop_position)
    flights = [flight for flight in found.flights if flight.usable]
    fine, size = FINE * 2.0 * math.pi / w, float(np.ptp(channel.values))
    sizes = np.geomspace(1e-5, 1e-2, 7) * size
    windows = [choose_window(found.signal, flights, fine, w, noise) for noise in sizes]
    assert windows == sorted(windows)
    assert windows[-1] > 1.5 * windows[0]
    # the error of the slopes at the stop from smoothing is at most twice their error from noise
    for window, noise in zip(windows, sizes, strict=True):
        wrong, left = 0.0, 0.0
        for flight in flights:
            ends = np.array([flight.start, flight.end])
            rows, exact = (smoother(found.signal, flight, one).row(ends, 1) for one in (window, fine))
            wrong += np.sum(((rows - exact) @ found.signal.values[flight.index]) ** 2)
            left += noise**2 * np.sum(rows**2)
        assert wrong < 4.0 * left


def test_undamped_forcing_energy_is_that_of_the_closed_form():
    # F = .4, w = 1.6, a = .3, r = .7: FE = (1 - r^2) V^2 / 2 = .548604557597901 by quadrature of the closed-form orbit
    truth, _, halves = balance_of(Parameters(0.7, 0.0, 1.0, 1.6, 0.4, 0.0, 0.3))
    assert forcing_energy(truth, halves) == pytest.approx(0.548604557597901, rel=1e-5)


def test_thesis_example_of_the_undamped_balance():
    # thesis 4.2.2: a = 0, r = .8, F = .5, w = 2: V = 10/3, FE = 2, deepest point -3.0182425
    truth, _balance, halves = balance_of(Parameters(0.8, 0.0, 1.0, 2.0, 0.5, 0.0, 0.0))
    assert forcing_energy(truth, halves) == pytest.approx(2.0, rel=1e-5)
    assert math.sqrt(halves.energy(truth)[0, 1]) == pytest.approx(10.0 / 3.0, rel=1e-5)
    assert math.sqrt(halves.elastic[0, 1]) == pytest.approx(3.0182425, rel=1e-5)


def test_half_orbit_gives_speed_and_restitution_without_any_end_point_velocity():
    # worked example: wn = 20, y_st = 1.5, Omega = 35, y_s = .4, zeta = .06, r = .8: V = 88.24906850683556
    truth, balance, halves = balance_of(WORKED)
    energy = halves.energy(truth)
    np.testing.assert_allclose(np.sqrt(energy[0, 1::2]), 88.24906850683556, rtol=1e-6)
    np.testing.assert_allclose(np.sqrt(energy[0, 0::2]), 0.8 * 88.24906850683556, rtol=1e-6)
    assert balance.restitution(energy)[0] == pytest.approx(0.8, abs=1e-6)


def test_sensitivities_are_those_of_the_worked_example():
    # by finite differences of the exact orbit: joint dr = -1.73201 dV/V, d zeta = -.72536 dV/V
    truth, _, halves = balance_of(WORKED)
    drag = np.abs(halves.drag[0])
    found = sensitivities(0.8, 88.24906850683556, drag[2] + drag[3], drag[3], truth.natural_frequency)
    assert found["joint_restitution_per_relative_velocity"] == pytest.approx(-1.73201, abs=2e-5)
    assert found["joint_damping_ratio_per_relative_velocity"] == pytest.approx(-0.72536, abs=1e-5)


def test_sensitivity_to_a_wrong_damping_is_what_a_wrong_damping_does():
    truth, balance, halves = balance_of(WORKED)
    drag = np.abs(halves.drag[0])
    stated = sensitivities(0.8, 88.24906850683556, drag[2] + drag[3], drag[3], truth.natural_frequency)
    step = 1e-5
    values = [
        balance.restitution(halves.energy(replace(truth, damping_ratio=0.06 + sign * step)))[0]
        for sign in (1, -1)
    ]
    key = "restitution_per_damping_ratio_velocity_from_half_orbit"
    assert (values[0] - values[1]) / (2.0 * step) == pytest.approx(stated[key], rel=1e-3)


@pytest.mark.parametrize("parameters", [THESIS, WORKED])
def test_speeds_at_the_impacts_give_damping_and_amplitude_of_a_noiseless_record(parameters):
    truth, _balance, halves = balance_of(parameters)
    damping, _ = unknowns_by_speed(halves, truth, ["damping_ratio"])
    assert damping[0, 0] == pytest.approx(parameters.damping_ratio, rel=2e-3)
    both, condition = unknowns_by_speed(halves, truth, ["damping_ratio", "static_deflection"])
    assert both[0] == pytest.approx([parameters.damping_ratio, parameters.static_deflection], rel=5e-3)
    assert 1.0 < condition < 1e3


def test_period_one_motion_cannot_give_damping_amplitude_and_phase_together():
    truth, _, halves = balance_of(THESIS)
    with pytest.raises(EstimationError, match="separate damping_ratio, static_deflection, phase"):
        unknowns_by_speed(halves, truth, ["damping_ratio", "static_deflection", "phase"])


def test_more_energy_after_the_impacts_than_there_is_motion_is_refused():
    truth, balance, halves = balance_of(WORKED)
    # ten times the true damping takes more energy than the force gives
    with pytest.raises(EstimationError, match="residual energy between 0 and the kinetic energy"):
        balance.restitution(halves.energy(replace(truth, damping_ratio=-2.0)))


def test_noise_in_the_squares_is_subtracted():
    # 1 % noise and a window of a quarter of a period: the mean over draws of the noise is the noiseless value
    record = record_of(THESIS, periods=10)
    channel = record.channel(0.01)
    found = segment(channel.time, channel.values, channel.good, fastest=64.32, stop_position=0.0)
    flights = [flight for flight in found.flights if flight.usable]
    balance = EnergyBalance(found.signal, flights, 64.32, 0.25 * 2.0 * math.pi / 64.32)
    errors = 0.01 * record.peak * np.random.default_rng(5).standard_normal((400, len(record.time)))

    def squares(samples):
        """Return the sum of int y'^2 over all halves, with the contribution of the noise."""
        return sum(
            np.sum((samples[:, flight.index] @ half.speeds.T) ** 2, axis=1)
            for flight, pair in zip(flights, zip(*2 * [iter(balance.halves)], strict=True), strict=True)
            for half in pair
        )

    raw, noiseless = squares(record.values + errors), squares(record.values[None])[0]
    added = balance.noise**2 * sum(np.sum(half.speeds**2) for half in balance.halves)
    chance = np.std(raw) / math.sqrt(400)
    assert np.mean(raw) - noiseless > 4.0 * chance
    assert abs(np.mean(raw) - added - noiseless) < 3.0 * chance


def test_the_force_is_not_read_too_low_where_noise_makes_the_speeds_uncertain():
    # weighted by the measured speeds, both err by 2.4 and 3.1 standard errors on average
    parameters = Parameters(0.792, 0.1257, 61.1, 58.75, 0.108, 0.0, 0.0114)
    record = record_of(parameters, periods=40)
    known = Known(damping_ratio=0.1257, stop_position=0.0114)
    off = {"static_deflection": [], "phase": []}
    for seed in range(4):
        found = estimate_impacts(
            record.channel(0.013, seed),
            record.forcing(static_deflection=None, phase=None),
            known,
            methods=["energy_amplitude"],
        ).values["energy_amplitude"]
        for name, errors in off.items():
            error = math.remainder(found[name].value - getattr(record.truth, name), 2.0 * math.pi)
            errors.append(error / found[name].standard_error)
    for name, errors in off.items():
        assert abs(np.mean(errors)) < 1.0, name  # two standard errors of a mean of four
