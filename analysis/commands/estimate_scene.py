"""The numbers that `vibroimpact estimate` takes from the scene of a simulated run, and from its options."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.analysis.dataset.clock import refuse_several_forces
from vibroimpact.analysis.dataset.naming import file_name_of
from vibroimpact.analysis.dataset.schema import scene_of, swept_names
from vibroimpact.analysis.dataset.stores.runs import read_runs
from vibroimpact.analysis.estimation.physics import Forcing, Known
from vibroimpact.analysis.operations.estimate_impacts import EstimateImpacts
from vibroimpact.analysis.recording import Channel, Recording, is_recording
from vibroimpact.fmus.errors import UsageError

#: A table among several: `stop[1]`.
_NUMBERED = re.compile(r"(\w+)\[(\d+)\]")


_ABOVE_0 = "a number > 0"
_RULES = {
    **dict.fromkeys(("natural_frequency", "mass"), _ABOVE_0),
    **dict.fromkeys(("forcing_frequency", "angular_frequency", "damping_ratio"), "a number >= 0"),
    **dict.fromkeys(("amplitude", "static_deflection", "phase", "stop", "offset"), "a finite number"),
}
"""Rules of the numbers that a person gives."""


def refuse_numbers(options: EstimateImpacts) -> None:
    """Raise UsageError if numbers break their rules."""
    for name, rule in _RULES.items():
        value = getattr(options, name)
        if value is None:
            continue
        low = -math.inf if rule == "a finite number" else 0.0
        if not (math.isfinite(value) and value >= low) or (value == 0.0 and rule == _ABOVE_0):
            raise UsageError(f"--{name.replace('_', '-')}: expected {rule}, got {value:g}.")


def kind_of(data: Path, *, one_run: bool) -> str:
    """Return the estimation that fits the data: decay, impacts or response; never a response for one run.

    A missing, damaged or foreign file raises DatasetError.
    """
    if is_recording(data):
        return "decay"
    flat = read_runs(data)
    if not one_run and flat.sizes["run"] > 1 and {"angular_frequency", "frequency"} & set(swept_names(flat)):
        return "response"
    return "impacts" if "impact_count" in flat and np.any(flat.impact_count.values > 0) else "decay"


def run_scene(data: Path, run: int | None, recording: Recording) -> dict[str, Any]:
    """Return the scene of one run, swept values in their places; empty for a recording."""
    if not recording.attrs.get("simulated"):
        return {}
    scene = scene_of(recording.attrs)
    refuse_several_forces(scene, "estimate")
    flat = read_runs(data)
    row = 0 if run is None else flat.run_index.values.tolist().index(run)
    for key in scene.get("sweep", {}):
        owner, _, name = str(key).rpartition(".")
        coordinate = next((c for c in (name, file_name_of(str(key))) if c in swept_names(flat)), None)
        table = _table_of(scene, owner)
        if coordinate is not None and table is not None:
            table[name] = float(flat[coordinate].values[row])
    return scene


def _table_of(scene: dict[str, Any], owner: str) -> dict[str, Any] | None:
    """Return the table of a swept key, `body` or `stop[1]`; None where the scene has no such table."""
    numbered = _NUMBERED.fullmatch(owner)
    if numbered is None:
        table = scene.setdefault(owner, {})
    else:
        tables, place = scene.get(numbered[1], []), int(numbered[2]) - 1
        table = tables[place] if isinstance(tables, list) and 0 <= place < len(tables) else None
    return table if isinstance(table, dict) else None


@dataclass(frozen=True, slots=True)
class _Reading:
    """The linear reading of a channel: gain * displacement (m) + zero; a plain displacement has gain 1 and zero 0."""

    gain: float = 1.0
    zero: float = 0.0

    @property
    def turn(self) -> float:
        """Phase by which an inverted channel sees the force, rad."""
        return math.pi if self.gain < 0.0 else 0.0

    def side(self, side: str) -> str:
        """Return the side of a stop as the channel sees it."""
        return side if self.gain > 0.0 else {"upper": "lower", "lower": "upper"}[side]


def _reading_of(channel: Channel, scene: Mapping[str, Any]) -> _Reading:
    if channel.attrs.get("channel") != "sensor.displacement":
        return _Reading()
    sensor = scene.get("sensor", {})
    return _Reading(float(sensor.get("gain", 1.0)), float(sensor.get("offset", 0.0)))


def _falls(scene: Mapping[str, Any]) -> bool:
    """Whether the force of an exciter depends on the displacement."""
    return bool(scene.get("exciter", {}).get("distance", 0.0))


def force_amplitude(scene: Mapping[str, Any]) -> float | None:
    """Return the forcing amplitude of a scene, N (another unit for other kinds); None if it is not one number."""
    amplitude = scene.get("forcing", {}).get("amplitude")
    if _falls(scene) or not isinstance(amplitude, int | float):
        return None
    return float(amplitude * scene.get("exciter", {}).get("gain", 1.0))


def _rest(scene: Mapping[str, Any], reading: _Reading) -> float | None:
    """Return the reading of a channel for a simulated body at rest; None where the static deflection is unknown."""
    force, stiffness = scene.get("exciter", {}).get("offset", 0.0), scene.get("body", {}).get("stiffness")
    if force == 0.0:
        return reading.zero
    if _falls(scene) or not isinstance(stiffness, int | float) or not stiffness > 0:
        return None
    return float(reading.gain * force / stiffness + reading.zero)


def forcing_and_known(
    options: EstimateImpacts, recording: Recording, channel: Channel
) -> tuple[Forcing | None, Known]:
    """Return the force, and the known values of oscillator and stop: from the options, else from the scene.

    The force is None where its frequency or amplitude is 0: a body that bounces under its weight. The scene gives only
    forcing and stop, which an experiment would know too. Stiffness and damping are left to be estimated, unless options
    give them. UsageError: the forcing frequency is unknown, or options contradict each other.
    """
    scene = run_scene(options.data, options.run, recording)
    reading = _reading_of(channel, scene)
    natural = None if options.natural_frequency is None else 2.0 * math.pi * options.natural_frequency
    frequency = _angular_frequency(scene, options)
    forcing = Forcing(
        frequency,
        _static_deflection(scene, options, natural, reading),
        options.phase if options.phase is not None else _scene_phase(scene, reading),
        options.clock_drifts,
    )
    stop = _only_stop(scene)
    position = options.stop
    if position is None and "position" in stop:
        position = reading.gain * stop["position"] + reading.zero
    known = Known(
        damping_ratio=options.damping_ratio,
        natural_frequency=natural,
        stop_position=None if position is None else float(position),
        # The scene says where a simulated body rests; an instrument may read any value there.
        offset=_rest(scene, reading) if options.offset is None and scene else options.offset,
        # An option about another stop leaves the side to the signal.
        side=reading.side(str(stop.get("side", "upper"))) if stop and options.stop is None else None,
    )
    return forcing if frequency > 0.0 else None, known


def side_of_stop(data: Path, run: int | None, recording: Recording, channel: Channel) -> str | None:
    """Return the side of the only stop of a simulated run, as its channel sees it; None where it is not known."""
    scene = run_scene(data, run, recording)
    stop = _only_stop(scene)
    return _reading_of(channel, scene).side(str(stop.get("side", "upper"))) if stop else None


def _only_stop(scene: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the stop of a scene; empty where there are none or several."""
    stops = scene.get("stop", [])
    return stops[0] if isinstance(stops, list) and len(stops) == 1 else {}


def _angular_frequency(scene: Mapping[str, Any], options: EstimateImpacts) -> float:
    if options.forcing_frequency is not None and options.angular_frequency is not None:
        raise UsageError(
            "--forcing-frequency: expected it without --angular-frequency, got both. Leave one out."
        )
    table = scene.get("forcing", {})
    given = options.forcing_frequency is not None or options.angular_frequency is not None
    if not given and "body" in scene and table.get("amplitude", 0.0) == 0.0:
        return 0.0
    for value, factor in (
        (options.angular_frequency, 1.0),
        (options.forcing_frequency, 2.0 * math.pi),
        (table.get("angular_frequency"), 1.0),
        (table.get("frequency"), 2.0 * math.pi),
    ):
        if value is not None:
            return float(value) * factor
    raise UsageError(
        "--forcing-frequency: expected the frequency of the force, got none. Give it in Hz (0 for bounces without a "
        "force that oscillates), or --angular-frequency (rad/s)."
    )


def _scene_phase(scene: Mapping[str, Any], reading: _Reading) -> float | None:
    if "forcing" not in scene:
        return None
    # relative to a base that accelerates forward, the body is pushed backward
    turned = math.pi if scene["forcing"].get("kind") == "base_acceleration" else 0.0
    turned += reading.turn + (math.pi if scene.get("exciter", {}).get("gain", 1.0) < 0.0 else 0.0)
    return float(scene["forcing"].get("phase", 0.0)) + turned


def _static_deflection(
    scene: Mapping[str, Any], options: EstimateImpacts, natural: float | None, reading: _Reading
) -> float | None:
    if options.static_deflection is not None:
        return options.static_deflection
    if options.amplitude is not None:
        if options.mass is None or natural is None:
            raise UsageError(
                "--amplitude: expected --mass and --natural-frequency with it, got not both. "
                "Give them, or --static-deflection."
            )
        return options.amplitude / (options.mass * natural**2)
    amplitude, body = force_amplitude(scene), scene.get("body", {})
    moves_base = scene.get("forcing", {}).get("kind", "force") == "base_acceleration"
    numbers = [amplitude, body.get("stiffness"), *([body.get("mass")] if moves_base else [])]
    known = [float(number) for number in numbers if isinstance(number, int | float)]
    if len(known) < len(numbers) or not known[1] > 0.0:
        return None
    force = known[0] * (known[2] if moves_base else 1.0)
    # a gain below 0 turns the phase, not the amplitude
    sign = -1.0 if scene.get("exciter", {}).get("gain", 1.0) < 0.0 else 1.0
    return sign * force / known[1] * abs(reading.gain)


def cut(channel: Channel, start: float | None, stop: float | None) -> Channel:
    """Return the part of a channel from start to stop (s); clocks stay as they are.

    UsageError: nothing is left.
    """
    if start is None and stop is None:
        return channel
    low = -math.inf if start is None else start
    high = math.inf if stop is None else stop
    part = channel.between(low, high)
    if not len(part.time):
        raise UsageError(
            f"{channel.name}: expected samples from {low:g} to {high:g} s, got none; the channel runs from "
            f"{channel.time[0]:g} to {channel.time[-1]:g} s. Widen --from and --to."
        )
    return part
