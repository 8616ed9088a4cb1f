"""A whole replay: recordings named, numbers fitted to some of them, all simulated, compared, judged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import xarray as xr

from vibroimpact.analysis.replay.trust import Verdict, trust
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, Either, message
from vibroimpact.orchestrator.replay.fit import ReplayFit, fit_keys, fit_replay
from vibroimpact.orchestrator.replay.output import Replayed, replay_dataset
from vibroimpact.orchestrator.replay.replayer import (
    Replayer,
    is_linear,
    opened_replays,
    recording_of,
    replay_table,
)
from vibroimpact.orchestrator.replay.scoring import compare_motion, scores_of
from vibroimpact.orchestrator.scene import Scene, parse_scene
from vibroimpact.orchestrator.scene.changes import text_with_values


@dataclass(frozen=True, slots=True)
class WholeReplay:
    """Result of a scene and its recordings.

    Attributes
    ----------
    scene : Scene
        The scene with the replayed recordings.
    replays : tuple of Replayed
        The fitted recordings first, then the recordings that were only scored.
    fit : ReplayFit or None
        None without a fit.
    verdict : Verdict or None
        None without a comparison.
    dataset : xarray.Dataset
        As from `replay_dataset`.
    """

    scene: Scene
    replays: tuple[Replayed, ...]
    fit: ReplayFit | None
    verdict: Verdict | None
    dataset: xr.Dataset


def replay_scene(
    scene: Scene,
    recordings: Sequence[Path] = (),
    *,
    fit: str | None = None,
    score: Sequence[Path] = (),
    execution: str | None = None,
    progress: Callable[[int, float], None] = lambda simulations, error: None,
) -> WholeReplay:
    """Drive a scene by recordings and compare its motion with measured channels.

    Parameters
    ----------
    scene : Scene
        A scene with `[replay]`.
    recordings : sequence of Path
        Recordings to replay and to fit; without any, the recordings of the scene.
    fit : str, optional
        Numbers of the scene to fit, by key, with commas between them.
    score : sequence of Path
        Recordings to score without fitting.
    execution : str, optional
        `auto`, `fused` or `coupled`; None: as in the scene.
    progress : callable, optional
        Called during a fit with the number of simulations, and the relative error of the best one.

    Raises
    ------
    UsageError
        The scene sweeps other keys than recordings, recordings are given twice or not at all, or a recording to score
        is fitted too.
    EstimationError
        The numbers cannot be fitted.
    """
    if any(axis.key != "replay.recording" for axis in scene.sweep):
        raise UsageError(
            message(
                f"{scene.source}: sweep: expected no sweep for one dataset. ",
                Either("campaign(scene, folder) takes it.", "Give a folder with -o for a campaign."),
            )
        )
    named = with_recordings(scene, recordings)
    paths = [recording_of(named, number) for number in range(1, len(replay_table(named).recordings) + 1)]
    if score and fit is None:
        raise UsageError(
            message(
                *(Argument("score"), ": expected ", Argument("fit")),
                " beside it: a recording is scored with numbers fitted on others.",
            )
        )
    _refuse_scoring_fitted(paths, score)
    keys = fit_keys(scene, fit) if fit is not None else ()
    # a number at its default in the scene counts as written from now on
    scene = scene.at({key: scene.value(key) for key in keys})
    with opened_replays(scene, [*paths, *score], execution or scene.execution.how) as replayers:
        found = fit_replay(replayers[: len(paths)], keys, progress=progress) if keys else None
        replays, verdict = _judged(scene, replayers, found, len(paths))
        return WholeReplay(named, replays, found, verdict, replay_dataset(replays, found, verdict))


def with_recordings(scene: Scene, recordings: Sequence[Path]) -> Scene:
    """Return a scene that names the recordings as its file could: workers read them by themselves.

    Raises
    ------
    UsageError
        Recordings are named both in the scene and in the call, or not at all.
    """
    there = replay_table(scene).recordings
    if there and recordings:
        raise UsageError(
            message(
                f"{scene.source}: replay.recordings: expected recordings in the scene or ",
                Either("in the call", "on the command line"),
                ", got both.",
            )
        )
    if not recordings:
        if not there:
            raise UsageError(
                f"{scene.source}: expected a recording to replay, got none. Name one after the scene."
            )
        return scene
    named = [str(path.absolute()) for path in recordings]
    return parse_scene(text_with_values(scene.text, {}, named), scene.source)


def _refuse_scoring_fitted(paths: Sequence[Path], scored: Sequence[Path]) -> None:
    """Raise UsageError for a recording that is both scored and fitted: its score would earn false trust."""
    fitted = {path.resolve() for path in paths}
    for path in scored:
        if path.resolve() in fitted:
            raise UsageError(
                message(
                    Argument("score"),
                    f": expected a recording that is not fitted, got {path}, which is. Score another one.",
                )
            )


def _judged(
    scene: Scene, replayers: Sequence[Replayer], found: ReplayFit | None, given: int
) -> tuple[tuple[Replayed, ...], Verdict | None]:
    """Simulate and compare every recording, the first `given` fitted if `found` has numbers; judge the model."""
    numbers = found.numbers if found is not None else None
    replays = []
    for place, replayer in enumerate(replayers):
        motion = replayer.simulate(numbers)
        use = "replayed" if found is None else ("fitted" if place < given else "scored")
        replays.append(Replayed(replayer, motion, compare_motion(replayer, motion), use))
    if not any(replay.comparisons for replay in replays):
        return tuple(replays), None
    fitted = given if found is not None else 0
    scores = scores_of(replayers, [replay.comparisons for replay in replays], fitted)
    verdict = trust(
        *(scores.fitted, scores.others, scores.without_dynamics),
        held=scores.held,
        linear=is_linear(scene.at(numbers or {})),
    )
    return tuple(replays), replace(verdict, reasons=(*verdict.reasons, *scores.remarks))
