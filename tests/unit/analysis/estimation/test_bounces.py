import math

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.impact_records import channel_of

from vibroimpact.analysis.decay.free_decay import estimate_decay
from vibroimpact.analysis.decay.samples import decay_samples
from vibroimpact.analysis.estimation import estimate_bounces
from vibroimpact.fmus.errors import EstimationError

SCENE = """
[scene]
title = "A ball under its weight"

[body]
mass = 1.0
stiffness = 0.0
displacement_start = 1.0

[forcing]
amplitude = 9.81
phase = 3.141592653589793
angular_frequency = 0.0

[[stop]]
law = "restitution"
position = 0.0
side = "lower"
restitution = 0.8

[record]
transient_time = 0.0
recorded_time = 3.5
time_series = { rate = 500 }
"""


def ball(restitution, noise=0.0, bounces=12, first=0.7, seed=0, rate=500.0):
    """Return the height of a ball; each flight is `restitution` times as long as the flight before."""
    lengths = first * np.cumprod(np.append(1.0, np.broadcast_to(restitution, bounces - 1)))
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    time = np.arange(0.0, starts[-1], 1.0 / rate)
    k = np.searchsorted(starts, time, side="right") - 1
    height = 0.5 * 9.81 * (time - starts[k]) * (starts[k + 1] - time)
    return channel_of(time, height + noise * np.random.default_rng(seed).standard_normal(len(time)))


def test_flight_times_of_a_ball_give_its_restitution():
    found = estimate_bounces(ball(0.8))
    assert found.values["flight_times"]["restitution"].value == pytest.approx(0.8, abs=1e-4)
    assert found.values["flight_times"]["stop_position"].value == pytest.approx(0.0, abs=1e-4)
    assert found.verdict == "sure of flight times."
    assert found.facts["side"] == "lower"


def test_intervals_of_bounces_hold_the_truth_in_most_of_60_records():
    held = [
        estimate_bounces(ball(0.75, 3e-3, seed=seed)).values["flight_times"]["restitution"].covers(0.75)
        for seed in range(60)
    ]
    # 51 or fewer of 60 have a probability of 1 in 200
    assert sum(held) > 51


def test_a_restitution_that_falls_with_the_speed_is_reported_against_the_speed():
    truth, held = np.linspace(0.7, 0.85, 11), []
    for seed in range(10):
        found = estimate_bounces(ball(truth, 1e-4, seed=seed, rate=1000.0))
        assert "restitution" not in found.values["flight_times"]
        assert "The restitution changes with the speed of impact" in found.remarks[0]
        known = found.of_speed
        # the record begins at the stop, at the start of a full flight; its end is the first impact
        true = truth[: len(known.speed)]
        held += ((known.low <= true) & (true <= known.high)).tolist()
        assert np.all(np.abs(known.fitted - true) < 5e-3)
    # neighbouring speeds of one record are correlated
    assert np.mean(held) > 0.8
    dataset = found.dataset()
    # a flight of T ends with the speed 9.81 T / 2; the first lasts .7 s
    assert float(dataset.bounce_speed[0]) == pytest.approx(0.5 * 9.81 * 0.7, rel=0.01)
    assert dataset.bounce_speed.attrs["units"] == "m s-1"


def test_flights_that_scatter_about_any_restitution_of_the_speed_are_not_sure():
    found = estimate_bounces(ball([0.8, 0.7, 0.85, 0.72, 0.84, 0.7, 0.85, 0.75, 0.8, 0.7, 0.85], 1e-4))
    assert found.verdict.startswith("not sure, because ")
    assert "nor by one that depends on the speed alone" in found.verdict


def test_bounces_end_where_a_flight_is_longer_than_the_one_before():
    first, second = ball(0.8, bounces=6), ball(0.8, bounces=8)
    values = np.concatenate([first.values, second.values])
    found = estimate_bounces(channel_of(np.arange(len(values)) / 500.0, values))
    assert len(found.impact_times) <= 8
    assert found.values["flight_times"]["restitution"].value == pytest.approx(0.8, abs=1e-3)


def test_two_bounces_are_refused_with_what_to_do():
    with pytest.raises(EstimationError, match="at least 3 flights"):
        estimate_bounces(ball(0.8, bounces=3))


def test_a_ball_that_comes_to_rest_is_read_as_a_decay_without_a_warning():
    # windows without motion have no weight: a single window has no slope
    flying = ball(0.6, bounces=8)
    values = np.append(flying.values, np.zeros(3000))
    decay = estimate_decay(decay_samples(channel_of(np.arange(len(values)) / 500.0, values), None, None), ())
    assert decay.estimates()


def test_estimate_of_a_ball_under_its_weight_takes_the_flight_times(tmp_path):
    scene, data, figure = (tmp_path / name for name in ("ball.toml", "ball.nc", "ball.png"))
    scene.write_text(SCENE)
    assert in_this_process("run", scene, "-o", data).returncode == 0
    done = in_this_process("estimate", "impacts", data, "--figure", figure, "-o", tmp_path / "found.nc")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("sure of flight times.")
    assert figure.stat().st_size > 10_000
    with xr.open_dataset(tmp_path / "found.nc") as found:
        value = float(found.estimate.sel(estimator="flight_times", quantity="restitution"))
    assert math.isclose(value, 0.8, abs_tol=1e-3)


def filmed(rate, noise, seed, held=0.0):
    """Return restitution and height of a ball that is held, dropped, bounces 6 to 11 times, and rests if held > 0.

    Flights are 2 V / g long, so a drop from h is half a flight of 2 sqrt(2 h / g).
    """
    random = np.random.default_rng(seed)
    restitution, drop = random.uniform(0.6, 0.9), random.uniform(0.5, 1.5)
    half = math.sqrt(2.0 * drop / 9.81)
    lengths = 2.0 * half * restitution ** np.arange(1, 150)
    starts = np.concatenate([[held - half, held + half], held + half + np.cumsum(lengths)])
    bounces = random.integers(6, 12)
    last = starts[bounces] + random.uniform(-0.5, 0.5) * lengths[bounces - 1]
    time = np.arange(random.uniform(0.0, 1.0 / rate), starts[-1] + 1.0 if held else last, 1.0 / rate)
    k = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 2)
    height = 0.5 * 9.81 * (time - starts[k]) * (starts[k + 1] - time)
    height[time > starts[-1]], height[time < held] = 0.0, drop
    return restitution, channel_of(time, height + noise * random.standard_normal(len(time)))


def answers(rate, noise, seeds, held=0.0):
    """Return masks of the records with an answer, and of the intervals of restitution and stop that hold the truth."""
    answered, held_by = [], []
    for seed in seeds:
        restitution, height = filmed(rate, noise, seed, held)
        try:
            found = estimate_bounces(height).values["flight_times"]
        except EstimationError:
            answered.append(False)
            continue
        answered.append(True)
        truths = {"restitution": restitution, "stop_position": 0.0}
        held_by += [name in found and found[name].covers(truth) for name, truth in truths.items()]
    return answered, held_by


@pytest.mark.parametrize(
    ("rate", "noise", "fewest"), [(120.0, 2e-3, 10), (1000.0, 5e-3, 10), (30.0, 2e-3, 9)]
)
def test_a_filmed_ball_has_an_answer_where_its_parabolas_are_plain(rate, noise, fewest):
    answered, held = answers(rate, noise, range(10))
    assert sum(answered) >= fewest
    # 15 or fewer of 20 have a probability of 1 in 300
    assert np.sum(held) > 0.75 * len(held)


@pytest.mark.long
@pytest.mark.parametrize("held", [0.0, 0.5])
@pytest.mark.parametrize(
    ("rate", "noise", "fewest"),
    [(120.0, 2e-3, 1.0), (1000.0, 5e-3, 1.0), (30.0, 2e-3, 0.9), (240.0, 1e-3, 1.0), (1000.0, 1e-4, 1.0)],
)
def test_intervals_of_filmed_balls_hold_the_truth_in_95_of_100(rate, noise, fewest, held):
    answered, held_by = answers(rate, noise, range(1000, 1200), held)
    assert np.mean(answered) >= fewest
    # fewer than 368 of 400 have a probability of 1 in 200 at 95 %
    assert np.mean(held_by) > 0.92


def test_noise_alone_has_no_flights():
    for seed in range(5):
        random = np.random.default_rng(seed)
        with pytest.raises(EstimationError, match="expected at least"):
            estimate_bounces(channel_of(np.arange(400) / 120.0, random.standard_normal(400)))


def test_flights_that_drag_bends_are_not_taken_for_parabolas():
    # a flight whose second half is slower than the first is no parabola, yet its ends stay where they were
    height = ball(0.8, 1e-4)
    bent = height.values * (1.0 + 0.2 * np.sin(9.0 * height.time))
    found = estimate_bounces(channel_of(height.time, bent))
    assert found.facts["flights from"] == "kinks"
    assert found.values["flight_times"]["restitution"].value == pytest.approx(0.8, abs=5e-3)


def test_samples_that_are_missing_leave_the_parabolas_as_they_are():
    restitution, height = filmed(120.0, 2e-3, 3)
    kept = np.delete(np.arange(len(height.time)), np.s_[40:60])
    found = estimate_bounces(channel_of(height.time[kept], height.values[kept]))
    assert found.values["flight_times"]["restitution"].covers(restitution)


def test_estimate_bounces_reads_a_film_of_30_frames_a_second(tmp_path):
    restitution, height = filmed(30.0, 2e-3, 0)
    table, data, figure, output = (tmp_path / name for name in ("a.csv", "a.nc", "a.png", "found.nc"))
    rows = np.column_stack([height.time, height.values])
    np.savetxt(table, rows, delimiter=",", header="time (s),height (m)", comments="", fmt="%.6f")
    assert in_this_process("import", table, "-o", data).returncode == 0
    done = in_this_process("estimate", "bounces", data, "--figure", figure, "-o", output)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("sure of flight times.")
    assert figure.stat().st_size > 10_000
    with xr.open_dataset(output) as found:
        chosen = found.sel(estimator="flight_times", quantity="restitution")
        assert float(chosen.interval_low) <= restitution <= float(chosen.interval_high)
        assert found.attrs["estimates"] == "bounces"
    assert "vibroimpact estimate bounces of a.nc" in in_this_process("describe", output).stdout


@pytest.mark.parametrize("options", [{"side": "left"}, {"confidence": 1.0}, {"confidence": math.nan}])
def test_options_that_are_none_are_refused(options):
    with pytest.raises(EstimationError, match=f"{next(iter(options))}: expected"):
        estimate_bounces(ball(0.8), **options)


def test_estimate_bounces_refuses_a_side_that_is_none(tmp_path):
    done = in_this_process("estimate", "bounces", tmp_path / "a.nc", "--side", "left")
    assert done.returncode == 2
    assert '--side: expected upper or lower, got "left".' in done.stderr
