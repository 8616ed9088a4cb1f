"""From analog voltages to the samples of a dataset: noise is added, a converter rounds and clips.

Noise depends only on the seed, the run, the channel and the number of the sample. Workers and the cut of a campaign
into chunks do not change it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction, RunRecord
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.keys import coordinate_name
from vibroimpact.orchestrator.scene.measuring_models import LOAD_CELL, channel_number

Floats = NDArray[np.float64]


def run_seed(seed: int, values: Mapping[str, float], direction: Direction) -> int:
    """Return the seed of the noise of a run, 0 to 2^64 - 1: `noise.seed` where the scene sweeps nothing.

    The seed depends on the point (the values of the swept keys and the direction of its branch). It does not depend on
    the number of the point, which other sweeps of the same campaign change.

    Examples
    --------
    >>> run_seed(7, {}, Direction.independent)
    7
    >>> run_seed(7, {"body.mass": 1.0}, Direction.up) == run_seed(7, {"body.mass": 1.0}, Direction.down)
    False
    """
    if not values:
        return seed
    point = ",".join(f"{key}={float(value).hex()}" for key, value in sorted(values.items()))
    content = f"{seed};{direction.name};{point}".encode()
    return int.from_bytes(hashlib.blake2b(content, digest_size=8).digest(), "big")


def converted(scene: Scene, analog: Floats, names: Sequence[str], seed: int) -> Floats:
    """Return samples with noise and conversion of their channels: the time, then each of the names.

    The scene is at its point, the samples have the shape (sample, 1 + variable), and the seed comes from `run_seed`.
    """
    # only scenes with a measuring chain need the core here
    from vibroimpact.fmus.core.measuring import digitised, gaussian

    samples = analog.copy()
    for column, name in enumerate(names, start=1):
        if name not in scene.channels:
            continue
        rms = scene.noise.of(name) if scene.noise is not None else 0.0
        if rms > 0.0:
            samples[:, column] += rms * gaussian(seed, channel_number(name), 0, len(samples))
        if scene.daq is not None:
            samples[:, column] = digitised(samples[:, column], scene.daq.range, scene.daq.bits)
    return samples


def converted_records(
    scene: Scene,
    values: Mapping[str, NDArray[np.float64]],
    directions: Sequence[Direction] | NDArray[np.int8],
    records: Sequence[RunRecord],
) -> list[RunRecord]:
    """Return the records of runs with their samples converted."""
    found, seed = [], scene.noise.seed if scene.noise is not None else 0
    for place, record in enumerate(records):
        if record.samples is not None and len(record.samples):
            point = {key: float(column[place]) for key, column in values.items()}
            own = run_seed(seed, point, Direction(int(directions[place])))
            names = scene.sampled
            record = replace(record, samples=converted(scene.at(point), record.samples, names, own))
        found.append(record)
    return found


def channel_attributes(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return the attributes of each channel, with the numbers of its chain, or their coordinates if swept."""
    swept = [axis.key for axis in scene.sweep]

    def number_of(key: str) -> float | str:
        return coordinate_name(key, swept) if key in swept else scene.value(key)

    found: dict[str, dict[str, Any]] = {}
    for place, name in enumerate(scene.channels):
        own: dict[str, Any] = {"channel": name}
        if name.startswith("sensor.") and scene.sensor is not None and scene.sensor.range:
            own["sensor_range"] = number_of("sensor.range")
        if name == LOAD_CELL:
            own["sensitivity"] = number_of("load_cell.sensitivity")
        if scene.noise is not None:
            own |= {
                "noise_rms": number_of(f"noise.{name.partition('.')[0]}"),
                "noise_seed": scene.noise.seed,
            }
        if scene.daq is not None:
            own |= {
                "range": number_of("daq.range"),
                "bits": scene.daq.bits,
                "clock_error_ppm": number_of("daq.clock_error"),
            }
            own["skew"] = number_of("daq.skew") if "daq.skew" in swept else place * scene.daq.skew
            own["place"] = place
        found[name] = own
    return found
