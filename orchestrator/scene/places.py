"""Where on a body things are: stops, the force, the observed point, with the defaults for what a scene leaves out."""

from __future__ import annotations

from collections.abc import Sequence

from vibroimpact.orchestrator.scene.body_models import BeamBody, ChainBody
from vibroimpact.orchestrator.scene.measuring_models import Sensor
from vibroimpact.orchestrator.scene.models import Forcing, Stop

TIP, MIDDLE = 1.0, 0.5
"""Fractions of the length of a beam."""


def far_end_moves(body: BeamBody) -> bool:
    """Whether the far end of a beam is free."""
    return body.boundary == "clamped-free"


def moves(body: BeamBody, location: float) -> bool:
    """Whether a point of a beam moves: the clamped end and a supported far end do not."""
    return 0.0 < location < 1.0 or (location == TIP and far_end_moves(body))


def stop_mass(body: ChainBody, stop: Stop) -> int:
    """Return the mass (1-based) that a stop limits: as given, or the last."""
    return stop.mass or body.size


def stop_location(stop: Stop) -> float:
    """Return the point of a beam that a stop limits: as given, or the tip."""
    return TIP if stop.location is None else stop.location


def observed_mass(body: ChainBody, stops: Sequence[Stop]) -> int:
    """Return the mass (1-based) whose displacement is recorded: as given, that of stop[1], or the last."""
    return body.observed_mass or (stop_mass(body, stops[0]) if stops else body.size)


def observed_location(body: BeamBody, stops: Sequence[Stop], sensor: Sensor | None) -> float:
    """Return the point of a beam whose displacement is recorded.

    That of `[sensor]`; else the tip of a clamped-free beam; else the point of stop[1], or the middle.
    """
    if sensor is not None and sensor.location is not None:
        return sensor.location
    if far_end_moves(body):
        return TIP
    return stop_location(stops[0]) if stops else MIDDLE


def forcing_location(body: BeamBody, forcing: Forcing | None) -> float:
    """Return the point of a beam that a force acts on: as given, the free tip, or the middle."""
    if forcing is not None and forcing.location is not None:
        return forcing.location
    return TIP if far_end_moves(body) else MIDDLE
