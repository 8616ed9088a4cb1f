"""The recorded largest force of a contact: no sample exceeds it, and dense samples come near it."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from support.random_structures import COMPLIANT, MOST_IMPACTS, POWER, Scene, scenes

FEW = settings(max_examples=25, derandomize=True, suppress_health_check=list(HealthCheck))

STEPS = 1000
"""Number of samples of a run."""
DENSE = 40
"""Samples of a contact above which their second differences bound the largest force."""
ROUNDING = 1e-9
"""Relative error of a force: a power law is solved to 1e-10 in each segment."""


@FEW
@given(scenes(COMPLIANT, most_stops=1, most_modes=5))
def test_no_sample_is_above_the_largest_force_and_it_is_not_far_above_dense_ones(scene: Scene) -> None:
    instants = np.linspace(0.0, scene.duration, STEPS + 1)[1:]
    forces = []
    with scene.body() as body:
        for time in instants:
            body.advance(time - body.time, most_impacts=MOST_IMPACTS)
            assume(len(body.impacts) < MOST_IMPACTS)
            forces.append(body.forces[0])
        impacts, peaks = body.impacts, body.peaks
    assert impacts[:, 1].tolist() == peaks[:, 1].tolist()
    force, (stop,) = np.array(forces), scene.stops
    for (begin, velocity, duration), peak in zip(impacts[:, [1, 3, 7]], peaks[:, 3], strict=True):
        inside = np.flatnonzero((instants >= begin) & (instants <= begin + duration))
        sampled = np.max(force[inside], initial=0.0)
        assert sampled <= peak * (1.0 + ROUNDING)
        if len(inside) >= DENSE:
            dashpot = 0.0 if stop.law in POWER else stop.damping * velocity
            bend = np.abs(np.diff(force[inside], 2)).max()
            assert peak <= max(sampled, dashpot * (1.0 + ROUNDING)) + bend
