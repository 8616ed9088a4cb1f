"""Scenes with negative springs and dashpots: runs, the outcome unbounded, refusals by name."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.run.limits import may_go_by_lanes

STOP = {"at": "mass", "position": 1.0, "restitution": 0.8}


def scene(body: dict[str, Any] | None = None, **tables: Any) -> vi.Scene:
    body = {"name": "mass", "mass": 1.0, "stiffness": -1.0, "velocity_start": 0.5, **(body or {})}
    given = {
        "scene": {"units": "nondimensional"},
        "record": {"recorded_time": 100.0},
        "body": [body],
        **tables,
    }
    return vi.Scene.from_dict(given, "growing")


def outcome(run: Any) -> tuple[Outcome, str]:
    return Outcome(int(run.outcome)), str(run.message.values)


def test_a_pendulum_rests_on_the_stop_that_it_falls_on() -> None:
    kind, _ = outcome(vi.run(scene(stop=[STOP])))
    assert kind is Outcome.stuck


def test_a_motion_away_from_its_only_stop_is_unbounded_with_its_time() -> None:
    run = vi.run(scene({"velocity_start": -0.5}, stop=[STOP]))
    kind, message = outcome(run)
    assert kind is Outcome.unbounded
    assert message == "unbounded: no stop can be met any more from time 0 s on"


def test_a_motion_without_stops_ends_at_its_limit_with_its_samples() -> None:
    series = {"rate": 10.0, "variables": ["displacement"]}
    record = {"recorded_time": 100.0, "time_series": series}
    run = vi.run(scene({"displacement_start": 0.1, "velocity_start": 0.0}, record=record))
    kind, message = outcome(run)
    assert kind is Outcome.unbounded
    assert message.startswith(
        "unbounded: a displacement passed displacement_limit, 1e+08 m, at time 21.416413017"
    )
    samples = run.displacement.values
    assert len(samples) == 215
    assert samples[-1] == pytest.approx(0.1 * math.cosh(21.4), rel=1e-12)


def test_a_sweep_through_zero_keeps_all_points() -> None:
    given = scene({"damping": 0.1}, stop=[STOP], sweep={"body[1].stiffness": {"values": [-1.0, 0.0, 1.0]}})
    run = vi.run(given.with_values({"body[1].velocity_start": -0.5}))
    assert run.outcome.values.tolist() == [Outcome.unbounded, Outcome.ok, Outcome.ok]


def test_a_single_body_runs_as_a_list_of_one() -> None:
    body = {"mass": 1.0, "stiffness": -1.0, "velocity_start": 0.5}
    stop = {key: value for key, value in STOP.items() if key != "at"}
    tables = {"scene": {"units": "nondimensional"}, "record": {"recorded_time": 5.0}}
    single = vi.Scene.from_dict({**tables, "body": body, "stop": [stop]}, "single")
    listed = scene(stop=[STOP], record={"recorded_time": 5.0})
    one, other = (vi.run(each).vibroimpact.impacts().impact_time.values for each in (single, listed))
    assert np.array_equal(one, other)
    assert len(one) == 2


def test_lanes_and_orbits_leave_growing_motions() -> None:
    forced = {"forcing": {"at": "mass", "amplitude": 3.0, "angular_frequency": 1.3}}
    given = scene(
        stop=[STOP],
        record={"transient_periods": 5, "recorded_periods": 5},
        sweep={"forcing.amplitude": {"start": 1.0, "stop": 4.0, "points": 40}},
        **forced,
    )
    assert not may_go_by_lanes(given)
    assert may_go_by_lanes(given.with_values({"body[1].stiffness": 1.0}))
    with pytest.raises(UsageError, match="springs and dashpots that are not negative"):
        vi.find_orbits(given.with_sweep({}))


def test_a_campaign_of_many_points_has_the_outcomes_of_single_runs() -> None:
    starts = np.linspace(-0.9, 0.9, 40)
    swept = scene(stop=[STOP], sweep={"body[1].displacement_start": {"values": starts.tolist()}})
    many = vi.run(swept)
    for place in (0, 10, 25, 39):
        one = vi.run(scene({"displacement_start": float(starts[place])}, stop=[STOP]))
        assert int(many.outcome.values[place]) == int(one.outcome)
        assert str(many.message.values[place]) == str(one.message.values)
    assert {Outcome.unbounded, Outcome.stuck} <= set(map(Outcome, many.outcome.values.tolist()))


def test_a_damping_ratio_needs_a_spring_that_pulls() -> None:
    with pytest.raises(SceneError, match="stiffness > 0 beside a damping_ratio"):
        scene({"damping_ratio": 0.1}, stop=[STOP])
