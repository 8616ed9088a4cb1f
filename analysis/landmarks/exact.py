"""Closed-form landmarks of the impact oscillator: grazing, period doubling and fold of the P(1,1) motion.

The system is one mass with spring and dashpot under a harmonic force, with an impulsive stop of constant restitution.
Units are the natural frequency wn = sqrt(k/m) and one unit of length. The drive has frequency w, the force over
stiffness is F, and zeta is the damping ratio. The stop is at a > 0 with restitution r. T = 2 pi/w, H = exp(-zeta T),
V is the impact velocity, theta the forcing phase at impact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from vibroimpact.analysis.dataset.clock import refuse_several_forces
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.safe_toml import parse_toml

Floats = npt.NDArray[np.float64]

# Points of the scan that separates the roots of a locus, and samples per flight in the penetration test.
_SCAN_POINTS = 4001
_FLIGHT_SAMPLES = 4001


_RETURNS = 1e-8
"""Value of |sin(pi / w)| below which an undamped oscillator returns to its state after one forcing period."""


@dataclass(frozen=True, slots=True)
class ImpactOscillator:
    """A harmonically forced oscillator with one impulsive stop, in consistent units.

    Attributes
    ----------
    mass, damping, stiffness : float
        kg, N s/m, N/m.
    amplitude : float
        Amplitude of the force, N.
    stop_position : float
        Distance from rest to the stop, > 0, m.
    restitution : float
        Coefficient of restitution, 0 to 1.
    """

    mass: float
    damping: float
    stiffness: float
    amplitude: float
    stop_position: float
    restitution: float

    @property
    def natural_frequency(self) -> float:
        """Undamped angular natural frequency, rad/s."""
        return math.sqrt(self.stiffness / self.mass)

    @property
    def damping_ratio(self) -> float:
        """Damping over critical damping."""
        return self.damping / (2 * math.sqrt(self.stiffness * self.mass))

    @property
    def force(self) -> float:
        """Static deflection under the force amplitude, m."""
        return self.amplitude / self.stiffness

    def single_impact_motions(self, angular_frequency: float) -> tuple[tuple[float, float], ...]:
        """Return the motions of one impact in each forcing period, P(1,1): thesis eqs. 2.48-2.66, equations.md 4.3.

        Parameters
        ----------
        angular_frequency : float
            Angular frequency of the force, rad/s.

        Returns
        -------
        tuple of (float, float)
            Impact velocity (m/s) and forcing phase at impact (rad, from 0 to 2 pi) of each motion, stable or not. A
            motion that passes the stop between two impacts is left out. Empty for an undamped oscillator that returns
            to any state after one period: its motions are not isolated, and have no closed form.

        Examples
        --------
        >>> (motion,) = ImpactOscillator(1.0, 0.08, 1.0, 0.45, 0.8, 0.75).single_impact_motions(1.1)
        >>> print("%.14f %.14f" % motion)
        0.95248614777472 0.21056066189221
        """
        w, a, zeta = angular_frequency / self.natural_frequency, self.stop_position, self.damping_ratio
        if zeta == 0.0 and abs(math.sin(math.pi / w)) < _RETURNS:
            return ()
        alpha, after = (float(value) for value in _homogeneous(self, w))
        slope = -(after + self.restitution) / w
        steady = self.force / complex(1.0 - w**2, 2.0 * zeta * w)
        c, s = steady.real, -steady.imag
        roots = np.roots([alpha**2 + slope**2, -2.0 * a * alpha, a**2 - abs(steady) ** 2])
        found = []
        for velocity in sorted(float(root.real) for root in roots if root.imag == 0.0 and root.real > 0.0):
            y, v = a - alpha * velocity, slope * velocity
            theta = math.atan2(s * y - c * v, c * y + s * v)
            if _stays_below(self, w, velocity, theta):
                found.append((velocity * self.natural_frequency, theta % (2.0 * math.pi)))
        return tuple(found)

    @classmethod
    def from_scene(cls, text: str) -> ImpactOscillator:
        """Read the parameters from the text of a scene.

        Raises
        ------
        DatasetError
            If the scene is not an oscillator with one impulsive stop in front of it.
        """
        scene = parse_toml(text)
        refuse_several_forces(scene, "scene")
        stops = scene.get("stop", [])
        body = scene.get("body")
        kind = body.get("kind", "oscillator") if isinstance(body, dict) else "none"
        if kind != "oscillator" or len(stops) != 1 or "forcing" not in scene:
            raise DatasetError(
                "scene: expected a forced oscillator with one stop, got another scene. "
                "Exact landmarks are known for that one only."
            )
        body, stop = scene["body"], stops[0]
        if stop.get("law", "restitution") != "restitution":
            raise DatasetError(
                f"scene: expected an impulsive stop at a positive distance, got law {stop['law']!r}."
            )
        sign = -1.0 if stop.get("side", "upper") == "lower" else 1.0
        if float(body["stiffness"]) <= 0.0:
            raise DatasetError(f"scene: expected stiffness > 0, got {body['stiffness']}.")
        oscillator = cls(
            mass=float(body["mass"]),
            damping=_damping(body),
            stiffness=float(body["stiffness"]),
            amplitude=abs(float(scene["forcing"]["amplitude"])),
            stop_position=sign * float(stop["position"]),
            restitution=float(stop["restitution"]),
        )
        if oscillator.damping_ratio >= 1:
            raise DatasetError(f"scene: expected damping_ratio < 1, got {oscillator.damping_ratio}.")
        if oscillator.stop_position <= 0:
            raise DatasetError(
                "scene: expected an impulsive stop at a positive distance, "
                f"got distance {oscillator.stop_position}."
            )
        return oscillator


def _damping(body: dict[str, Any]) -> float:
    """Return the damping of a body table, N s/m."""
    if "damping_ratio" in body:
        return 2 * float(body["damping_ratio"]) * math.sqrt(float(body["stiffness"]) * float(body["mass"]))
    return float(body.get("damping", 0.0))


@dataclass(frozen=True, slots=True)
class StabilityLimit:
    """Stability limit of P(1,1): angular frequency (rad/s), impact velocity (m/s), impact phase (rad)."""

    angular_frequency: float
    impact_velocity: float
    impact_phase: float


def grazing_frequencies(oscillator: ImpactOscillator) -> tuple[float, ...]:
    """Return the angular frequencies at which the steady motion just touches the stop, ascending, rad/s.

    Steady amplitude = stop distance (thesis eqs. 2.32, 2.33): two, one (strong force) or no frequency (weak force).

    Examples
    --------
    >>> oscillator = ImpactOscillator(1.0, 0.08, 1.0, 0.3, 0.8, 0.75)
    >>> [round(w, 12) for w in grazing_frequencies(oscillator)]
    [0.79398912032, 1.167553543446]
    """
    middle = 1 - 2 * oscillator.damping_ratio**2
    rest = 1 - (oscillator.force / oscillator.stop_position) ** 2
    if middle**2 < rest:
        return ()
    upper = middle + math.sqrt(middle**2 - rest)
    # The difference in the quadratic formula cancels as F -> a; the product of the roots does not.
    squares = (rest / upper, upper) if upper > 0 else (rest,)
    return tuple(oscillator.natural_frequency * math.sqrt(square) for square in squares if square > 0)


def period_doublings(oscillator: ImpactOscillator, low: float, high: float) -> list[StabilityLimit]:
    """Return the period doublings of P(1,1) (multiplier -1) between two angular frequencies, ascending.

    Parameters
    ----------
    oscillator : ImpactOscillator
    low, high : float
        Angular frequencies, rad/s.

    Examples
    --------
    >>> oscillator = ImpactOscillator(1.0, 0.08, 1.0, 0.450214238658253, 0.8, 0.75)
    >>> [round(limit.angular_frequency, 9) for limit in period_doublings(oscillator, 0.85, 0.92)]
    [0.88]
    """
    return _limits(oscillator, low, high, sigma=-1.0)


def folds(oscillator: ImpactOscillator, low: float, high: float) -> list[StabilityLimit]:
    """Return the folds of P(1,1) (multiplier +1, saddle-node); parameters as for `period_doublings`."""
    return _limits(oscillator, low, high, sigma=1.0)


def _limits(oscillator: ImpactOscillator, low: float, high: float, sigma: float) -> list[StabilityLimit]:
    """Return the frequencies where the locus of a multiplier sigma crosses the force; physical orbits only."""
    scale = oscillator.natural_frequency

    def excess(w: Any) -> Any:
        return np.hypot(*_locus(oscillator, w, sigma)[1:]) - oscillator.force

    limits = []
    for w in _roots(excess, np.linspace(low / scale, high / scale, _SCAN_POINTS)):
        velocity, cosine, sine = (float(value) for value in _locus(oscillator, np.float64(w), sigma))
        theta = math.atan2(sine, cosine) % (2 * math.pi)
        if velocity > 0 and _stays_below(oscillator, w, velocity, theta):
            limits.append(StabilityLimit(w * scale, velocity * scale, theta))
    return limits


def _roots(function: Callable[[Any], Any], grid: Floats) -> list[float]:
    """Return the roots of a function between grid points; a change of sign through a pole is not a root."""
    from scipy.optimize import brentq

    values = function(grid)
    roots = []
    for k in np.flatnonzero(values[:-1] * values[1:] <= 0):
        root = float(brentq(function, grid[k], grid[k + 1], xtol=1e-15, rtol=1e-15))
        if abs(function(root)) < 1e-6 * max(1.0, abs(values[k])):
            roots.append(root)
    return roots


def _flight(zeta: float, u: Any) -> tuple[Any, Any]:
    """Return Phi12 and Phi11 of the free flow over u (thesis eqs. 2.12-2.17), underdamped."""
    damped = math.sqrt(1 - zeta**2)
    sine = np.exp(-zeta * u) * np.sin(damped * u) / damped
    return sine, np.exp(-zeta * u) * np.cos(damped * u) + zeta * sine


def _homogeneous(oscillator: ImpactOscillator, w: Any) -> tuple[Any, Any]:
    """Return alpha and the homogeneous velocity after impact, both per unit of V, of the P(1,1) motion."""
    zeta, r = oscillator.damping_ratio, oscillator.restitution
    period = 2 * math.pi / w
    phi12, phi11 = _flight(zeta, period)
    decay = np.exp(-zeta * period)
    determinant = 1 - 2 * decay * np.cos(math.sqrt(1 - zeta**2) * period) + decay**2
    return -(1 + r) * phi12 / determinant, (1 + r) * (phi11 - 1) / determinant


def _locus(oscillator: ImpactOscillator, w: Any, sigma: float) -> tuple[Any, Any, Any]:
    """Return V, F cos theta and F sin theta of the P(1,1) motion with a multiplier sigma at w.

    The solution is explicit for given w: tr = sigma (1 + det) is linear in V (thesis eqs. 2.67-2.69, 3.2).
    """
    zeta, r, a = oscillator.damping_ratio, oscillator.restitution, oscillator.stop_position
    period = 2 * math.pi / w
    decay = np.exp(-zeta * period)
    phi12, _ = _flight(zeta, period)
    alpha, after = _homogeneous(oscillator, w)
    beta = after + 1 + r
    cosine = np.cos(math.sqrt(1 - zeta**2) * period)
    kappa = (sigma * (1 + (r * decay) ** 2) + 2 * r * decay * cosine) / ((1 + r) * phi12)
    velocity = -(w**2) * a / (kappa + (1 - w**2) * alpha - 2 * zeta * (1 - beta))
    in_phase = a + kappa * velocity
    quadrature = 2 * zeta * w * (a - alpha * velocity) - (1 - w**2) * (1 - beta) * velocity / w
    return velocity, in_phase, quadrature


def _stays_below(oscillator: ImpactOscillator, w: float, velocity: float, theta: float) -> bool:
    """Tell whether the flight between two impacts stays below the stop, certified by a bound on acceleration.

    At both ends the flight leaves the stop with a known speed. In between, the largest sample plus the largest
    possible rise between two samples must stay below the stop.
    """
    zeta, a = oscillator.damping_ratio, oscillator.stop_position
    period = 2 * math.pi / w
    alpha, after = _homogeneous(oscillator, w)
    transfer = oscillator.force / complex(1 - w**2, 2 * zeta * w)
    bound = abs(transfer) * w**2 + velocity * math.hypot(
        alpha, (after + zeta * alpha) / math.sqrt(1 - zeta**2)
    )
    start, end = oscillator.restitution * velocity / bound, period - velocity / bound
    u = np.linspace(start, end, _FLIGHT_SAMPLES)
    phi12, phi11 = _flight(zeta, u)
    displacement = velocity * (phi11 * alpha + phi12 * after) + np.real(
        transfer * np.exp(1j * (theta + w * u))
    )
    return bool(displacement.max() + bound * (u[1] - u[0]) ** 2 / 8 < a)
