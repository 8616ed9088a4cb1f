"""Changes of a scene's document that each remove one part of its measuring chain."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.run.summary import chain_effects
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS, LOAD_CELL, MEASURED_SENSOR

Change = Callable[[dict[str, Any]], None]


def measuring_changes(scene: Scene) -> Iterator[tuple[str, str, Change]]:
    """Yield the name, the key and the removal of each part of a chain that only measures the motion.

    The exciter is none of these parts: it pushes the body, and belongs to the forcing.
    """
    changes: dict[str, Change] = {
        "sensor": _without_sensor,
        "load cell": _without_load_cell,
        "noise": _without_noise,
        "AD conversion": _without_daq,
    }
    for name, keys in chain_effects(scene).items():
        if keys and name in changes and scene.replay is None:
            yield name, keys[0], changes[name]


def motion_alone(scene: Scene) -> Scene:
    """Return a scene with the same motion and without the measuring chain: its forcing is in N.

    The scene has no sweep. UsageError: the force of its exciter falls with the distance, or has a constant part.
    """
    document = parse_toml(scene.text)
    if not any(name in document for name in CHAIN_TABLES):
        return scene
    exciter = scene.exciter
    if exciter is not None:
        if exciter.distance or exciter.offset:
            raise UsageError(
                f"{scene.source}: exciter: expected a force that is the forcing alone, got one with "
                f"{'a distance' if exciter.distance else 'an offset'}. Other ways than the fused one have no exciter."
            )
        if scene.forcing is not None:
            document["forcing"]["amplitude"] = exciter.gain * scene.forcing.scalar_amplitude
    _without_channels(document, CHANNELS)
    for name in CHAIN_TABLES:
        document.pop(name, None)
    document.get("sensor", {}).pop("range", None)
    return Scene.from_dict(document, scene.source)


def _without_channels(document: dict[str, Any], names: tuple[str, ...]) -> None:
    record = document.get("record", {})
    series = record.get("time_series")
    if series is None:
        return
    left = [name for name in series["variables"] if name not in names]
    if not left:
        del record["time_series"]
        return
    series["variables"] = left
    if "daq" in document and not any(name in CHANNELS for name in left):
        series["rate"] = document["daq"]["rate"]


def _without_sensor(document: dict[str, Any]) -> None:
    for name in ("gain", "offset", "range"):
        document["sensor"].pop(name, None)
    document.get("noise", {}).pop("sensor", None)
    _without_channels(document, tuple(MEASURED_SENSOR))


def _without_load_cell(document: dict[str, Any]) -> None:
    del document["load_cell"]
    document.get("noise", {}).pop("load_cell", None)
    _without_channels(document, (LOAD_CELL,))


def _without_noise(document: dict[str, Any]) -> None:
    del document["noise"]


def _without_daq(document: dict[str, Any]) -> None:
    rate = document.pop("daq")["rate"]
    series = document.get("record", {}).get("time_series")
    if series is not None:
        series.setdefault("rate", rate)
