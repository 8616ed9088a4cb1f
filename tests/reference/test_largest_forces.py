"""Largest forces of contacts against closed forms (equations.md 6.9, 6.10) and DOP853, fused and coupled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import minimize_scalar

import vibroimpact as vi

SPEED = 0.8
AGREEMENT = {"fused": 1e-9, "coupled": 3e-5}
"""Error of a coupled run: 30 steps of a contact resolve a nonlinear force to this part."""


def largest_force(law: str, parameters: dict[str, float], how: str, mass: float = 2.0) -> float:
    """Return the largest force of the single contact of a free mass."""
    scene = {
        "body": {"mass": mass, "stiffness": 0.0, "velocity_start": SPEED},
        "stop": [{"law": law, "position": 0.3, **parameters}],
        "record": {"recorded_time": 2.0},
        "execution": {"how": how},
    }
    run = vi.run(scene, progress=False)
    assert run.sizes["impact"] == 1
    return float(run.impact_peak_force[0])


@pytest.mark.parametrize("how", AGREEMENT)
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.45, 0.5, 0.55, 2.0, 50.0])
def test_a_spring_and_a_dashpot_have_the_force_of_the_closed_form(ratio: float, how: str) -> None:
    mass, stiffness = 2.0, 1e4
    rate = math.sqrt(stiffness / mass)
    damping = 2.0 * ratio * rate * mass
    if ratio >= 0.5:  # the force falls from the touch-down on
        expected = damping * SPEED
    else:
        root = math.sqrt(1.0 - ratio**2)
        # d/dt (k x + c v) = 0 at tan(root w t) = root (1 - 4 ratio^2) / (ratio (3 - 4 ratio^2))
        angle = math.atan2(root * (1.0 - 4.0 * ratio**2), ratio * (3.0 - 4.0 * ratio**2))
        expected = SPEED * math.sqrt(stiffness * mass) * math.exp(-ratio * angle / root)
    found = largest_force("kelvin_voigt", {"stiffness": stiffness, "damping": damping}, how)
    assert found == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("how", AGREEMENT)
def test_a_hertzian_stop_has_the_force_of_its_deepest_penetration(how: str) -> None:
    mass, stiffness = 2.0, 1e6
    deepest = (1.25 * mass * SPEED**2 / stiffness) ** 0.4
    found = largest_force("hertz", {"stiffness": stiffness}, how)
    assert found == pytest.approx(stiffness * deepest**1.5, rel=AGREEMENT[how])


@pytest.mark.parametrize("how", AGREEMENT)
@pytest.mark.parametrize(("damping", "exponent"), [(0.2, 1.5), (0.6, 1.0), (0.4, 2.5)])
def test_a_damped_power_law_has_the_force_of_dop853(damping: float, exponent: float, how: str) -> None:
    mass, stiffness = 2.0, 1e6

    def force(depth: float, rate: float) -> float:
        return float(stiffness * max(depth, 0.0) ** exponent * (1.0 + damping * rate))

    found = solve_ivp(
        lambda _, y: (y[1], -force(*y) / mass),
        (0.0, 0.2),
        (0.0, SPEED),
        method="DOP853",
        rtol=1e-13,
        atol=1e-16,
        dense_output=True,
        max_step=1e-4,
    )
    place = int(np.argmax([force(*y) for y in found.y.T]))
    best = minimize_scalar(
        lambda t: -force(*found.sol(t)),
        bounds=(found.t[place - 1], found.t[place + 1]),
        method="bounded",
        options={"xatol": 1e-12},
    )
    parameters = {"stiffness": stiffness, "damping": damping, "exponent": exponent}
    assert largest_force("hunt_crossley", parameters, how) == pytest.approx(-best.fun, rel=AGREEMENT[how])


SOFT = {
    "kelvin_voigt": {"stiffness": 3e3, "damping": 0.5},
    "hertz": {"stiffness": 3e4},
    "hunt_crossley": {"stiffness": 3e4, "damping": 0.2, "exponent": 1.5},
}
"""Stops on which the light mass swings while the heavy mass presses it there."""


@pytest.mark.parametrize("law", SOFT)
def test_a_contact_of_several_humps_has_the_largest_of_them(law: str) -> None:
    """A light mass meets the stop, and a heavy mass behind it presses it there: dense samples show all humps."""
    scene = {
        "body": {"kind": "chain", "masses": [1.0, 0.05], "stiffnesses": [1.0, 400.0], "dampings": [0.0, 0.5]}
        | {"velocity_start": [1.0, 1.0]},
        "stop": [{"law": law, "position": 0.1, **SOFT[law]}],
        "record": {"recorded_time": 1.0, "time_series": {"rate": 2e5, "variables": ["contact_force"]}},
    }
    run = vi.run(scene, progress=False)
    hits, samples = run.vibroimpact.impacts(), run.vibroimpact.samples()
    time, force = samples["time"].values, samples["contact_force"].values
    humps = []
    for begin, lasts, peak in zip(
        hits.impact_time.values, hits.impact_duration.values, hits.impact_peak_force.values, strict=True
    ):
        own = force[(time >= begin) & (time <= begin + lasts)]
        assert peak == pytest.approx(own.max(), rel=1e-4)
        assert peak >= own.max() * (1.0 - 1e-12)
        humps.append(int(np.sum((own[1:-1] > own[:-2]) & (own[1:-1] > own[2:]))))
    assert max(humps) >= 2
