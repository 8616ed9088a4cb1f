"""The data of points in lanes, in the form for C (`fmus.core.run_lanes`)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies import ModalPoints
from vibroimpact.fmus.core import lanes as core
from vibroimpact.orchestrator.run.many_points.lanes_samples import sampled_bits
from vibroimpact.orchestrator.run.many_points.loop import PreparedPoints
from vibroimpact.orchestrator.run.parameters import body_points
from vibroimpact.orchestrator.scene.laws import LAWS

Floats = NDArray[np.float64]

DIRECTIONS = {"upper": 1.0, "lower": -1.0}


@dataclass(frozen=True, slots=True)
class LanePoints:
    """Points in the form for C."""

    plan: core.LanesPlan
    modal: ModalPoints
    given: dict[str, Floats]
    """Arrays of `LanesPoints.GIVEN` by name, without `first`."""


def lane_points(points: PreparedPoints) -> LanePoints:
    """Return prepared points in the form for C; points without modes have numbers that C leaves out."""
    scene, columns, count = points.scene, points.columns, len(points.begin)
    modal = body_points(scene, columns).in_state_coordinates()
    stops, record = scene.stops, scene.record
    numbers = range(1, len(stops) + 1)
    none = np.zeros(count)

    def each(name: str, default: Floats) -> Floats:
        rows = [columns.get(f"contact[{k}].{name}", default) for k in numbers]
        return np.stack(rows) if rows else np.empty((0, count))

    given = {
        **{
            name: getattr(modal, name)
            for name in core.LanesPoints.GIVEN
            if getattr(modal, name, None) is not None
        },
        "angular_frequency": columns.get("forcing.angular_frequency", none),
        "phase": columns.get("forcing.phase", none),
        "position": each("position", none),
        "direction": np.repeat(
            [[DIRECTIONS[stop.side]] for stop in stops] or np.empty((0, 1)), count, axis=1
        ),
        "restitution": each("restitution", none),
        "yield_velocity": each("yield_velocity", none),
        "contact_stiffness": each("stiffness", none),
        "contact_damping": each("damping", none),
        "begin": points.begin,
        "end": points.end,
    }
    if not points.forced:  # a force without periods is constant
        given["held"] = modal.held + modal.force * np.cos(given["phase"])
        given["force"] = np.zeros_like(modal.force)
    plan = core.LanesPlan(
        modes=modal.stiffness.shape[0],
        contacts=len(stops),
        impacts=record.impacts,
        extrema=record.extrema,
        periods=points.periods,
        each_period=record.each_period,
        instructions=core.instructions(),
        coupled=modal.coupling is not None,
        further=0 if modal.further_force is None else len(modal.further_force),
        impact_limit=scene.execution.impact_limit,
        yielding=sum(2**number for number, stop in enumerate(stops) if not LAWS[stop.law].is_rigid),
        sampled=sampled_bits(scene.sampled),
        rate=scene.sampling_rate,
    )
    return LanePoints(plan, modal, {name: np.ascontiguousarray(values) for name, values in given.items()})
