"""One call of C takes the samples of a fused run, bit for bit as one step after the other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.run import point as point_module
from vibroimpact.orchestrator.run.fused import BodyDriver
from vibroimpact.orchestrator.run.record import RecordedBody
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sampled_names import sampled_names

BODIES = {
    "oscillator": ({"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.02}, {}, 0.5),
    "chain": (
        {"kind": "chain", "masses": [1.0, 1.0, 2.0], "stiffnesses": [1.0, 2.0, 1.0]},
        {"mass": 2},
        [0.1, 0.5, 0.0],
    ),
    "beam": (
        {
            "kind": "beam",
            "length": 1.0,
            "flexural_rigidity": 0.0809,
            "mass_per_length": 1.0,
            "boundary": "clamped-free",
            "modes": 4,
            "damping_ratio": 0.02,
        },
        {"location": 1.0},
        0.5,
    ),
}
RIGID, LOW = {"position": 0.4, "restitution": 0.7}, {"position": -0.5, "side": "lower", "restitution": 0.3}
HERTZ = {"position": 0.4, "law": "hertz", "stiffness": 400.0}


def scene_of(
    body: str, rate: float, *stops: dict[str, object], periods: int = 15, **execution: object
) -> Scene:
    """Return a scene of a body that samples all its variables."""
    numbers, where, amplitude = BODIES[body]
    tables: dict[str, object] = {
        "scene": {"units": "nondimensional"},
        "body": numbers,
        "forcing": {"amplitude": amplitude, "angular_frequency": 0.9, "phase": 0.3},
        "stop": [{**stop, **where} for stop in stops],
        "execution": execution,
    }
    if body == "beam":
        tables["forcing"] = {**tables["forcing"], **where}  # type: ignore[dict-item]
    record = {"transient_periods": 3, "recorded_periods": periods, "extrema": True}
    plain = Scene.from_dict({**tables, "record": record}, "scene.toml")
    names = list(sampled_names(plain.body, len(stops), plain.forces))
    series = {"rate": rate, "variables": names}
    return Scene.from_dict({**tables, "record": {**record, "time_series": series}}, "scene.toml")


def both(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, way: Callable[[RecordedBody, np.ndarray], np.ndarray]
) -> tuple[RunRecord, RunRecord]:
    """Return the records of a scene by one call, and by `way`."""
    runner = PointRunner(scene, execution="fused")
    found = runner.run({})
    with monkeypatch.context() as patch:
        patch.setattr(BodyDriver, "advance_sampling", way)
        other = runner.run({})
    runner.close()
    return found, other


def assert_same(found: RunRecord, other: RunRecord) -> None:
    assert (found.outcome, found.message) == (other.outcome, other.message)
    for name in ("samples", "impacts", "sticks", "periods", "final_state"):
        one, two = getattr(found, name), getattr(other, name)
        assert (one is None) == (two is None)
        if one is not None:
            assert one.shape == two.shape
            assert one.tobytes() == two.tobytes()


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize(
    "stops", [(RIGID,), (RIGID, LOW), (HERTZ,), ()], ids=["rigid", "two", "hertz", "none"]
)
@pytest.mark.parametrize("rate", [0.05, 3.7, 41.0])
def test_samples_are_those_of_single_steps(
    body: str, stops: tuple[dict[str, object], ...], rate: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, other = both(scene_of(body, rate, *stops), monkeypatch, RecordedBody.advance_sampling)
    assert found.samples is not None
    assert len(found.samples) > 4
    assert_same(found, other)


def test_a_record_that_fills_between_two_samples_is_taken_on_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("oscillator", 0.0005, RIGID, periods=1500)
    found, other = both(scene, monkeypatch, RecordedBody.advance_sampling)
    assert found.impacts is not None
    assert len(found.impacts) > 1000
    assert_same(found, other)


@pytest.mark.parametrize(("body", "limit"), [("oscillator", 9), ("chain", 9), ("beam", 200)])
def test_a_run_at_its_impact_limit_keeps_the_samples_before(
    body: str, limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = scene_of(body, 41.0, RIGID, impact_limit=limit)
    found, other = both(scene, monkeypatch, RecordedBody.advance_sampling)
    assert found.outcome == Outcome.impact_limit
    assert found.samples is not None
    assert len(found.samples) > 0
    assert_same(found, other)


def test_the_cuts_of_blocks_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of("beam", 41.0, HERTZ)
    whole, _ = both(scene, monkeypatch, RecordedBody.advance_sampling)
    monkeypatch.setattr(point_module, "SAMPLES_OF_A_BLOCK", 7)
    cut, _ = both(scene, monkeypatch, RecordedBody.advance_sampling)
    assert_same(whole, cut)


def test_a_run_that_is_late_keeps_the_samples_before(monkeypatch: pytest.MonkeyPatch) -> None:
    runner = PointRunner(scene_of("beam", 2000.0, HERTZ, periods=4000, deadline=0.3), execution="fused")
    found = runner.run({})
    runner.close()
    assert found.outcome == Outcome.timeout
    assert found.samples is not None
    assert len(found.samples) > 100
    assert np.isfinite(found.samples).all()
