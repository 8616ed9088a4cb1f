"""The process that simulates one point again: its answer is the motion in time, its impacts and sections."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset import (
    IMPACT_COLUMNS,
    PERIOD_COLUMNS,
    RULES,
    Direction,
    RunRecord,
    merge_datasets,
    read_flat,
    read_runs,
)
from vibroimpact.analysis.dataset.naming import known_unit
from vibroimpact.analysis.dataset.schema import attributes_of, unit_in
from vibroimpact.analysis.files.stores import is_store
from vibroimpact.fmus.errors import UsageError, VibroimpactError
from vibroimpact.orchestrator.campaign.manifest import read_manifest
from vibroimpact.orchestrator.campaign.rounds import Rounds, adaptive_axes
from vibroimpact.orchestrator.run.points import BranchPoint, State, columns_of_points
from vibroimpact.orchestrator.run.runner import CARRYING
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene
from vibroimpact.orchestrator.scene.models import TimeSeries
from vibroimpact.orchestrator.scene.sweep import Branch, expand
from vibroimpact.service.landed import files_of, opened_runs
from vibroimpact.service.slices import finite

MOST_PERIODS = 20
"""Largest number of recorded periods to show."""
PER_PERIOD = 200
"""Number of samples in a forcing period."""
MOST_SAMPLES = MOST_PERIODS * PER_PERIOD + 1
"""Largest number of samples to show: those of `MOST_PERIODS` periods, with both ends."""
OBSERVED = ("displacement", "velocity")


def answer(scene: str, results: str, run: int) -> dict[str, Any]:
    """Return the motion of one point, by its index, or the reason why it `failed`.

    Results are the folder of a campaign, or the dataset of a run. In a sweep with a path the point starts from the end
    state of the point before it.
    """
    try:
        return simulated(Path(scene), Path(results), run)
    except VibroimpactError as error:
        return {"failed": str(error)}


def simulated(path: Path, results: Path, run: int) -> dict[str, Any]:
    """Return the motion of one point, ready for JSON."""
    given = load_scene(path)
    scene = _as_it_ran(given, results)
    place, branch = _place_of(scene, results, run)
    start = None if place.first else _start_of(results, branch, run)
    watched = _watched(scene, place)
    with open_scene(watched) as runner:
        record = runner.record_of(place.point.values, place.start if place.first else start)
    names = watched.plain_samples
    motion = {
        "samples": _samples(record, names),
        "impacts": _columns(record.impacts, IMPACT_COLUMNS),
        "periods": _columns(record.periods, PERIOD_COLUMNS),
    }
    return {
        "run": run,
        "direction": place.direction.name,
        "coordinates": {scene.sweep_coordinate_name(key): value for key, value in place.point.values.items()},
        "outcome": record.outcome.name,
        "message": record.message,
        "units": _units(scene, [name for columns in motion.values() for name in columns]),
        "stops": _stops(scene.at(place.point.values), names),
        "left_out": _left_out(scene, watched, record),
        **motion,
    }


def _as_it_ran(given: Scene, results: Path) -> Scene:
    """Return the scene with the settings that were determined before its run, without determining them again."""
    if given.execution.tolerance is None:
        return given
    if not results.is_dir():
        return parse_scene(str(read_flat(results).attrs["scene"]), given.source)
    manifest = read_manifest(results / "campaign.json")
    return given if manifest is None else parse_scene(manifest.scene_text, given.source)


def _place_of(scene: Scene, results: Path, run: int) -> tuple[BranchPoint, Branch]:
    """Return a point and its branch; in an adaptive sweep, the earlier rounds determine both."""
    if adaptive_axes(scene):
        files = files_of(results)
        rows = read_runs(files[0]) if files and is_store(files[0]) else merge_datasets(files)
        branch = Rounds(scene).branch_of(rows, run)
    else:
        ends = ((one, one.points.first_index + len(one.points)) for one in expand(scene))
        branch = next((one for one, end in ends if run < end), None)
    if branch is None:
        raise UsageError(f"run: expected a point of this campaign, got {run}.")
    return columns_of_points([branch], run, run + 1).place(0), branch


def _start_of(results: Path, branch: Branch, run: int) -> State | None:
    """Return the start state of a point on a path: the end state of the nearest earlier point that reached its end.

    Raise UsageError if an earlier point is not computed yet.
    """
    if branch.direction == Direction.independent.name:
        return None
    first, known = branch.points.first_index, dict[int, State | None]()
    for path in files_of(results):
        with opened_runs(path) as file:
            runs, outcomes = file["run_index"][:], file["outcome"][:]
            if "final_state" in file.variables:
                states = file["final_state"][:]
            else:
                states = np.column_stack([file["final_displacement"][:], file["final_velocity"][:]])
        ended = np.isin(outcomes, CARRYING) & np.isfinite(states).all(axis=1)
        for place in np.flatnonzero((runs >= first) & (runs < run)):
            known[int(runs[place])] = tuple(states[place].tolist()) if ended[place] else None
    for before in range(run - 1, first - 1, -1):
        if before not in known:
            raise UsageError(f"run: expected a point whose predecessor has been computed, got {run}.")
        if known[before] is not None:
            return known[before]
    return None


def _watched(scene: Scene, place: BranchPoint) -> Scene:
    """Return a scene that records the data to show: its first recorded periods in time, with the impacts."""
    record = scene.record
    if not scene.is_lone_body:
        return scene
    period = scene.at(place.point.values).period
    if record.recorded_periods:
        record = record.model_copy(update={"recorded_periods": min(record.recorded_periods, MOST_PERIODS)})
    if record.recorded_periods and period:
        rate = PER_PERIOD / period
    else:
        rate = (MOST_SAMPLES - 1) / record.recorded_time if record.recorded_time else PER_PERIOD
    others = scene.sampled
    series = TimeSeries(rate=rate, variables=tuple(dict.fromkeys((*OBSERVED, *others))))
    return scene.model_copy(
        update={"record": record.model_copy(update={"time_series": series, "impacts": True, "strobe": True})}
    )


def _stops(scene: Scene, names: Sequence[str]) -> dict[str, list[float]]:
    """Return the positions (m) of the stops at rest that limit each sampled displacement, by its name."""
    found: dict[str, list[float]] = {}
    if not scene.is_one_body:
        return found
    body = scene.body
    observed = body.observed_place(scene.stops, scene.sensor)
    for name in names:
        word, _, number = name.rstrip("]").partition("[")
        for place, stop in enumerate(scene.stops, start=1):
            if stop.moves:
                continue
            point = body.place_of(stop)
            limited = {
                "displacement": point == observed and not number,
                "contact_displacement": number == str(place),
            }
            is_of_mass = body.PLACE == "mass" and word == "displacement" and number == str(point)
            if limited.get(word, False) or is_of_mass:
                found.setdefault(name, []).append(stop.position)
    return found


def _left_out(scene: Scene, watched: Scene, record: RunRecord) -> list[str]:
    """Return a sentence for each part of the run that is not shown."""
    found = []
    own, shown = scene.record.recorded_periods, watched.record.recorded_periods
    if own and shown and shown < own:
        found.append(f"The first {shown} of {own} recorded periods are shown.")
    if scene.moving_stop:
        found.append("Stops that move are not drawn.")
    samples = 0 if record.samples is None else len(record.samples)
    if samples > MOST_SAMPLES:
        found.append(f"One of {_every(samples)} of {samples} samples is drawn.")
    if watched.sample_forms:
        found.append(
            f"Arrays, texts, enumerations and long integers are not drawn: {', '.join(watched.sample_forms)}."
        )
    for words, rows in (("impacts", record.impacts), ("periods", record.periods)):
        if rows is not None and len(rows) > MOST_SAMPLES:
            found.append(f"The first {MOST_SAMPLES} of {len(rows)} {words} are shown.")
    return found


def _every(samples: int) -> int:
    return max(1, -(-samples // MOST_SAMPLES))


def _units(scene: Scene, names: Sequence[str]) -> dict[str, str]:
    """Return the units of the shown variables, except those reported by components, whose units only they know."""
    found = {}
    for name in names:
        if name in RULES:
            found[name] = str(attributes_of(name, scene.units)["units"])
        elif scene.is_one_body and (unit := known_unit(name.replace(".", "_"))) is not None:
            found[name] = unit_in(scene.units, unit)
    return found


def _samples(record: RunRecord, names: tuple[str, ...]) -> dict[str, list[float | None]]:
    if record.samples is None:
        return {}
    return _columns(record.samples[:: _every(len(record.samples))], ("time", *names))


def _columns(rows: Any, names: tuple[str, ...]) -> dict[str, list[float | None]]:
    if rows is None:
        return {}
    shown = rows[:MOST_SAMPLES]
    return {name: finite(shown[:, place]) for place, name in enumerate(names[: shown.shape[1]])}
