"""The variational impact rule conserves the energy, the thesis's collocation rule does not: equations.md 6.8."""

from __future__ import annotations

import numpy as np
import pytest
from support.modes import collocation as collocation_of
from support.structure import Modes, Stop, Structure

from vibroimpact.fmus.core import beam_modes

IMPACTS = 200
MODES = 4


def energy_after_impacts(*, collocation: bool) -> float:
    """Return the relative energy change of an unforced, undamped clamped-free beam over 200 elastic tip impacts."""
    grid = np.arange(1, MODES + 1) / MODES
    beam = beam_modes("clamped_free", MODES)
    tip = beam.shapes([1.0])[0]
    natural = (beam.eigenvalues / beam.eigenvalues[0]) ** 2
    impulse = collocation_of(beam, grid, MODES - 1) * (tip @ tip) if collocation else None
    stop = Stop(tip, 0.1, restitution=1.0, impulse=impulse)
    with Structure(Modes(natural), [stop], [0.02, 0.0, 0.0, 0.0], [0.2, 0.02, 0.01, 0.0]) as body:
        start = body.energy
        while len(body.impacts) < IMPACTS:
            body.advance(1.0)
        return body.energy / start - 1.0


def test_variational_rule_keeps_the_energy_of_four_modes_over_200_elastic_impacts() -> None:
    assert energy_after_impacts(collocation=False) == pytest.approx(0.0, abs=1e-12)


def test_collocation_rule_does_not() -> None:
    assert abs(energy_after_impacts(collocation=True)) > 0.1
