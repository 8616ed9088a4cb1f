"""Bodies with many modes, independent of the package: eigh for chains, textbook shapes in many digits for beams.

Modes are mass-normalised as in equations.md 5 and 6: q'' + damping q' + diag(w^2) q = f, the displacement of a point is
shape . q, and a force at the point gives f = shape * force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
import numpy.typing as npt
from scipy.linalg import eigh, expm

from support import exact_modes
from support.exact_modes import beam_root

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """The modes of a body.

    Attributes
    ----------
    natural : Floats
        Natural angular frequencies, shape (modes,), rad/s.
    damping : Floats
        Modal damping matrix, shape (modes, modes), 1/s; diagonal 2 z w where damping is classical.
    """

    natural: Floats
    damping: Floats

    @property
    def modes(self) -> int:
        return len(self.natural)

    @property
    def generator(self) -> Floats:
        """Matrix A of (q, q')' = A (q, q') without forces, shape (2 modes, 2 modes)."""
        n = self.modes
        return np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(self.natural**2), -self.damping]])


@dataclass(frozen=True)
class Chain(Body):
    """A chain; row i - 1 of `shapes` (masses, modes) is the shape of mass i, in kg^(-1/2)."""

    shapes: Floats


@dataclass(frozen=True)
class Beam(Body):
    """A beam of `mass` kg; `shape(s)` is the shape of the point at the fraction s of its length, in kg^(-1/2)."""

    mass: float
    boundary: str

    def shape(self, s: float) -> Floats:
        columns = [beam_shape(self.boundary, j, s) for j in range(1, self.modes + 1)]
        return np.array(columns) / math.sqrt(self.mass)


def chain_matrix(elements: Sequence[float], far: float = 0.0) -> Floats:
    """Return the matrix of springs, or dashpots, between ground and mass 1, mass 1 and 2, ... (equations.md 5.1)."""
    k = np.append(np.asarray(elements, dtype=float), far)
    return np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1)


def chain(
    masses: Sequence[float],
    stiffnesses: Sequence[float],
    dampings: Sequence[float],
    far_stiffness: float = 0.0,
    far_damping: float = 0.0,
) -> Chain:
    """Return the modes of a chain; its damping may couple them."""
    squares, shapes = eigh(chain_matrix(stiffnesses, far_stiffness), np.diag(np.asarray(masses, dtype=float)))
    modal_damping = shapes.T @ chain_matrix(dampings, far_damping) @ shapes
    return Chain(np.sqrt(np.maximum(squares, 0.0)), modal_damping, shapes)


def oscillator(mass: float, damping: float, stiffness: float) -> Chain:
    """Return one mass as a chain of one."""
    return chain([mass], [stiffness], [damping])


def uniform_chain(n: int, damping: float = 0.1) -> Chain:
    """Return n unit masses with unit springs and equal dashpots."""
    return chain([1.0] * n, [1.0] * n, [damping] * n)


def beam(
    modes: int,
    *,
    flexural_rigidity: float = 1.0,
    mass_per_length: float = 1.0,
    length: float = 1.0,
    damping_ratio: float | Sequence[float] = 0.0,
    boundary: str = "clamped_free",
) -> Beam:
    """Return the first modes of an Euler-Bernoulli beam (equations.md 6.1); its shape functions have norm 1."""
    xi = np.array([float(beam_root(boundary, j)) for j in range(1, modes + 1)])
    natural = xi**2 * math.sqrt(flexural_rigidity / (mass_per_length * length**4))
    ratios = np.broadcast_to(np.asarray(damping_ratio, dtype=float), (modes,))
    return Beam(natural, np.diag(2.0 * ratios * natural), mass_per_length * length, boundary)


@cache
def beam_shape(boundary: str, j: int, s: float, derivative: int = 0) -> float:
    """Return phi_j(s), or a derivative of it, from the textbook's cosh and sinh form in many digits (thesis 7.23)."""
    return float(beam_root(boundary, j) ** derivative * exact_modes.beam_shape(boundary, j, s, derivative))


@dataclass(frozen=True)
class PeriodOneOrbit:
    """A P(1,q) motion: forcing phase and velocity at impact, the state just after it, and its multipliers."""

    phase: float
    velocity: float
    q: Floats
    p: Floats
    multipliers: npt.NDArray[np.complex128]
    physical: bool


def period_one_orbits(
    body: Body,
    contact: Floats,
    force: Floats,
    angular_frequency: float,
    position: float,
    restitution: float,
    periods: int = 1,
) -> list[PeriodOneOrbit]:
    """Return the P(1,q) motions in closed form (equations.md 4.3), in state space: any damping matrix.

    Parameters
    ----------
    contact : Floats
        Shape of the contact point, shape (modes,), kg^(-1/2); the stop is on the upper side.
    force : Floats
        Modal amplitudes of force cos(angular_frequency t), shape (modes,), N kg^(-1/2).

    `physical` says whether the flight stays below the stop over all q periods.
    """
    n, w, r = body.modes, angular_frequency, restitution
    duration = 2.0 * math.pi * periods / w
    over = expm(body.generator * duration)
    impulse = contact / (contact @ contact)
    unit = (1.0 + r) * np.linalg.solve(over - np.eye(2 * n), np.concatenate([np.zeros(n), impulse]))
    alpha, beta = contact @ unit[:n], contact @ unit[n:] + 1.0 + r
    steady = np.linalg.solve(np.diag(body.natural**2 - w**2) + 1j * w * body.damping, force)
    y = complex(contact @ steady)  # the contact moves as Re(y exp(i w t))
    slope = (1.0 - beta) / w
    a2, a1, a0 = alpha**2 + slope**2, -2.0 * position * alpha, position**2 - abs(y) ** 2
    root = a1 * a1 - 4.0 * a2 * a0
    orbits = []
    for sign in (1.0, -1.0) if root >= 0.0 else ():
        velocity = float((-a1 + sign * math.sqrt(root)) / (2.0 * a2))
        # Re(y e^{i theta}) = position - alpha V and Re(i y e^{i theta}) = slope V
        turned = complex(position - alpha * velocity, -slope * velocity)
        phase = float(np.angle(turned / y)) % (2.0 * math.pi)
        rotor = steady * np.exp(1j * phase)
        after = np.concatenate([rotor.real, (1j * w * rotor).real]) + velocity * unit
        # back onto the stop: removes the rounding of the sums above
        after[:n] += impulse * (position - contact @ after[:n])
        clear = velocity > 0.0 and _stays_below(body, contact, rotor, w, velocity * unit, position, duration)
        saltation = _saltation(body, contact, rotor, force, phase, after, velocity, r, w)
        orbits.append(
            PeriodOneOrbit(
                phase, velocity, after[:n], after[n:], np.linalg.eigvals(saltation @ over), bool(clear)
            )
        )
    return orbits


def _saltation(
    body: Body,
    contact: Floats,
    rotor: npt.NDArray[np.complex128],
    force: Floats,
    phase: float,
    after: Floats,
    velocity: float,
    r: float,
    w: float,
) -> Floats:
    """Return the saltation matrix by its general formula R + (f+ - R f-) n' / (n . f-) (equations.md 4.2)."""
    n = body.modes
    jump = np.eye(n) - (1.0 + r) * np.outer(contact, contact) / (contact @ contact)
    reset = np.block([[np.eye(n), np.zeros((n, n))], [np.zeros((n, n)), jump]])
    before = after.copy()
    before[n:] += (1.0 + r) * velocity * contact / (contact @ contact)
    load = np.concatenate([np.zeros(n), force * math.cos(phase)])
    late, early = body.generator @ after + load, body.generator @ before + load
    normal = np.concatenate([contact, np.zeros(n)])
    matrix: Floats = reset + np.outer(late - reset @ early, normal) / (normal @ early)
    return matrix


def _stays_below(
    body: Body,
    contact: Floats,
    rotor: npt.NDArray[np.complex128],
    w: float,
    free: Floats,
    position: float,
    duration: float,
) -> bool:
    """Whether the flight stays below the stop: 400 samples for each period of the fastest mode."""
    rates, vectors = np.linalg.eig(body.generator)
    weights = np.linalg.solve(vectors, free.astype(complex)) * (contact @ vectors[: body.modes])
    count = int(400 * max(1.0, duration * max(w, np.abs(rates).max()) / (2.0 * math.pi)))
    u = np.linspace(0.0, duration, count + 1)
    y = np.real(np.exp(np.outer(u, rates)) @ weights) + np.real(contact @ rotor * np.exp(1j * w * u))
    return bool((y[1:-1] < position).all())
