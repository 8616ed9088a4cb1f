"""Classes of runs: synthetic motions with a known period, and simulated motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.command_line import in_this_process

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import OrbitClass, Outcome
from vibroimpact.analysis.orbits.classify import class_of, classify

PERIODS = 40


@given(
    multiplier=st.floats(-0.99, 0.99),
    size=st.floats(1e-3, 0.3),
    centre=st.floats(0.5, 2.0),
    periods=st.integers(10, 60),
)
def test_a_slow_transient_of_any_real_multiplier_is_no_longer_period(
    multiplier: float, size: float, centre: float, periods: int
) -> None:
    at = np.arange(periods)
    states = (centre + size * multiplier**at)[:, None]
    assert class_of(states, np.ones(periods)).name == "P(1,1)"


@pytest.mark.parametrize("multiplier", [-0.9999, -0.99999, -0.999])
@pytest.mark.parametrize("size", [1e-3, 1e-4, 1e-2])
def test_a_transient_that_is_too_slow_to_tell_is_not_called_a_doubled_period(
    multiplier: float, size: float
) -> None:
    at = np.arange(PERIODS)
    found = class_of((1.0 + size * multiplier**at)[:, None], np.ones(PERIODS))
    assert found.name in ("unknown", "P(1,1)")


@given(
    radius=st.floats(0.3, 0.75),
    angle=st.floats(0.1, 3.0),
    size=st.floats(1e-3, 0.3),
    periods=st.integers(30, 60),
)
def test_a_turning_transient_is_one_that_dies_away(
    radius: float, angle: float, size: float, periods: int
) -> None:
    at = np.arange(periods)
    states = 1.0 + size * np.stack([radius**at * np.cos(angle * at), radius**at * np.sin(angle * at)], axis=1)
    assert class_of(states, np.ones(periods)).name == "P(1,1)"


@given(
    values=st.lists(st.floats(0.1, 2.0), min_size=1, max_size=6, unique=True),
    jitter=st.floats(0.0, 1e-9),
    seed=st.integers(0, 2**32 - 1),
)
def test_what_repeats_after_q_periods_is_told_with_its_impacts(
    values: list[float], jitter: float, seed: int
) -> None:
    gaps = np.abs(np.subtract.outer(values, values))[~np.eye(len(values), dtype=bool)]
    if gaps.size and gaps.min() < 0.02:
        return
    noise = np.random.default_rng(seed).uniform(-jitter, jitter, (PERIODS, 1))
    states = np.resize(values, PERIODS)[:, None] + noise
    found = class_of(states, np.resize(np.arange(len(values)) + 1.0, PERIODS))
    assert (found.kind, found.periods) == (OrbitClass.periodic, len(values))
    assert found.impacts == sum(range(1, len(values) + 1))


def test_a_doubled_period_with_a_transient_of_its_own_is_not_taken_for_a_slow_transient() -> None:
    at = np.arange(PERIODS)
    for ratio in (0.5, 0.9, 0.97):
        states = (1.0 + (-1.0) ** at * (0.2 + 0.1 * ratio**at))[:, None]
        assert class_of(states, np.ones(PERIODS)).name == "P(2,2)"


def test_chaos_is_told_where_there_are_periods_enough() -> None:
    x = np.empty(200)
    x[0] = 0.3
    for k in range(199):
        x[k + 1] = 3.9 * x[k] * (1.0 - x[k])
    assert class_of(x[:, None], np.ones(200)).kind is OrbitClass.chaos
    few = class_of(x[:20, None], np.ones(20))
    assert (few.kind, few.reason) == (
        OrbitClass.unknown,
        "no period up to 10; 40 recorded periods tell chaos",
    )


def test_a_closed_curve_of_states_is_quasi_periodic_where_there_are_states_enough() -> None:
    turn = 2.0 * np.pi * np.sqrt(5.0) * np.arange(200)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    found = class_of(circle, np.ones(200))
    assert (found.name, found.periods) == ("quasi-periodic", 1)
    assert found.rotation is not None
    assert found.rotation.number == pytest.approx(np.sqrt(5.0) - 2.0, abs=1e-9)
    few = class_of(circle[:60], np.ones(60))
    assert (few.kind, few.reason.rpartition("; ")[2]) == (
        OrbitClass.unknown,
        "100 recorded periods tell quasi-periodic motion",
    )


def test_rest_sticking_no_impacts_and_failures_have_their_names() -> None:
    once = np.ones((10, 1))
    assert class_of(once, np.zeros(10)).name == "no impacts"
    assert class_of(once, np.ones(10), Outcome.stuck).name == "rest"
    assert class_of(once, np.full(10, np.inf)).name == "P(inf,1)"
    assert class_of(once, np.ones(10), has_stuck=True).name == "P(inf,1)"
    assert class_of(once, np.ones(10), Outcome.timeout).reason == "the run ended by timeout"
    assert class_of(np.full((10, 1), np.nan), np.ones(10)).reason == "fewer than 6 recorded periods"
    assert class_of(once, None).reason == "repeats after 1 periods; impacts are not recorded"


_OPEN = "rests are not recorded: p may stand for infinitely many"
SCENE = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"position": 1.0, "restitution": 0.7}],
    "record": {
        "transient_periods": 300,
        "recorded_periods": 60,
        "extrema": True,
        "strobe": True,
        "impacts": True,
    },
    "sweep": {"forcing.angular_frequency": {"values": [0.65, 0.72, 0.8, 0.94, 1.2, 1.58]}},
}


def test_the_classes_of_figure_3_3_are_those_of_its_orbits() -> None:
    names = [each.name for each in classify(vi.run(SCENE))]
    assert names == ["no impacts", "chaos", "P(2,2)", "P(1,1)", "P(1,1)", "no impacts"]


def test_next_to_a_doubling_a_short_run_is_still_told_right() -> None:
    near = {
        **SCENE,
        "sweep": {"forcing.angular_frequency": {"values": [0.94, 0.95, 1.0]}},
        "record": {**SCENE["record"], "transient_periods": 40, "recorded_periods": 30},
    }
    assert [each.name for each in classify(vi.run(near))] == ["P(1,1)"] * 3


@pytest.mark.parametrize(("impacts", "expected"), [(True, ("P(inf,1)", "")), (False, ("P(36,1)", _OPEN))])
def test_without_recorded_rests_a_class_says_that_its_impacts_may_be_infinitely_many(
    impacts: bool, expected: tuple[str, str]
) -> None:
    chatter = {
        **SCENE,
        "forcing": {"amplitude": 1.0, "angular_frequency": 0.2},
        "stop": [{"position": 0.0, "restitution": 0.7}],
        "record": {**SCENE["record"], "transient_periods": 5, "recorded_periods": 10, "impacts": impacts},
        "sweep": {},
    }
    [found] = classify(vi.run(chatter))
    assert (found.name, found.reason) == expected


def test_a_dataset_without_states_is_refused() -> None:
    bare = {
        **SCENE,
        "record": {
            "transient_periods": 10,
            "recorded_periods": 10,
            "impacts": True,
            "extrema": False,
            "strobe": False,
        },
    }
    with pytest.raises(
        vi.VibroimpactError, match="classify: expected strobe or extrema in the dataset, got neither"
    ):
        classify(vi.run(bare))


def test_the_command_counts_writes_and_draws_classes(tmp_path: Path) -> None:
    runs, output, figure = (tmp_path / name for name in ("runs.nc", "classes.nc", "classes.png"))
    vi.run(SCENE, runs)
    done = in_this_process("classify", runs, "-o", output, "--figure", figure)
    assert (done.returncode, done.stderr) == (0, "")
    assert "P(2,2)" in done.stdout
    assert figure.stat().st_size > 5000
    written = vi.open_dataset(output)
    assert written["class_kind"].values.tolist() == [1, 4, 2, 2, 2, 1]
    assert written["class_periods"].values[2:5].tolist() == [2, 1, 1]
    assert in_this_process("plot", output, "-o", tmp_path / "again.png").returncode == 0
    refused = in_this_process("classify", tmp_path / "none.nc")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
