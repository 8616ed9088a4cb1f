"""Laws of equal restitution: each law, simulated alone, has the requested restitution and contact time."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.orchestrator.scene.models import HuntCrossleyStop, KelvinVoigtStop, RestitutionStop
from vibroimpact.orchestrator.study.ways.equal_restitution import (
    LEAST_RESTITUTION,
    contact_time,
    damping_ratio_of,
    laws_of_equal_restitution,
    product_of_restitution,
    restitution_at,
    restitution_of,
    restitution_of_product,
)

RESTITUTIONS = st.floats(LEAST_RESTITUTION, 1.0)


@given(RESTITUTIONS)
def test_laws_and_their_numbers_are_inverse_to_each_other(restitution: float) -> None:
    assert restitution_of(damping_ratio_of(restitution)) == pytest.approx(restitution, rel=1e-12)
    product = product_of_restitution(restitution)
    assert restitution_of_product(product) == pytest.approx(restitution, rel=1e-8)


@settings(deadline=None, max_examples=10)
@given(st.floats(0.05, 1.0), st.floats(1e-3, 1e3), st.floats(1e-2, 10.0), st.floats(1e-4, 1e-2))
def test_a_mass_is_thrown_back_as_asked(
    restitution: float, mass: float, speed: float, duration: float
) -> None:
    for name, law in laws_of_equal_restitution(restitution, mass, speed, duration).items():
        scene = {
            "body": {"mass": mass, "stiffness": 0.0, "displacement_start": -speed, "velocity_start": speed},
            "stop": [{"position": 0.0, **law}],
            "record": {"recorded_time": 2.0},
        }
        impacts = vi.run(scene, progress=False).vibroimpact.impacts()
        assert float(impacts.impact_restitution[0]) == pytest.approx(restitution, rel=1e-6), name
        if name == "Kelvin-Voigt" or restitution == 1.0:
            assert float(impacts.impact_duration[0]) == pytest.approx(duration, rel=1e-6), name


def test_what_a_stop_has_of_its_own() -> None:
    yielding = KelvinVoigtStop(law="kelvin_voigt", position=0.0, stiffness=100.0, damping=2.0)
    assert restitution_at(yielding, 1.0, 0.3) == restitution_of(0.1)
    assert contact_time(yielding, 1.0, 0.3) == pytest.approx(2.0 * math.acos(0.1) / 10.0 / math.sqrt(0.99))
    falling = RestitutionStop(position=0.0, restitution=0.8, yield_velocity=0.1)
    assert math.isnan(restitution_at(falling, 1.0, 0.3))
    assert contact_time(falling, 1.0, 0.3) == 0.0
    linear = HuntCrossleyStop(law="hunt_crossley", position=0.0, stiffness=100.0, exponent=1.0)
    assert contact_time(linear, 1.0, 0.3) == pytest.approx(math.pi / 10.0)
