"""Budgets of studies: kept by processor time, the transient passed once, the time halved until each way ends."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.ticking_clock import TickingClock, tick_the_clock

from vibroimpact.analysis.study import whole
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.accuracy import AccuracyOfScene, Comparison, Measured, dataset_of, trying
from vibroimpact.orchestrator.study.accuracy.budget import LEAST_BUDGET, Budget
from vibroimpact.orchestrator.study.accuracy.reach import limited_elsewhere, transient_passed
from vibroimpact.orchestrator.study.accuracy.refusals import refuse_misuse
from vibroimpact.orchestrator.study.accuracy.study import MOST_FIRST_PERIODS, first_impacts, studied_scene
from vibroimpact.orchestrator.study.errors import no_errors
from vibroimpact.orchestrator.study.observation import LATE, Observation
from vibroimpact.orchestrator.study.processor import processor_time_of_all
from vibroimpact.orchestrator.study.ways import all_ways
from vibroimpact.orchestrator.study.ways.driven import DrivenTrial
from vibroimpact.orchestrator.study.ways.way import Way

P11: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"law": "restitution", "position": 1.0, "restitution": 0.7}],
    "record": {"transient_periods": 35, "recorded_periods": 8},
}
ROOM = "vibroimpact.orchestrator.study.accuracy"
STEPS = (23, 61, 127)
"""Plain steps a period in the ways of these tests."""
LOOKS = 2
"""Readings of the clock in each step: by the way, and by the driver of the body."""


def studied(scene: Scene, clock: TickingClock, budget: float = LEAST_BUDGET) -> Comparison:
    """Return the comparison of fused runs and plain steps of a scene, with costs by the given clock."""
    with pytest.MonkeyPatch.context() as patch:
        tick_the_clock(patch, clock)
        patch.setattr(all_ways, "STEPS_A_PERIOD", STEPS)
        for others in ("_coupled", "_revised", "_integrated"):
            patch.setattr(all_ways, others, lambda scene: [])
        patch.setattr(all_ways, "other_models", lambda scene, speed: [])
        patch.setattr(f"{ROOM}.study.MOST_ROUNDS", 2)
        return whole(AccuracyOfScene(scene, budget=budget)).comparison


def plain(study: Comparison) -> list[Measured]:
    return [one for one in study.measured if one.way.name == "plain steps"]


@pytest.fixture(scope="module")
def halved() -> Comparison:
    # 127 steps in each of 8 periods take 10 s; runs of the last way may take 3 s
    return studied(Scene.from_dict(P11), TickingClock(tick=0.005))


def test_the_time_is_halved_until_each_way_ends(halved: Comparison) -> None:
    parts = [one.part for one in plain(halved)]
    assert not any(one.errors.failure == "did not finish" for one in halved.measured)
    assert parts == sorted(parts, reverse=True)
    assert parts[-1] < 1.0
    assert all(math.log2(part).is_integer() for part in parts)
    assert all(one.error("all") > 0.0 for one in plain(halved) if not one.errors.failure)


def test_cost_over_all_of_the_time_is_extrapolated_and_marked(halved: Comparison) -> None:
    for one, steps in zip(plain(halved), STEPS, strict=True):
        assert one.cost == pytest.approx(0.005 * LOOKS * steps * 8, rel=0.1)
        assert one.cost_of_one(halved.periods) == pytest.approx(0.005 * LOOKS * steps, rel=0.1)
    dataset = dataset_of(halved)
    assert dataset.is_extrapolated.values.tolist() == [one.part < 1.0 for one in halved.measured]
    assert dataset.attrs["budget"] == LEAST_BUDGET
    assert not any(one.way.name == "plain steps" and one.part < 1.0 for one in [halved.chosen] if one)


@pytest.mark.parametrize("tick", [1e-5, 1e-2, 3e-2])
def test_the_budget_is_kept_within_a_factor_of_one_and_a_half(tick: float) -> None:
    for budget in (LEAST_BUDGET, 40.0):
        clock = TickingClock(tick)
        study = studied(Scene.from_dict(P11), clock, budget)
        assert study.effort.processor == pytest.approx(clock.time)
        assert clock.time <= 1.5 * budget


def test_memory_is_measured_last_and_only_if_there_is_time() -> None:
    quick, slow = TickingClock(1e-5), TickingClock(3e-2)
    study = studied(Scene.from_dict(P11), quick)
    assert quick.told.index("memory") == len(quick.told) - 1
    assert all(one.memory == 1 for one in study.measured)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(f"{ROOM}.study.LEAST_MEMORY", LEAST_BUDGET)
        study = studied(Scene.from_dict(P11), slow)
    assert "memory" not in slow.told
    assert all(one.memory == -1 for one in study.measured)


def test_an_output_without_a_value_over_so_little_leaves_its_cost_in_proportion() -> None:
    """Before the first impact, a component has no phase of a last impact: a study of `mixed_versions` failed there."""

    class Trial:
        closed = 0

        def run(self) -> Observation:
            raise ComponentError("body.contact[1].last_phase: expected a finite value, got nan at time 2.")

        def close(self) -> None:
            Trial.closed += 1

    way = Way("coupled", "", math.nan, {}, lambda wrap, part: Trial())
    one = Measured(way, no_errors(""), 0.25, seconds=[2.0])
    trying._measure_more(one, 2.0, 10.0)
    assert math.isnan(one.short)
    assert one.cost == pytest.approx(8.0)
    assert Trial.closed == 1


def test_the_transient_is_passed_once() -> None:
    clocks, errors = [], []
    for periods in (35, 3500):
        clocks.append(TickingClock(1e-4))
        record = {"transient_periods": periods, "recorded_periods": 8}
        study = studied(Scene.from_dict(P11 | {"record": record}), clocks[-1], 40.0)
        assert study.scene.record.transient_periods == 0
        assert study.periods == pytest.approx(8.0)
        assert study.orbit == "P(1,1)"
        errors.append([one.error("impact_velocity") for one in plain(study)])
    assert clocks[1].time == pytest.approx(clocks[0].time, rel=0.1)
    np.testing.assert_allclose(errors[0], errors[1], rtol=1e-3)


CHAIN: dict[str, Any] = {
    "body": {"kind": "chain", "masses": [2.0, 1.0], "stiffnesses": [3.0, 1.0], "dampings": 0.1},
    "forcing": {"amplitude": [0.0, 1.0], "angular_frequency": 0.8, "phase": 0.4},
    "stop": [{"position": 0.5, "restitution": 0.6, "mass": 1}],
    "record": {"transient_periods": 7, "recorded_periods": 3},
}
BEAM: dict[str, Any] = {
    "body": {
        **{"kind": "beam", "modes": 3, "damping_ratio": 0.02, "length": 0.25},
        **{"flexural_rigidity": 0.9333, "mass_per_length": 0.108},
    },
    "forcing": {"amplitude": 0.3, "angular_frequency": 165.0},
    "stop": [{"law": "kelvin_voigt", "position": 1e-3, "stiffness": 1e4, "damping": 1.0}],
    "record": {"transient_periods": 5, "recorded_periods": 4},
}
RINGS: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 4.0, "displacement_start": 1.0},
    "stop": [{"position": -0.5, "restitution": 0.9, "side": "lower"}],
    "record": {"transient_time": 9.0, "recorded_time": 5.0},
}


@pytest.mark.parametrize("tables", [CHAIN, BEAM, RINGS], ids=["chain", "beam", "unforced"])
def test_the_state_after_the_transient_is_a_start_of_each_kind_of_body(tables: dict[str, Any]) -> None:
    scene = Scene.from_dict(tables)
    passed = transient_passed(studied_scene(scene), Budget(40.0))
    assert passed.is_kept
    assert passed.remark == ""
    assert passed.scene.forcing is None or float(passed.scene.forcing.phase) == 0.0


def test_a_transient_whose_end_is_no_start_is_passed_by_each_way(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = studied_scene(Scene.from_dict(P11))
    other = scene.with_values({"record.transient_periods": 0, "body.velocity_start": 0.5})
    monkeypatch.setattr(f"{ROOM}.reach._started_with", lambda scene, state: other)
    passed = transient_passed(scene, Budget(40.0))
    assert not passed.is_kept
    assert passed.scene is scene
    assert passed.remark.startswith("one transient for all ways")


class Slow(DrivenTrial):
    """A trial that is given up in its transient, after a fiftieth of its time."""

    def run(self) -> Observation:
        is_late = self._window[0] > 0.0
        return Observation(failure=LATE, reached=0.02) if is_late else super().run()


def test_a_budget_below_what_a_scene_needs_is_refused_with_what_it_needs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(f"{ROOM}.reach.DrivenTrial", Slow)
    said = (
        r"budget: expected about 500 s or more of processor time, got 10: the transient takes more than 2.5 s"
    )
    with pytest.raises(UsageError, match=said):
        studied(Scene.from_dict(P11), TickingClock())


def test_a_recording_that_takes_too_much_is_cut_and_said_so() -> None:
    long = Scene.from_dict(P11 | {"record": {"recorded_periods": 2**15}})
    study = studied(long, TickingClock(0.05))
    assert study.scene.record.recorded_periods < 2**15
    assert any(remark.startswith("all but the first ") for remark in study.remarks)


def test_first_impacts_are_looked_for_within_the_budget() -> None:
    rare = Scene.from_dict(P11 | {"forcing": {"amplitude": 1e-3, "angular_frequency": 1.0}})
    with pytest.MonkeyPatch.context() as patch:
        tick_the_clock(patch, TickingClock(1.0))
        assert first_impacts(rare, Budget(LEAST_BUDGET)).record.recorded_periods == 1
        tick_the_clock(patch, TickingClock(0.0))
        assert first_impacts(rare, Budget(LEAST_BUDGET)).record.recorded_periods == MOST_FIRST_PERIODS
        hits = first_impacts(Scene.from_dict(P11), Budget(LEAST_BUDGET))
    assert 1 < hits.record.recorded_periods <= 16


def test_runs_in_other_processes_are_given_up_by_wall_time_or_earlier_where_the_scene_says_so() -> None:
    execution = {"how": "coupled", "guard": True}
    guarded = Scene.from_dict(P11 | {"execution": execution})
    assert limited_elsewhere(guarded, 1.0).execution.deadline == 1.0
    sooner = Scene.from_dict(P11 | {"execution": execution | {"deadline": 0.5}})
    assert limited_elsewhere(sooner, 1.0).execution.deadline == 0.5
    here = Scene.from_dict(P11)
    assert limited_elsewhere(here, 1.0) is here


@pytest.mark.parametrize(("slowness", "is_busy"), [(1.0, False), (4.0, True)])
def test_a_busy_machine_is_said_and_changes_no_cost(slowness: float, is_busy: bool) -> None:
    study = studied(Scene.from_dict(P11), TickingClock(1e-4, slowness))
    calm = studied(Scene.from_dict(P11), TickingClock(1e-4))
    assert study.effort.is_busy == is_busy
    assert ("The machine was busy: runs waited for a processor in 75 %" in study.effort.in_words()) == is_busy
    assert [one.cost for one in study.measured] == pytest.approx([one.cost for one in calm.measured])


def test_less_than_the_least_budget_is_refused() -> None:
    refuse_misuse(None, "all", LEAST_BUDGET)
    with pytest.raises(UsageError, match="budget: expected a finite processor time of 10 s or more, got 9"):
        refuse_misuse(None, "all", 9.0)


BURN = "import time\nwhile time.process_time() < .2: pass\n"


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere processes that run are not counted")
def test_the_processor_time_of_processes_that_run_and_have_ended_counts(tmp_path: Path) -> None:
    began = processor_time_of_all()
    subprocess.run([sys.executable, "-c", BURN], check=True)
    assert processor_time_of_all() - began >= 0.2
    began = processor_time_of_all()
    waits = f"{BURN}print(flush=True)\ninput()\n"
    with subprocess.Popen(
        [sys.executable, "-c", waits], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as child:
        assert child.stdout is not None
        child.stdout.readline()
        assert processor_time_of_all() - began >= 0.2
        child.communicate(b"\n")
