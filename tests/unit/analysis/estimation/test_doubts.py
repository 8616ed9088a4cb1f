"""An unreliable estimate says so in one line; a reliable one does not."""

import io
import math
from dataclasses import replace

import numpy as np
import pytest
from interval_coverage._asked import estimates_of
from interval_coverage._motion import Body, simulate
from interval_coverage._records import record as drawn
from rich.console import Console
from support.impact_records import CHAOTIC, THESIS, channel_of, record_of

from vibroimpact.analysis.estimation import Forcing, Known, estimate_impacts, impacts, print_impacts
from vibroimpact.analysis.estimation.estimates import MethodEstimate
from vibroimpact.analysis.estimation.physics import Coordinates, Parameters
from vibroimpact.analysis.estimation.remarks import _of_contradictions
from vibroimpact.analysis.figures.measured.estimates import draw_estimates
from vibroimpact.fmus.errors import EstimationError

METHODS = ["weak_form", "trajectory"]
#: Forced at 2.78 times the natural frequency against a stop at rest: aperiodic, speeds of all sizes.
PLAIN = Body(
    natural=np.array([62.83]),
    damping=np.array([0.039]),
    shape=np.array([1.0]),
    deflection=1.0,
    frequency=174.7,
    phase=0.4,
    stops=((0.0, 1.0),),
    restitution=lambda speed: 0.7,
)


def record(body, noise=0.01, periods=40, per_period=200):
    """Return a noisy channel of a body that begins below its stop."""
    time = np.arange(periods * per_period) * 2.0 * math.pi / body.frequency / per_period
    start = np.zeros((2, len(body.natural)))
    start[0, 0] = -0.3
    values, _ = simulate(body, start, time)
    errors = noise * np.max(np.abs(values)) * np.random.default_rng(3).standard_normal(len(time))
    return channel_of(time, values + errors)


def estimated(body, known=None, methods=METHODS, **options):
    return estimate_impacts(
        record(body, **options), Forcing(body.frequency), known or Known(offset=None), methods=methods
    )


@pytest.fixture(scope="module")
def plain():
    return estimated(PLAIN)


def test_a_plain_oscillator_is_sure_and_right(plain):
    assert plain.verdict == "sure of weak form, trajectory."
    assert plain.values["trajectory"]["restitution"].covers(0.7)
    assert plain.values["trajectory"]["damping_ratio"].covers(0.039)


@pytest.mark.parametrize(
    ("spoiled", "reason"),
    [
        (replace(PLAIN, stops=((0.0, 1.0), (-0.25, -1.0))), "there is a second stop"),
        (
            replace(
                PLAIN,
                natural=np.array([62.83, 182.0]),
                damping=np.array([0.039, 0.039]),
                shape=np.array([1.0, 0.5]),
            ),
            "a second mode",
        ),
        (replace(PLAIN, friction=0.04), "or friction does"),
        (
            replace(PLAIN, restitution=lambda speed: min(1.0, 0.76 * (speed / 20.0) ** -0.1)),
            "the restitution changes with the speed",
        ),
    ],
)
def test_motion_that_the_model_lacks_is_not_sure_and_says_why(spoiled, reason):
    found = estimated(spoiled)
    assert found.verdict.startswith("not sure, because ")
    assert reason in found.verdict
    assert "\n" not in found.verdict
    assert found.dataset().attrs["verdict"] == found.verdict


def test_a_sensor_that_filters_is_not_sure():
    plain = record(PLAIN)
    white = np.random.default_rng(4).standard_normal(len(plain.values) + 1)
    channel = channel_of(plain.time, plain.values + 2e-3 * (white[1:] + white[:-1]))
    found = estimate_impacts(channel, Forcing(PLAIN.frequency), Known(offset=None), methods=METHODS)
    assert found.verdict.startswith("not sure, because ")
    assert "no white noise" in found.dataset().attrs["doubts"]


def test_an_acceleration_is_refused_as_no_displacement():
    channel = replace(record(PLAIN), unit="9.80665 m s-2")
    with pytest.raises(EstimationError, match=r"expected a displacement, got an acceleration \(g\)"):
        estimate_impacts(channel, Forcing(PLAIN.frequency))


def test_a_known_stop_that_is_not_where_the_impacts_are_is_refused_with_their_place():
    with pytest.raises(
        EstimationError, match=r"expected the place where the impacts are, .*got 0\.1\. Correct it"
    ):
        estimated(PLAIN, Known(stop_position=0.1, offset=None))


def test_few_impacts_are_not_sure():
    found = estimated(PLAIN, periods=5)
    assert found.verdict.startswith("not sure, because only ")


def test_the_failure_of_one_method_leaves_the_others(monkeypatch):
    def failing(*arguments):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(impacts, "fit_trajectory", failing)
    found = estimated(PLAIN, periods=15)
    assert set(found.values) == {"weak_form"}
    assert [refusal.method for refusal in found.refusals] == ["trajectory"]
    assert "SVD did not converge" in found.refusals[0].reason


@pytest.mark.parametrize(
    ("name", "apart", "contradicts"),
    # at 2.5 standard errors, too, the 95 % intervals are disjoint
    [("restitution", 0.025, False), ("restitution", -0.035, True), ("phase", 2 * math.pi + 0.02, False)],
)
def test_methods_contradict_each_other_when_chance_does_not_explain_how_far_they_are_apart(
    name, apart, contradicts
):
    def around(value, error):
        return {name: MethodEstimate(value, error, value - 1.96 * error, value + 1.96 * error)}

    values = {"trajectory": around(0.8, 0.001), "energy_joint": around(0.8 + apart, 0.01)}
    found = list(_of_contradictions(values, 0.95))
    assert [doubt.methods for doubt in found] == [("energy_joint",)] * contradicts


def test_chatter_that_is_not_seen_leaves_the_estimates_sure():
    # some flights contain a weak impact within the noise: they are left out, and the fitted motion passes through them
    found = estimate_impacts(
        record_of(CHAOTIC, periods=40).channel(0.01), Forcing(2.8), Known(offset=None), methods=METHODS
    )
    assert found.facts["flights_left_out"] > 0
    assert found.verdict == "sure of weak form, trajectory."


def test_a_stiffness_that_the_motion_does_not_show_is_not_given():
    # P(1,1) far above resonance, in noise: hardly more than free flight between impacts
    body = replace(PLAIN, frequency=4.0 * 62.83, restitution=lambda speed: 0.85)
    found = estimated(body, noise=0.03, periods=30, per_period=100)
    for method, values in found.values.items():
        if method in METHODS and not found.reasons(method):
            assert values["natural_frequency"].standard_error < 0.1 * values["natural_frequency"].value


def test_a_valley_of_stiffness_force_and_offset_is_not_sure():
    # P(1,1) in noise, only the forcing frequency known: offset and static deflection err by 4 to 16 standard errors
    found = estimates_of(drawn(341, 101), methods=METHODS)
    assert found.verdict.startswith("not sure, because ")
    assert "stiffness, force and offset fit alike" in found.verdict


def test_few_samples_in_a_flight_leave_the_weak_form_right():
    # samples chosen by the kinks next to them have noise of nonzero mean: the offset erred by 5.1 standard errors
    one = drawn(162, 101)
    found = estimates_of(one, methods=["weak_form"]).values["weak_form"]
    for name in ("natural_frequency", "static_deflection", "offset"):
        assert abs(found[name].value - one.truth[name]) < 3.3 * found[name].standard_error


def test_no_restitution_below_0_is_given():
    values = {"restitution": MethodEstimate(-0.42, 0.32, -1.05, 0.2), "damping_ratio": MethodEstimate(-0.1)}
    found = impacts._as_measured(values, 1.0)
    assert found["restitution"] == MethodEstimate(0.0, 0.32, 0.0, 0.2)
    assert found["damping_ratio"].value == -0.1


def test_the_verdict_comes_first_and_doubts_follow_the_table():
    found = estimated(replace(PLAIN, stops=((0.0, 1.0), (-0.25, -1.0))), periods=20)
    out = io.StringIO()
    print_impacts(Console(file=out, width=400), found)
    lines = out.getvalue().splitlines()
    assert lines[0].startswith("not sure, because ")
    assert any(line.startswith("doubt: ") and "second stop" in line for line in lines)


def test_intervals_follow_the_valley_of_a_stiffness_that_is_hardly_known():
    p = Parameters(0.8, 0.1, 20.0, 35.0, 1.5, 0.3, 0.4, 0.1)
    names = ("natural_frequency", "offset")
    # a standard error of 20 % of the stiffness: the interval of its root is not symmetric
    low, high = Coordinates(names, p).intervals(p, np.diag([2.0, 1e-9]) ** 2, 0.95)["natural_frequency"]
    assert low == pytest.approx(math.sqrt(400.0 - 1.96 * 80.0), rel=1e-2)
    assert high == pytest.approx(math.sqrt(400.0 + 1.96 * 80.0), rel=1e-2)
    assert not Coordinates(names, p).intervals(p, np.diag([8.0, 1e-9]) ** 2, 0.95)


def test_coordinates_give_back_their_parameters():
    p = Parameters(0.8, 0.1, 20.0, 35.0, 1.5, 0.3, 0.4, 0.1)
    for names in (("phase",), ("static_deflection",), tuple(Parameters.__dataclass_fields__)):
        coordinates = Coordinates(names, p)
        found = coordinates.parameters(coordinates.of(p))
        assert found is not None
        for name in names:
            assert getattr(found, name) == pytest.approx(getattr(p, name), rel=1e-12)
    assert Coordinates(("natural_frequency",), p).parameters([-1.0]) is None
    assert THESIS.natural_frequency == Coordinates((), THESIS).parameters([]).natural_frequency


def test_the_dataset_has_what_was_measured_and_the_motion_that_fits(plain):
    dataset = plain.dataset()
    rests = (dataset.measured - dataset.fitted).values
    rests = rests[np.isfinite(rests)]
    assert len(rests) > 0.8 * dataset.sizes["time"]
    assert np.std(rests) == pytest.approx(plain.facts["noise"], rel=0.05)


def test_the_figure_shows_signal_impacts_and_what_is_left_above_the_intervals(plain):
    dataset = plain.dataset().assign_attrs(estimates="impacts")
    labels = [axis.get_ylabel() for axis in draw_estimates(dataset).axes]
    assert labels[:2] == ["displacement (m)", "residual (m)"]
    signal = draw_estimates(dataset).axes[0]
    low, high = signal.get_xlim()
    # a long record shows only some flights, or none would be distinguishable
    assert 5 < np.count_nonzero((dataset.impact_time > low) & (dataset.impact_time < high)) <= 11
    old = dataset.drop_vars(["measured", "fitted", "time"])
    assert len(draw_estimates(old).axes) == len(labels) - 2


def test_a_simulated_record_without_noise_is_sure():
    record = record_of(THESIS, periods=8)
    found = estimate_impacts(record.channel(), record.forcing(), methods=METHODS)
    assert found.verdict == "sure of weak form, trajectory."
