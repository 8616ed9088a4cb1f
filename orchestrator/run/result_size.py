"""The size of a scene's results in memory, known before anything is computed."""

from __future__ import annotations

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.run.empty_record import columns_of_periods
from vibroimpact.orchestrator.run.parameters import most_elements
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import run_count

MOST_BYTES = 10**9
"""Largest size of results in memory, bytes; arranging and writing them takes up to four times as much."""

_RUN_BYTES = 1000
_NUMBER_BYTES = 8
_SIZES = ("B", "kB", "MB", "GB", "TB", "PB")


def bytes_of_a_run(scene: Scene) -> int:
    """Return the size of one run's record, bytes, without impacts, whose number is not known in advance."""
    record = scene.record
    periods = record.recorded_periods if (record.extrema or record.strobe) else 0
    # the body refuses an infinite period
    rate = scene.sampling_rate
    samples = round(rate * _recorded_seconds(scene)) if rate else 0
    periods = periods if record.each_period else min(periods, 1)
    numbers = periods * columns_of_periods(scene) + samples * (1 + scene.sample_size)
    return _RUN_BYTES + _NUMBER_BYTES * (numbers + 2 * most_elements(scene))


def _recorded_seconds(scene: Scene) -> float:
    if scene.period is None:
        return scene.record.recorded_time
    return scene.record.recorded_periods * scene.period


def size(count: float) -> str:
    """Return a number of bytes in words, with a decimal prefix.

    >>> size(999), size(157e6), size(2.34e12)
    ('999 B', '157 MB', '2.3 TB')
    """
    power = 0
    while count >= 999.5 and power < len(_SIZES) - 1:
        count, power = count / 1000, power + 1
    return f"{count:.{0 if count >= 9.95 or power == 0 else 1}f} {_SIZES[power]}"


def refuse_large_results(scene: Scene) -> None:
    """Raise UsageError unless the results of a scene fit into the memory of one process.

    Raises
    ------
    UsageError
        The message has the size and a remedy.
    """
    runs, each = run_count(scene.sweep), bytes_of_a_run(scene)
    if runs * each <= MOST_BYTES:
        return
    if runs == 1 or each > MOST_BYTES:
        todo = "Record fewer periods, or sample fewer variables, more slowly or for a shorter time."
    else:
        todo = "Use `vibroimpact campaign`, which keeps each point on the disk as soon as it is computed."
    raise UsageError(
        f"{scene.source}: expected results of at most {size(MOST_BYTES)}, which `vibroimpact run` keeps in memory, "
        f"got {size(runs * each)} of {runs} {'run' if runs == 1 else 'runs'}. {todo}"
    )
