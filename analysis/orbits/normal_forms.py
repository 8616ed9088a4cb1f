"""Maps that describe impact oscillators near a graze: Nordmark's and the one-dimensional square-root map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.orbits.periodic import OrbitError
from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody

TRANSIENT, KEPT = 4000, 200
"""Number of steps of a map before recording, and number of recorded steps."""


@dataclass(frozen=True, slots=True)
class Nordmark:
    """Nordmark's map of the state at the phase of a graze: equations.md 4.9.

    X <= 0: (X, Y) -> (alpha X + Y + rho, -gamma X); X > 0: (-sign sqrt X + Y + rho, -gamma r^2 X).

    Attributes
    ----------
    alpha, gamma : float
        Trace and determinant of the flow over one period of the force.
    restitution : float
        r.
    sign : float
        Sign of the displacement one period after a push at the graze: +1 or -1.
    """

    alpha: float
    gamma: float
    restitution: float = 1.0
    sign: float = 1.0

    @property
    def oscillator(self) -> tuple[float, float] | None:
        """Damping ratio and frequency ratio (force over natural) of the fastest such oscillator.

        None where no oscillator has this trace and determinant. An underdamped one has alpha = 2 sqrt(gamma) cos; an
        overdamped one has two positive eigenvalues below 1. So -2 sqrt(gamma) <= alpha < 1 + gamma.
        """
        if not (0.0 < self.gamma < 1.0 and -2.0 * math.sqrt(self.gamma) <= self.alpha < 1.0 + self.gamma):
            return None
        decay = -0.5 * math.log(self.gamma)  # times the period
        half = 0.5 * self.alpha / math.sqrt(self.gamma)
        # squared angle that the damped motion turns in a period; negative if overdamped
        turned = math.acos(half) ** 2 if half <= 1.0 else -(math.acosh(half) ** 2)
        natural = math.sqrt(turned + decay**2)
        return decay / natural, 2.0 * math.pi / natural

    def step(self, x: Floats, y: Floats, rho: Floats) -> tuple[Floats, Floats]:
        """Return the next states."""
        hit = x > 0.0
        root = np.sqrt(np.where(hit, x, 0.0))
        return (
            np.where(hit, -self.sign * root, self.alpha * x) + y + rho,
            -self.gamma * np.where(hit, self.restitution**2, 1.0) * x,
        )

    def diagram(self, rho: Floats, kept: int = KEPT, transient: int = TRANSIENT) -> Floats:
        """Return X after a transient at each rho, shape (rho, kept); NaN where it grows without bound.

        It starts with the motion without impacts; beyond the graze it starts at the graze.
        """
        x = np.where(rho < 0.0, rho / (1.0 - self.alpha + self.gamma), 0.0)
        y = -self.gamma * x
        found = np.empty((rho.size, kept))
        with np.errstate(over="ignore", invalid="ignore"):
            for number in range(transient + kept):
                x, y = self.step(x, y, rho)
                if number >= transient:
                    found[:, number - transient] = x
        found[~(np.abs(found) < 1e6)] = np.nan
        return found


@dataclass(frozen=True, slots=True)
class GrazingFamily:
    """Approach of an oscillator to its graze by its forcing amplitude.

    Attributes
    ----------
    map : Nordmark
    amplitude : float
        Forcing amplitude of the graze, N: equations.md 1.8.
    slope : float
        rho over (amplitude / amplitude of the graze - 1).
    """

    map: Nordmark
    amplitude: float
    slope: float

    def rho(self, amplitude: Floats) -> Floats:
        """Return the parameter of the map for a forcing amplitude (N)."""
        return (amplitude / self.amplitude - 1.0) * self.slope

    def amplitude_of(self, rho: Floats) -> Floats:
        """Return the forcing amplitude (N) for a parameter of the map."""
        return self.amplitude * (1.0 + rho / self.slope)


def grazing_family(body: ImpactingBody, amplitude: float) -> GrazingFamily:
    """Return the Nordmark map of a one-mode body at the graze of its forcing amplitude: equations.md 4.9.

    Parameters
    ----------
    body : ImpactingBody
        Its frequency is kept.
    amplitude : float
        Forcing amplitude of the body's force, N.

    Raises
    ------
    OrbitError
        The body has several modes, stops or sines, rests on its stop, or its map is void.
    """
    from scipy.linalg import expm

    natural, decay, toward = one_mode(body)
    contact, w = body.contacts[0], body.angular_frequency
    gap = contact.direction * contact.position - toward * float(body.held[0]) / natural**2
    if not gap > 0.0:
        raise OrbitError("maps: expected a stop that the body at rest does not touch, got one that it does.")
    flow = expm(body.period * np.array([[0.0, 1.0], [-(natural**2), -2.0 * decay]]))
    alpha, gamma, push = float(np.trace(flow)), math.exp(-2.0 * decay * body.period), float(flow[0, 1])
    if abs(push) * natural < 1e-9 * math.sqrt(gamma):
        raise OrbitError(
            f"maps: expected an angular frequency at which the root term is there, got {w:g}: the damped motion makes "
            "whole half turns in a period (codimension 2)."
        )
    size = math.hypot(natural**2 - w**2, 2.0 * decay * w)
    graze = gap * size / abs(toward * float(body.force[0]) / amplitude)
    slope = (1.0 - alpha + gamma) / (2.0 * (w * (1.0 + contact.restitution) * push) ** 2)
    return GrazingFamily(Nordmark(alpha, gamma, contact.restitution, math.copysign(1.0, push)), graze, slope)


def one_mode(body: ImpactingBody) -> tuple[float, float, float]:
    """Return natural frequency, decay rate and the contact's shape along its stop, for one mode and one stop."""
    if body.frequencies.size != 1 or len(body.contacts) != 1:
        raise OrbitError(
            f"maps: expected a body of one mode and one stop, got {body.frequencies.size} and {len(body.contacts)}."
        )
    if not body.has_one_sine:
        raise OrbitError(
            "maps: expected one sine and stops that do not move, got several sines or a moving stop."
        )
    if body.loose:
        raise OrbitError("maps: expected a body on a spring, got one without.")
    contact = body.contacts[0]
    natural = float(body.frequencies[0])
    return natural, float(body.damping_ratios[0]) * natural, contact.direction * float(contact.shape[0])


def square_root_diagram(
    slope: float, offsets: Floats, kept: int = KEPT, transient: int = TRANSIENT, root: float = 1.0
) -> Floats:
    """Return x of the one-dimensional map after a transient at each offset, shape (offset, kept): equations.md 4.10.

    x < d: x -> slope x + root sqrt(d - x); otherwise x -> slope x.

    Parameters
    ----------
    slope : float
        lambda, 0 to 1.
    offsets : array
        d.
    kept, transient : int
    root : float
        s.

    Examples
    --------
    >>> float(square_root_diagram(0.5, np.array([-0.1]))[0, -1])
    0.0
    """
    x = np.zeros_like(offsets)
    found = np.empty((offsets.size, kept))
    for number in range(transient + kept):
        below = x < offsets
        x = slope * x + root * np.sqrt(np.where(below, offsets - x, 0.0))
        if number >= transient:
            found[:, number - transient] = np.where(np.abs(x) < 1e-300, 0.0, x)
    return found


def periods_of(samples: Floats, tolerance: float = 1e-9) -> NDArray[np.int64]:
    """Return the number of steps after which each row repeats; 0 if it does not within half of its samples.

    >>> periods_of(np.array([[1.0, 2.0] * 4])).tolist()
    [2]
    """
    rows, count = samples.shape
    found = np.zeros(rows, np.int64)
    scale = np.maximum(np.abs(samples).max(axis=1), 1e-300)
    for period in range(count // 2, 0, -1):
        distance = np.abs(samples[:, period:] - samples[:, :-period]).max(axis=1)
        found[distance <= tolerance * scale] = period
    return found
