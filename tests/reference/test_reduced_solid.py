"""A solid cantilever of 3,000 unknowns that hits a stop: its reduced modes against its unreduced motion."""

from __future__ import annotations

import numpy as np
import pytest
from support.finite_elements import solid
from support.unreduced import tip_motion

import vibroimpact as vi
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.structures.reduction import reduce

CELLS, SIZE, MODES = (4, 4, 40), 0.0025, 16
PERIODS = 3
STEPS = 1500


@pytest.mark.long
def test_a_reduced_solid_has_the_impacts_of_its_unreduced_motion() -> None:
    model = solid(CELLS, SIZE)
    assert len(model.freedoms) == 3000
    tip = {f"{25 * 40 + 12}.x": 1.0}
    first = reduce(model, {"tip": tip}, modes=2).natural[0]
    viscosity = 0.02 / first  # a damping ratio of 1 % in the first mode
    modes = reduce(model, {"tip": tip}, modes=MODES, rayleigh=(0.0, viscosity))
    assert modes.error is not None
    assert modes.error < 1e-2
    static = float(modes.shapes["tip"] ** 2 @ modes.natural**-2.0)
    angular, amplitude, position, contact = 0.9 * first, 100.0, 50.0 * static, 20.0 / static
    end = PERIODS * 2.0 * np.pi / angular
    coarse, fine = (
        tip_motion(
            model,
            model.combination(tip),
            (amplitude, angular),
            (position, contact),
            viscosity,
            end,
            steps,
        )
        for steps in (STEPS, 2 * STEPS)
    )
    scene = Scene.from_dict(
        {
            "body": modes.table(),
            "forcing": {"at": "body.tip", "amplitude": amplitude, "angular_frequency": angular},
            "stop": [{"at": "body.tip", "law": "kelvin_voigt", "position": position, "stiffness": contact}],
            "record": {
                "transient_periods": 0,
                "recorded_periods": PERIODS,
                "observed": ["body.tip"],
                "time_series": {"rate": STEPS / end},
            },
        }
    )
    run = vi.run(scene)
    size = np.abs(fine).max()
    assert (fine > position).sum() > 20
    extrapolated = fine[::2] + (fine[::2] - coarse) / 3.0
    error = float(np.abs(fine[::2] - coarse).max()) / 3.0 / size
    reduced = np.asarray(run["displacement_body_tip"]).ravel()
    off = float(np.abs(reduced - extrapolated[: len(reduced)]).max()) / size
    assert error < 5e-4
    assert off < 1e-4
