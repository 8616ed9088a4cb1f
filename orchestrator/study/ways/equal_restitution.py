"""Contact laws that give a rigid mass the same coefficient of restitution: equations.md 6.9 and 6.10."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from vibroimpact.orchestrator.scene.models import KelvinVoigtStop, Stop

OfLaw = Callable[[Any, float, float], float]
"""Property of a contact with a stop of one law, for a mass (kg) that touches it with a speed (m/s)."""
LEAST_RESTITUTION = 0.01
"""Coefficient of restitution, below which no compliant law stands for another law."""
MOST_RATIO = 100.0
"""Upper bound of the search for the damping ratio of a mass on a Kelvin-Voigt stop."""
NEARLY_ELASTIC = 1e-4
"""1 - e, below which a Hunt-Crossley stop has e = 1 - 2 p / 3: rounding leaves no digits of the whole law."""
LOWEST_SEARCHED = 1e-12
"""Lower bound of the search for the coefficient of restitution e of a Hunt-Crossley stop."""
CLOSEST = 1e-14
"""Relative distance of p e from 1 at the upper bound: a strongly damped Hunt-Crossley stop has e = 1 / p."""
POWER_LAW_TIME = 3.218065
"""Contact time of a Hertz stop over (mass^2 / (stiffness^2 speed))^(1/5)."""


def restitution_at(stop: Stop, mass: float, speed: float) -> float:
    """Return the coefficient of restitution of a rigid mass at a stop; NaN where the law has no known coefficient.

    The mass, kg, touches the stop with the speed, m/s.
    """
    return _RESTITUTIONS[stop.law](stop, mass, speed)


def _restitution_of_kelvin_voigt(stop: KelvinVoigtStop, mass: float, speed: float) -> float:
    if stop.relaxation_time > 0.0:
        return math.nan
    return restitution_of(stop.damping / (2.0 * math.sqrt(stop.stiffness * mass)))


_RESTITUTIONS: dict[str, OfLaw] = {
    "restitution": lambda stop, mass, speed: stop.restitution if stop.yield_velocity == 0.0 else math.nan,
    "kelvin_voigt": _restitution_of_kelvin_voigt,
    "hertz": lambda stop, mass, speed: 1.0,
    "hunt_crossley": lambda stop, mass, speed: restitution_of_product(stop.damping * speed),
}


def laws_of_equal_restitution(
    restitution: float, mass: float, speed: float, duration: float
) -> dict[str, dict[str, Any]]:
    """Return the compliant laws by their names in words, each with the keys of its `[[stop]]`.

    The restitution of the mass, kg, is `LEAST_RESTITUTION` to 1. A Hunt-Crossley stop, whose restitution falls with the
    speed, has it at the given speed, m/s. The duration is the contact time, s; for a power law, the contact time of
    the same stop without damping.
    """
    ratio = damping_ratio_of(restitution)
    rate = _angle(ratio) / duration
    power_law = mass / math.sqrt(speed) * (POWER_LAW_TIME / duration) ** 2.5
    laws: dict[str, dict[str, Any]] = {
        "Kelvin-Voigt": {
            "law": "kelvin_voigt",
            "stiffness": mass * rate**2,
            "damping": 2.0 * ratio * rate * mass,
        }
    }
    if restitution == 1.0:
        laws["Hertz"] = {"law": "hertz", "stiffness": power_law}
    else:
        damping = product_of_restitution(restitution) / speed
        laws["Hunt-Crossley"] = {"law": "hunt_crossley", "stiffness": power_law, "damping": damping}
    return laws


def contact_time(stop: Stop, mass: float, speed: float) -> float:
    """Return the contact time of a rigid mass at a stop, s: without damping for a power law, 0 for a rigid stop."""
    return _CONTACT_TIMES[stop.law](stop, mass, speed)


def _time_of_kelvin_voigt(stop: KelvinVoigtStop, mass: float, speed: float) -> float:
    rate = math.sqrt(stop.stiffness / mass)
    return _angle(stop.damping / (2.0 * mass * rate)) / rate


_CONTACT_TIMES: dict[str, OfLaw] = {
    "restitution": lambda stop, mass, speed: 0.0,
    "kelvin_voigt": _time_of_kelvin_voigt,
    "hertz": lambda stop, mass, speed: _power_law_time(1.5, stop.stiffness, mass, speed),
    "hunt_crossley": lambda stop, mass, speed: _power_law_time(stop.exponent, stop.stiffness, mass, speed),
}


def _power_law_time(exponent: float, stiffness: float, mass: float, speed: float) -> float:
    """Return the contact time of a rigid mass at a stop whose force is a power of the penetration, s."""
    n = 1.0 + exponent
    depth: float = (n * mass * speed**2 / (2.0 * stiffness)) ** (1.0 / n)
    return 2.0 * depth / speed * math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / n) / math.gamma(0.5 + 1.0 / n)


def restitution_of(ratio: float) -> float:
    """Return the coefficient of restitution of a rigid mass on a Kelvin-Voigt stop that never pulls.

    `ratio` is the damping ratio of the mass on the stop, >= 0 (equations.md 6.9).

    Examples
    --------
    >>> [round(restitution_of(ratio), 8) for ratio in (0.1, 0.5, 1.0, 2.0)]
    [0.7440794, 0.29843606, 0.13533528, 0.04776873]
    """
    return math.exp(-ratio * _angle(ratio))


def damping_ratio_of(restitution: float) -> float:
    """Return the damping ratio at which a Kelvin-Voigt stop has a coefficient of restitution.

    >>> round(damping_ratio_of(0.7440794), 6), round(damping_ratio_of(0.04776873), 6)
    (0.1, 2.0)
    """
    from scipy.optimize import brentq

    found: float = brentq(lambda ratio: restitution_of(ratio) - restitution, 0.0, MOST_RATIO, xtol=1e-15)
    return found


def restitution_of_product(product: float) -> float:
    """Return the coefficient of restitution of a Hunt-Crossley stop: p (1 + e) = ln((1 + p) / (1 - p e)).

    The product p is the damping of the stop times the speed (equations.md 6.10).

    Examples
    --------
    >>> round(restitution_of_product(0.2), 9)
    0.882189986
    """
    if product < 1.5 * NEARLY_ELASTIC:
        return 1.0 - 2.0 * product / 3.0
    most = min(1.0, (1.0 - CLOSEST) / product)
    return _root(lambda e: _off(product, e), LOWEST_SEARCHED, most)


def product_of_restitution(restitution: float) -> float:
    """Return the product of damping and speed that gives a Hunt-Crossley stop a coefficient of restitution.

    >>> round(product_of_restitution(0.882189986), 9)
    0.2
    """
    if 1.0 - restitution < NEARLY_ELASTIC:
        return 1.5 * (1.0 - restitution)
    least, most = 0.5 * (1.0 - restitution), (1.0 - CLOSEST) / restitution
    return _root(lambda product: _off(product, restitution), least, most)


def _root(off: Callable[[float], float], least: float, most: float) -> float:
    """Return the root of a rising function from `least` to `most`; `most` where the function is negative there."""
    from scipy.optimize import brentq

    if off(most) < 0.0:
        return most
    found: float = brentq(off, least, most, xtol=1e-15)
    return found


def _off(product: float, restitution: float) -> float:
    return math.log1p(product) - math.log1p(-product * restitution) - product * (1.0 + restitution)


def _angle(ratio: float) -> float:
    """Return contact time times the undamped angular frequency of a mass on a Kelvin-Voigt stop."""
    if ratio < 1.0:
        return 2.0 * math.acos(ratio) / math.sqrt(1.0 - ratio**2)
    if ratio == 1.0:
        return 2.0
    return 2.0 * math.acosh(ratio) / math.sqrt(ratio**2 - 1.0)
