"""How much memory the results of a scene take, known before anything is computed."""

from __future__ import annotations

from vibroimpact.analysis.dataset import PERIOD_COLUMNS
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.body_parameters import state_variables
from vibroimpact.orchestrator.empty_record import sample_variables
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.sweep import run_count

MOST_BYTES = 2**30
"""Results that are kept in memory at once; arranging and writing them takes up to four times as much."""

_RUN_BYTES = 1000
_NUMBER_BYTES = 8


def bytes_of_a_run(scene: Scene) -> int:
    """Return the size of what one run records, but for impacts, whose number nobody knows before."""
    record, general = scene.record, scene.general
    periods = record.recorded_periods if (record.extrema or record.strobe) and general is None else 0
    samples = round(_sampling_rate(scene) * _recorded_seconds(scene))
    numbers = periods * len(PERIOD_COLUMNS) + samples * (1 + len(sample_variables(scene)))
    return _RUN_BYTES + _NUMBER_BYTES * (numbers + len(state_variables(scene)))


def _sampling_rate(scene: Scene) -> float:
    if scene.general is not None:
        return (scene.general.rate or 0.0) if scene.general.variables else 0.0
    return scene.record.time_series.rate if scene.record.time_series is not None else 0.0


def _recorded_seconds(scene: Scene) -> float:
    if scene.period is None:
        return scene.record.recorded_time
    return scene.record.recorded_periods * scene.period


def refuse_large_results(scene: Scene) -> None:
    """Refuse a scene whose results do not fit into the memory of one process.

    Raises
    ------
    UsageError
        With the size and what to do.
    """
    runs, size = run_count(scene.sweep), bytes_of_a_run(scene)
    if runs * size <= MOST_BYTES:
        return
    if runs == 1 or size > MOST_BYTES:
        todo = "Record fewer periods, or sample fewer variables, more slowly or for a shorter time."
    else:
        todo = "Use `vibroimpact campaign`, which keeps each point on the disk as soon as it is computed."
    raise UsageError(
        f"{scene.source}: expected results of at most {MOST_BYTES / 2**30:g} GiB, which `vibroimpact run` keeps in "
        f"memory, got {runs} {'run' if runs == 1 else 'runs'} of {size / 2**20:.3g} MiB each. {todo}"
    )
