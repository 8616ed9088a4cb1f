"""What a scene would do and cost, known from the scene itself and from one of its points, which is computed."""

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
from vibroimpact.orchestrator.scene.sweep import dimensions, most_points, run_count

MOST_TRIAL_SECONDS = 20.0
"""Wall time after which the trial point is given up, s."""
LONG_ENOUGH = 0.5
"""A shorter trial is repeated, s: the first call of a process is slower than all that follow."""
LANE_TRIALS, FEWEST_LANE_TRIALS = 64, 8
"""Points that are tried together where they run in lanes: fewer where one by itself takes long."""
GOLDEN = 0.6180339887498949
"""Its multiples, of its powers likewise, spread over the unit interval: no two axes move together."""
SECONDS_BESIDE = 3e-5
"""What a point takes beside its own time: handing out, arranging and writing it, s."""
BYTES_BESIDE = 28_000
"""What a dataset has beside its values: names, attributes, the text of the scene."""
COPIES_IN_RUN, COPIES_IN_CAMPAIGN = 4, 2
"""Size of the memory that arranging and writing all results takes, over that of the results."""


@dataclass(frozen=True, slots=True)
class Trial:
    """One point of a scene, computed.

    Attributes
    ----------
    values : mapping of str to float
        What it has of the swept keys: of each axis the value in the middle.
    outcome : Outcome
        Likewise `timeout` where it was given up after `MOST_TRIAL_SECONDS`.
    message : str
        Why it ended so.
    seconds : float
        Wall time, s.
    impacts : int
        Number of recorded impacts.
    size : int
        Bytes of what was recorded.
    given_up : bool
        Whether it was ended here, and not by a deadline of the scene.
    lane_seconds : float or None
        Wall time of one of many points of the sweep that run at once, where they do, s.
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
    """What a scene would cost, extrapolated from one point.

    Attributes
    ----------
    points : int
        Of the sweep; 1 without.
    branches : int
        Chains of points along which each starts where the one before ended; `points` without a continuation.
    trial : Trial or None
        None where no point could be tried.
    untried : str
        Why none was tried.
    first : int
        Points of the first round of an adaptive sweep, whose `points` are the most that there may be; else 0.
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
        """Return the wall time of all points on so many workers, without their start, s; None when none was tried."""
        if self.trial is None:
            return None
        return self.points * (self.trial.seconds_of_a_point + SECONDS_BESIDE) / min(workers, self.branches)


def cost_of(scene: Scene) -> SceneCost:
    """Run one point of a scene, and say what all of them would cost.

    The point is the middle one of the sweep, from the scene's own start state. It is given up after
    `MOST_TRIAL_SECONDS`.

    Parameters
    ----------
    scene : Scene
        As `load_scene` returns it.

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
    """Return what one of so many points, spread over the sweep, takes when they run in lanes, s."""
    share = np.arange(count)
    values: dict[str, NDArray[np.float64]] = {}
    for number, members in enumerate(dimensions(scene.sweep)):
        place = (share * GOLDEN ** (number + 1) % 1.0 * len(members[0].values)).astype(np.int64)
        values |= {axis.key: np.array(axis.values)[place] for axis in members}
    points = independent_points(values, count)
    with open_scene(scene) as runner:
        for _ in range(2):  # the first call of a process is slower than all that follow
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
