"""The expected cost of a scene, from the scene itself and from one computed point."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.run.dataset import dataset_of
from vibroimpact.orchestrator.run.limits import goes_by_lanes
from vibroimpact.orchestrator.run.points import independent_points
from vibroimpact.orchestrator.run.result_size import MOST_BYTES, bytes_of_a_run, size
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import dimensions, most_points, run_count, values_at

MOST_TRIAL_SECONDS = 20.0
"""Wall time after which the trial point is given up, s."""
LONG_ENOUGH = 0.5
"""Wall time of a trial, s, below which it is repeated: the first call of a process is slower than all others."""
LANE_TRIALS, FEWEST_LANE_TRIALS = 64, 8
"""Largest and least number of points that are tried together in lanes; slow points are tried in smaller numbers."""
GOLDEN = 0.6180339887498949
"""Multiples of this number (and of its powers) fill [0, 1) evenly."""
SECONDS_BESIDE, LANE_SECONDS_BESIDE = 3e-5, 1e-6
"""Time of a point, alone and in lanes, besides its run, s: handing it out, arranging and writing it."""
BYTES_BESIDE = 28_000
"""Size of a dataset besides its values, bytes: names, attributes, the text of the scene."""
COPIES_IN_RUN = 4
"""Memory for arranging and writing all results, over the size of the results; a campaign needs it for a chunk."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One point of a scene, computed.

    Attributes
    ----------
    values : mapping of str to float
        Values of the swept keys: the middle value of each axis.
    outcome : Outcome
        Outcome of the run; `timeout`, too, if it was given up after `MOST_TRIAL_SECONDS`.
    message : str
        Reason of the outcome.
    seconds : float
        Wall time, s.
    impacts : int
        Number of recorded impacts.
    size : int
        Size of the results, bytes.
    given_up : bool
        Whether the trial ended the run, not a deadline of the scene.
    lane_seconds : float or None
        Wall time of each of many points that run at once in lanes, s; None without lanes.
    """

    values: Mapping[str, float]
    outcome: Outcome
    message: str
    seconds: float
    impacts: int
    size: int
    given_up: bool
    lane_seconds: float | None = None

    @property
    def seconds_of_a_point(self) -> float:
        """Wall time of a point among the others of its sweep, s."""
        return self.seconds if self.lane_seconds is None else self.lane_seconds


@dataclass(frozen=True, slots=True)
class SceneCost:
    """The expected cost of a scene, extrapolated from one point.

    Attributes
    ----------
    points : int
        Number of points of the sweep, for an adaptive sweep its largest; 1 without a sweep.
    branches : int
        Number of chains of points in which each point starts where the point before ended; else `points`.
    trial : Trial or None
        The computed point; None where no point could be tried.
    untried : str
        Reason why no point was tried.
    first : int
        Number of points of the first round of an adaptive sweep; else 0.
    """

    points: int
    branches: int
    trial: Trial | None
    untried: str = ""
    first: int = 0

    @property
    def result_bytes(self) -> int | None:
        """Size of all results; None when no point was tried."""
        return None if self.trial is None else self.points * self.trial.size

    def seconds(self, workers: int = 1) -> float | None:
        """Return the wall time of all points, without the start of workers, s; None when no point was tried."""
        if self.trial is None:
            return None
        beside = SECONDS_BESIDE if self.trial.lane_seconds is None else LANE_SECONDS_BESIDE
        return self.points * (self.trial.seconds_of_a_point + beside) / min(workers, self.branches)


def cost_of(scene: Scene) -> SceneCost:
    """Return the expected cost of a scene, by a run of one point.

    The point has the middle value of each axis and the scene's own start state. It is given up after
    `MOST_TRIAL_SECONDS`.

    Parameters
    ----------
    scene : Scene
        Scene returned by `load_scene`.

    Raises
    ------
    SceneError, ComponentError
        A component cannot be loaded.

    Examples
    --------
    >>> from vibroimpact.orchestrator.scene import parse_scene
    >>> text = "[body]\\nmass = 1\\nstiffness = 1\\n[record]\\nrecorded_time = 5"
    >>> cost = cost_of(parse_scene(text, "free.toml"))
    >>> cost.points, cost.trial.outcome.name
    (1, 'ok')
    """
    points = run_count(scene.sweep)
    carried = next((axis for axis in scene.sweep if axis.continuation), None)
    branches = points if carried is None else points // len(carried.values)
    untried, most = _why_untried(scene), most_points(scene.sweep)
    trial = None if untried else _tried(scene)
    if most is not None:
        return SceneCost(most, branches, trial, untried, first=points)
    return SceneCost(points, branches, trial, untried)


def _why_untried(scene: Scene) -> str:
    if scene.replay is not None and not scene.replay.recordings:
        return "its recording is given to `vibroimpact replay`"
    recorded = bytes_of_a_run(scene)
    return f"it would record {size(recorded)}, more than {size(MOST_BYTES)}" if recorded > MOST_BYTES else ""


def _tried(scene: Scene) -> Trial:
    deadline = min(MOST_TRIAL_SECONDS, scene.execution.deadline or math.inf)
    limited = scene.model_copy(
        update={"execution": scene.execution.model_copy(update={"deadline": deadline})}
    )
    values = {axis.key: axis.values[len(axis.values) // 2] for axis in scene.sweep}
    with open_scene(limited) as runner:
        record = runner.record_of(values)
        if record.seconds < LONG_ENOUGH:
            record = runner.record_of(values)
    trial = _trial(limited, values, record, given_up=deadline != scene.execution.deadline)
    if trial.given_up or not goes_by_lanes(scene):
        return trial
    together = int(MOST_TRIAL_SECONDS / max(record.seconds, MOST_TRIAL_SECONDS / LANE_TRIALS))
    return replace(trial, lane_seconds=_lane_seconds(scene, max(together, FEWEST_LANE_TRIALS)))


def _lane_seconds(scene: Scene, count: int) -> float:
    """Return the wall time of one of `count` points in lanes, spread over the sweep, s."""
    share = np.arange(count)
    values: dict[str, NDArray[np.float64]] = {}
    for number, members in enumerate(dimensions(scene.sweep)):
        place = (share * GOLDEN ** (number + 1) % 1.0 * len(members[0].values)).astype(np.int64)
        values |= {axis.key: values_at(axis.values, place) for axis in members}
    points = independent_points(values, count)
    with open_scene(scene) as runner:
        for _ in range(2):  # the first call of a process is slower than all others
            began = time.perf_counter()
            columns, _ = runner.rows(points, None, began + MOST_TRIAL_SECONDS)
            seconds = time.perf_counter() - began
            if seconds > LONG_ENOUGH:
                break
        return seconds / len(columns)


def _trial(scene: Scene, values: Mapping[str, float], record: RunRecord, *, given_up: bool) -> Trial:
    columns = {key: np.array([value]) for key, value in values.items()}
    dataset = dataset_of(scene, independent_points(columns, 1), [record], {})
    [outcome], [message] = dataset.outcome.values, dataset.message.values
    return Trial(
        values,
        Outcome(outcome),
        str(message),
        record.seconds,
        impacts=0 if record.impacts is None else len(record.impacts),
        size=dataset.nbytes,
        given_up=given_up and bool(outcome == Outcome.timeout),
    )
