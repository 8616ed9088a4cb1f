import io
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console
from support.impact_records import CHAOTIC, THESIS, WORKED, channel_of, record_of
from support.structure import Modes, Stop, Structure

from vibroimpact.analysis.dataset.results import write_results
from vibroimpact.analysis.estimation import Known, estimate_impacts, print_impacts
from vibroimpact.analysis.estimation.flight_times import natural_frequency_of, stop_position_of
from vibroimpact.analysis.estimation.modal import (
    estimate_modes,
    modal_coordinates,
    restitution_from_energy,
)
from vibroimpact.analysis.estimation.physics import Forcing
from vibroimpact.fmus.core import Oscillator, flow, motion, next_contact
from vibroimpact.fmus.errors import EstimationError, UsageError


def test_motion_at_many_instants_is_the_flow_one_at_a_time():
    body = Oscillator(2.0, 0.3, 5.0, 1.2, 1.7)
    instants = np.array([0.0, 0.3, 1.1, 7.9])
    x, v = motion(body, (0.1, -0.4), instants, phase=0.6)
    for k, instant in enumerate(instants):
        assert (x[k], v[k]) == pytest.approx(flow(body, (0.1, -0.4), instant, phase=0.6), abs=1e-14)


def test_motion_goes_through_its_impacts_as_a_structure_does():
    wn, zeta, w, force = 3.0, 0.05, 4.1, 2.0
    instants = np.linspace(0.0, 20.0, 101)
    x, _ = motion(
        Oscillator(1.0, 2 * zeta * wn, wn**2, force, w), (0.0, 0.0), instants, position=0.1, restitution=0.6
    )
    with Structure(Modes([wn], zeta, force, w), [Stop([1.0], 0.1, restitution=0.6)], [0.0], [0.0]) as body:
        for k in range(1, len(instants)):
            body.advance(float(instants[k] - body.time))
            assert x[k] == pytest.approx(body.displacement[0], abs=1e-10)
        assert len(body.impacts) > 5


def test_motion_refuses_instants_that_go_back():
    with pytest.raises(UsageError, match="ascending instants"):
        motion(Oscillator(), (0.0, 1.0), [1.0, 0.5])
    with pytest.raises(UsageError, match="restitution"):
        motion(Oscillator(), (0.0, 1.0), [1.0], position=2.0, restitution=1.5)


def test_contact_found_alone_is_where_the_motion_turns():
    contact = next_contact(Oscillator(), (0.0, 1.0), 0.5, 10.0)
    _, v = motion(Oscillator(), (0.0, 1.0), [contact.time + 1e-9], position=0.5, restitution=0.5)
    assert v[0] == pytest.approx(-0.5 * contact.velocity, abs=1e-8)


def test_start_values_of_period_one_motion_are_those_of_the_worked_examples():
    # a / x_max = .25 shifts the frequency by 1.72285878782861; with drive and damping, 20 rad/s are read as 18.728
    assert natural_frequency_of(0.25, 1.0, 2.0 * math.pi / 1.72285878782861) == pytest.approx(1.0, abs=1e-13)
    assert stop_position_of(1.0, 1.0, 2.0 * math.pi / 1.72285878782861) == pytest.approx(0.25, abs=1e-13)
    record = record_of(WORKED, periods=6, per_period=400)
    found = estimate_impacts(record.channel(), record.forcing(), methods=["period_one"])
    assert found.values["period_one"]["natural_frequency"].value == pytest.approx(18.728, abs=1e-3)
    assert any("start value" in remark for remark in found.remarks)


def test_aperiodic_motion_gives_no_period_one_values_but_all_others():
    record = record_of(CHAOTIC, periods=40)
    found = estimate_impacts(record.channel(3e-3), record.forcing(), methods=["trajectory", "period_one"])
    assert [refusal.method for refusal in found.refusals] == ["period_one"]
    fit = found.values["trajectory"]
    assert fit["restitution"].value == pytest.approx(0.8, abs=0.01)
    assert fit["damping_ratio"].value == pytest.approx(0.02, abs=0.003)
    assert fit["stop_position"].value == pytest.approx(0.0, abs=0.003)
    assert found.facts["trajectory_pieces"] > 1


def test_a_lower_stop_gives_the_mirrored_answer():
    record = record_of(replace(WORKED, offset=0.2, stop_position=0.6), periods=6)
    methods = ["weak_form", "trajectory"]
    upper = estimate_impacts(record.channel(), record.forcing(), Known(offset=None), methods=methods)
    turned = record.forcing(phase=record.truth.phase + math.pi)
    mirrored = channel_of(record.time, -record.values)
    lower = estimate_impacts(mirrored, turned, Known(offset=None), methods=methods)
    assert lower.facts["side"] == "lower"
    for name, sign in (("restitution", 1), ("damping_ratio", 1), ("stop_position", -1), ("offset", -1)):
        one, other = (found.values["trajectory"][name].value for found in (upper, lower))
        assert other == pytest.approx(sign * one, rel=1e-6)


def test_unknown_phase_is_given_at_time_zero_of_the_recording():
    record = record_of(WORKED, periods=10)
    found = estimate_impacts(
        record.channel(1e-3), record.forcing(phase=None, static_deflection=None), methods=["trajectory"]
    ).values["trajectory"]
    assert found["phase"].value == pytest.approx(record.truth.phase, abs=0.02)
    assert found["static_deflection"].value == pytest.approx(1.5, abs=0.03)


def test_weak_damping_is_not_separated_from_restitution_by_the_energies():
    record = record_of(replace(WORKED, damping_ratio=0.002, restitution=0.6), periods=6, settled=300)
    found = estimate_impacts(record.channel(0.01), record.forcing(), methods=["energy_joint"])
    assert not found.values
    assert "separate damping from restitution" in found.refusals[0].reason
    assert "Give the damping ratio" in found.refusals[0].reason
    # the damping ratio errs by five times its value for each percent of the velocity
    assert abs(found.conditioning["joint_damping_ratio_per_relative_velocity"]) > 0.5


def test_the_energy_loss_factor_counts_the_damping_as_loss_at_the_impact():
    record = record_of(THESIS, periods=8)
    found = estimate_impacts(
        record.channel(1e-3),
        record.forcing(),
        Known(damping_ratio=0.1),
        methods=["energy_known_damping"],
    ).values["energy_known_damping"]
    assert found["restitution"].value == pytest.approx(0.89, abs=1e-3)
    assert found["energy_loss_factor"].value < found["restitution"].value - 0.1


def test_damping_that_takes_more_than_the_impacts_could_leaves_the_restitution_and_no_loss_factor():
    strong = replace(THESIS, damping_ratio=0.2, angular_frequency=130.0, restitution=0.65)
    record = record_of(strong, periods=20)
    found = estimate_impacts(
        record.channel(1e-3), record.forcing(), Known(damping_ratio=0.2), methods=["energy_known_damping"]
    )
    assert not found.refusals
    values = found.values["energy_known_damping"]
    assert values["restitution"].covers(strong.restitution)
    assert "energy_loss_factor" not in values


def test_correlated_rests_widen_the_intervals_and_are_said():
    record = record_of(THESIS, periods=8)
    white = np.random.default_rng(4).standard_normal(len(record.time) + 1)
    coloured = (white[1:] + white[:-1]) / math.sqrt(2.0)
    channel = channel_of(record.time, record.values + 0.003 * record.peak * coloured)
    found = estimate_impacts(channel, record.forcing(), methods=["weak_form"])
    assert found.facts["noise_correlation"] == pytest.approx(0.5, abs=0.1)
    assert any("correlated" in remark for remark in found.remarks)


def test_a_restitution_that_changes_is_not_called_adequate():
    # two halves with different restitutions: each half alone is period one
    first, second = record_of(THESIS, periods=6), record_of(replace(THESIS, restitution=0.6), periods=6)
    step = first.time[1]
    values = np.concatenate([first.values, second.values])
    channel = channel_of(
        step * np.arange(len(values)), values + 0.05 * np.random.default_rng(0).standard_normal(1200)
    )
    found = estimate_impacts(channel, first.forcing(), methods=["trajectory"])
    refused = any(refusal.method == "trajectory" for refusal in found.refusals)
    assert refused or found.verdict.startswith("not sure, because ")


def test_table_and_dataset_have_every_method_side_by_side(tmp_path):
    record = record_of(THESIS, periods=8)
    found = estimate_impacts(record.channel(3e-3), record.forcing(), Known(damping_ratio=0.1))
    assert set(found.values) == {
        *("energy_known_damping", "energy_joint", "energy_amplitude"),
        *("weak_form", "trajectory", "period_one"),
    }
    dataset = found.dataset()
    assert dataset.estimate.dims == ("estimator", "quantity")
    row = dataset.sel(estimator="trajectory", quantity="restitution")
    assert float(row.interval_low) < float(row.estimate) < float(row.interval_high)
    assert "conditioning_joint_restitution_per_relative_velocity" in dataset.attrs
    write_results(dataset, tmp_path / "estimates.nc")
    out = io.StringIO()
    print_impacts(Console(file=out, width=200), found)
    text = out.getvalue()
    for words in ("restitution", "weak form", "joint damping ratio per relative velocity", "m/s", "note:"):
        assert words in text
    narrow = io.StringIO()
    print_impacts(Console(file=narrow, width=80), found)
    assert "…" not in narrow.getvalue()
    assert re.search(r"^ *restitution +energy ", narrow.getvalue(), re.MULTILINE)


def test_unknown_method_is_refused_with_the_names():
    record = record_of(THESIS)
    with pytest.raises(EstimationError, match='got "energy"'):
        estimate_impacts(record.channel(), record.forcing(), methods=["energy"])


def chain(noise=0.0, restitution=0.55, seed=0):
    """Return a two-mass chain (m = k = 1, c = .2) against a stop at the outer mass, and its modal truth."""
    square, shapes = np.linalg.eigh(np.array([[2.0, -1.0], [-1.0, 1.0]]))
    natural, force = np.sqrt(square), shapes.T @ np.array([0.7, 0.1])
    step, start = 2.0 * math.pi / 0.9 / 120, 6000
    displacement = np.empty((2, 1200))
    stop = Stop(shapes[1], 0.3, restitution=restitution)
    with Structure(Modes(natural, 0.1 * natural, force, 0.9), [stop], [0, 0], [0, 0]) as body:
        body.advance(start * step)
        for k in range(displacement.shape[1]):
            displacement[:, k] = shapes @ body.displacement
            body.advance(step)
    errors = noise * np.random.default_rng(seed).standard_normal(displacement.shape)
    return step * np.arange(1200), displacement + errors, shapes, natural, force


def test_modes_of_a_chain_and_its_restitution_are_found_from_both_sensors():
    time, displacement, shapes, natural, force = chain(noise=1e-3)
    coordinates = modal_coordinates(displacement, shapes)
    found = estimate_modes(time, coordinates, shapes[1], Forcing(0.9, phase=0.0), fastest=1.7)
    for k in range(2):
        assert found.natural_frequency[k].value == pytest.approx(natural[k], rel=2e-3)
        assert found.damping_ratio[k].value == pytest.approx(0.1 * natural[k], abs=3e-3)
        assert found.force[k].value == pytest.approx(force[k], rel=2e-2)
    assert found.contact_mass == pytest.approx(1.0)
    assert found.restitution.value == pytest.approx(0.55, abs=5e-3)
    # two methods: speeds of the contact point, and residual energy with the contact mass
    assert found.restitution_from_energy.value == pytest.approx(found.restitution.value, abs=5e-3)


def test_a_nearly_elastic_stop_is_estimated_though_noise_alone_would_let_it_gain_energy():
    # restitution .995 with a standard error of .003: draws of the noise gain energy, the record does not
    time, displacement, shapes, _, _ = chain(noise=5e-3, restitution=0.995, seed=1)
    coordinates = modal_coordinates(displacement, shapes)
    found = estimate_modes(time, coordinates, shapes[1], Forcing(0.9, phase=0.0), fastest=1.7)
    assert found.restitution_from_energy.covers(0.995)
    assert found.restitution_from_energy.standard_error < 0.006


def test_energies_that_contradict_each_other_are_reported_not_clipped():
    with pytest.raises(EstimationError, match="0 <= residual energy <= kinetic energy"):
        restitution_from_energy(1.2, 1.0)
    with pytest.raises(EstimationError, match="at least as many sensors as modes"):
        modal_coordinates(np.zeros((1, 5)), np.ones((1, 2)))


@pytest.mark.parametrize(("ratio", "stop", "impacts"), [(2.6, 0.3, 2), (2.6, 0.0, 3)])
def test_motion_of_several_impacts_in_several_periods_gives_the_truth(ratio, stop, impacts):
    # P(2,4) and P(3,3): flights of different lengths, impacts of different strengths
    record = record_of(replace(CHAOTIC, angular_frequency=ratio, stop_position=stop), periods=24, settled=200)
    found = estimate_impacts(record.channel(1e-3), record.forcing(), methods=["weak_form", "trajectory"])
    lengths = np.diff(found.impact_times)
    assert np.ptp(lengths) > 0.1 * np.mean(lengths)
    np.testing.assert_allclose(lengths[impacts:], lengths[:-impacts], atol=0.05)
    for method in ("weak_form", "trajectory"):
        values = found.values[method]
        for name, truth in (("restitution", 0.8), ("damping_ratio", 0.02), ("stop_position", stop)):
            assert values[name].value == pytest.approx(truth, abs=4.0 * values[name].standard_error)
            assert values[name].standard_error < 0.01


def test_a_clock_that_drifts_is_hinted_at_and_found_when_asked_for():
    record = record_of(THESIS, periods=60)
    channel = record.channel(0.005)
    wrong = record.forcing(angular_frequency=64.32 * 1.001)
    found = estimate_impacts(channel, wrong, methods=["weak_form"])
    assert "clock_drifts" in found.verdict
    asked = record.forcing(angular_frequency=64.32 * 1.001, clock_drifts=True)
    values = estimate_impacts(channel, asked, methods=["trajectory"]).values["trajectory"]
    assert values["angular_frequency"].value == pytest.approx(64.32, rel=1e-5)
    assert values["restitution"].value == pytest.approx(0.89, abs=0.004)


@pytest.mark.parametrize(
    ("ratio", "stop", "restitution"),
    [(0.69, -0.2, 0.66), pytest.param(0.72, 0.0, 0.8, marks=pytest.mark.long)],
)
def test_forcing_below_resonance_is_estimated(ratio, stop, restitution):
    # several flights in a period of the force: a window that suits this period is longer than a flight
    parameters = replace(
        WORKED,
        damping_ratio=0.13,
        angular_frequency=ratio * 20.0,
        stop_position=stop * 1.5,
        restitution=restitution,
    )
    record = record_of(parameters, periods=20, per_period=500)
    found = estimate_impacts(
        record.channel(5e-3),
        Forcing(parameters.angular_frequency),
        Known(offset=None),
        methods=["weak_form", "trajectory"],
    )
    assert len(found.impact_times) > 40
    for method in ("weak_form", "trajectory"):
        values = found.values[method]
        for name in ("restitution", "damping_ratio", "natural_frequency", "stop_position"):
            truth = getattr(parameters, name)
            assert values[name].value == pytest.approx(truth, abs=4.0 * values[name].standard_error)
            assert values[name].standard_error < 0.05 * (abs(truth) + 0.1)
