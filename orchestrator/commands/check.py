"""The command `vibroimpact check`: prints the problems of a scene, or its engine, effects and cost."""

from __future__ import annotations

from collections.abc import Iterator

import typer

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import counted, duration
from vibroimpact.fmus.terminal import say
from vibroimpact.orchestrator.campaign import SceneCost, cost_of
from vibroimpact.orchestrator.campaign.check import (
    BYTES_BESIDE,
    COPIES_IN_RUN,
    LANE_TRIALS,
    MOST_TRIAL_SECONDS,
    Trial,
)
from vibroimpact.orchestrator.campaign.workers.here import HERE_SECONDS, may_begin_here
from vibroimpact.orchestrator.campaign.workers.processors import processor_count
from vibroimpact.orchestrator.campaign.workers.threads import thread_count
from vibroimpact.orchestrator.commands.failures import FAILED
from vibroimpact.orchestrator.operations.check import Check
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.result_size import refuse_large_results, size
from vibroimpact.orchestrator.run.summary import (
    clock_remark,
    contacts,
    effects,
    engine,
    fused_form,
    laws,
    natural_frequencies,
    out_of_lanes,
)
from vibroimpact.orchestrator.running.opening import DEFAULT_RUNNER
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.study.preparing import with_modes

_WIDTH = 10


def check_scene(options: Check) -> None:
    """Load a scene, compute one point of it, and print its engine, its effects and its cost.

    SceneError: the scene has problems. typer.Exit: the point failed.
    """
    scene = with_modes(opened_scene(options.scene, options.changes or (), strict=options.strict))
    say(f"{options.scene}: no problems")
    _say_aligned(_what_runs(scene))
    cost = cost_of(scene)
    _say_aligned(_what_it_costs(scene, cost))
    if cost.trial is not None and cost.trial.outcome in FAILED and not cost.trial.given_up:
        raise typer.Exit(1)


def _say_aligned(lines: Iterator[tuple[str, str]]) -> None:
    for name, text in lines:
        say(f"  {name:<{_WIDTH}}{text}")


def _what_runs(scene: Scene) -> Iterator[tuple[str, str]]:
    yield "engine", engine(scene)
    if scene.stops:
        yield "stops", ", ".join(f"{stop} {law}" for stop, law in laws(scene).items())
    if meeting := contacts(scene):
        yield "contacts", "; ".join(f"{contact} {what}" for contact, what in meeting.items())
    if remark := fused_form(scene):
        yield "fused", remark
    if remark := out_of_lanes(scene):
        yield "lanes", remark
    if remark := clock_remark(scene):
        yield "clock", remark
    known = effects(scene)
    listed = ("stops" if scene.stops else "", "contacts")
    yield (
        "effects",
        ", ".join(name for name, there in known.items() if there and name not in listed) or "none",
    )
    yield "without", ", ".join(name for name, there in known.items() if not there)


def _what_it_costs(scene: Scene, cost: SceneCost) -> Iterator[tuple[str, str]]:
    yield "points", _points(cost)
    yield "trial", f"none: {cost.untried}" if cost.trial is None else _trial(cost.trial)
    if scene.is_one_body and cost.trial is not None and cost.trial.outcome not in FAILED:
        yield "modes", natural_frequencies(scene.at(cost.trial.values))
    refused = _refused(scene)
    if cost.first:
        yield "run", "refused: the points of adaptive axes are found by `vibroimpact campaign`"
    elif refused or cost.trial is not None:
        yield "run", refused or _time(cost) + _memory(cost)
    if cost.trial is None:
        return
    most = "at most " if cost.first else ""
    if cost.points > 1:
        yield "campaign", f"{most}{_campaign(scene, cost)}"
    if not cost.trial.given_up:
        yield "dataset", f"{most}about {size(cost.trial.size * cost.points + BYTES_BESIDE)}"


def _campaign(scene: Scene, cost: SceneCost) -> str:
    """Return the time of a campaign, and where it computes."""
    begins_here = may_begin_here(scene, DEFAULT_RUNNER, cost.points)
    workers = min(processor_count(), cost.branches)
    if begins_here and (cost.seconds() or 0.0) <= HERE_SECONDS:
        return f"{_time(cost)} in this process"
    if begins_here and goes_by_lanes(scene) and thread_count("lanes"):
        return f"{_time(cost, workers)} in {counted(workers, 'thread')} of this process"
    return f"{_time(cost, workers)} on {counted(workers, 'worker')} and some seconds to start"


def _points(cost: SceneCost) -> str:
    if cost.first:
        return f"{cost.first} in the first round, {cost.points} at most: more go where the motion jumps"
    if cost.branches == cost.points:
        return f"{cost.points}"
    chains = (
        f"in {cost.branches} branches of {cost.points // cost.branches}"
        if cost.branches > 1
        else "in one branch"
    )
    return f"{cost.points} {chains}, along which each starts where the one before ended"


def _trial(trial: Trial) -> str:
    at = ", ".join(f"{key} = {value:.12g}" for key, value in trial.values.items())
    where = f"one point was computed{f', {at}' if at else ''}: "
    if trial.given_up:
        return f"{where}given up after {duration(MOST_TRIAL_SECONDS)}"
    if trial.message:
        text = " ".join(trial.message.split())
        return f"{where}outcome {trial.outcome.name} after {duration(trial.seconds)}, {text}"
    alike = "; the lines below assume that all points are like it" if at else ""
    if trial.lane_seconds is not None:
        alike = f"; {duration(trial.lane_seconds)} with {LANE_TRIALS} points at once, which the lines below assume"
    return f"{where}{duration(trial.seconds)}, {counted(trial.impacts, 'impact')}, {size(trial.size)} of results{alike}"


def _refused(scene: Scene) -> str:
    try:
        refuse_large_results(scene)
    except UsageError as refused:
        return f"refused: {str(refused).removeprefix(f'{scene.source}: ')}"
    return ""


def _time(cost: SceneCost, workers: int = 1) -> str:
    seconds = cost.seconds(workers)
    assert seconds is not None
    given_up = cost.trial is not None and cost.trial.given_up
    return f"{'more than' if given_up else 'about'} {duration(seconds)}"


def _memory(cost: SceneCost) -> str:
    if cost.trial is None or cost.trial.given_up:
        return ""
    return f"; at its end {size(COPIES_IN_RUN * cost.points * cost.trial.size)} of memory for results"
