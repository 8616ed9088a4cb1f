"""Reference motions, independent of the package: 40-digit flows (equations.md 1.2, 1.4) and closed-form P(1,1)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpmath import mp, mpf

DIGITS = 90  # 40 are left where the two exponents (almost) coincide


@dataclass(frozen=True)
class Oscillator:
    """mass x'' + damping x' + stiffness x = amplitude cos(phase), and a held acceleration with its slope."""

    mass: float = 1.0
    damping: float = 0.0
    stiffness: float = 1.0
    amplitude: float = 0.0
    angular_frequency: float = 0.0


def _exponents(o: Oscillator) -> tuple[mp.mpc, mp.mpc]:
    decay = mpf(o.damping) / (2 * mpf(o.mass))
    square = decay * decay - mpf(o.stiffness) / mpf(o.mass)
    if abs(square) < mpf(10) ** -60:
        square = mpf(10) ** -60  # two exponents 1e-30 apart have an effect of 1e-60
    root = mp.sqrt(mp.mpc(square))
    return -decay + root, -decay - root


def exact_flow(
    o: Oscillator,
    state: tuple[float, float],
    u: float,
    phase: float = 0.0,
    held: float = 0.0,
    held_rate: float = 0.0,
) -> tuple[mpf, mpf]:
    """Return displacement and velocity after `u` by variation of constants, in 40 digits."""
    with mp.workdps(DIGITS):
        time, start = mpf(u), (mpf(state[0]), mpf(state[1]))
        lam = _exponents(o)
        e = [mp.exp(a * time) for a in lam]
        gap = lam[0] - lam[1]
        first, second = (e[0] - e[1]) / gap, (lam[0] * e[0] - lam[1] * e[1]) / gap
        k, c = mpf(o.stiffness) / mpf(o.mass), mpf(o.damping) / mpf(o.mass)
        x = (second + c * first) * start[0] + first * start[1]
        v = -k * first * start[0] + second * start[1]
        turn, force = mp.mpc(0, o.angular_frequency), mpf(o.amplitude) / mpf(o.mass) * mp.expj(mpf(phase))
        loads: list[tuple[mp.mpc | mp.mpf, Callable[[mp.mpc], mp.mpc]]] = [
            (
                force,
                lambda a: (
                    mp.exp(a * time) * (mp.expm1((turn - a) * time) / (turn - a) if turn != a else time)
                ),
            ),
            (mpf(held), lambda a: mp.expm1(a * time) / a if a else time),
            (mpf(held_rate), lambda a: (mp.expm1(a * time) - a * time) / a**2 if a else time**2 / 2),
        ]
        for load, response in loads:
            if load:
                g = [response(a) for a in lam]
                x += mp.re(load * (g[0] - g[1]) / gap)
                v += mp.re(load * (lam[0] * g[0] - lam[1] * g[1]) / gap)
        return mp.re(x), mp.re(v)


def exact_next_contact(
    o: Oscillator, state: tuple[float, float], position: float, phase: float, near: float
) -> tuple[mpf, mpf]:
    """Return the contact time closest to `near` and the velocity there, by Newton's method in 40 digits."""
    with mp.workdps(DIGITS):
        time = mpf(near)
        for _ in range(60):
            x, v = exact_flow(o, state, time, phase)
            step = (x - mpf(position)) / v
            time -= step
            if abs(step) < mpf(10) ** -38:
                break
        return time, exact_flow(o, state, time, phase)[1]


@dataclass(frozen=True)
class Orbit:
    """P(1,1): impact phase, velocity before impact, and the larger modulus of its two multipliers."""

    phase: float
    velocity: float
    multiplier: float


def period_one_orbits(zeta: float, w: float, force: float, stop: float, r: float) -> list[Orbit]:
    """Return the P(1,1) motions in closed form (equations.md 4.3, 4.4) that stay below the stop in between."""
    period, wd = 2.0 * math.pi / w, math.sqrt(1.0 - zeta * zeta)
    h = math.exp(-zeta * period)
    phi12 = h * math.sin(wd * period) / wd
    phi11 = h * math.cos(wd * period) + zeta * phi12
    d1 = 1.0 - 2.0 * h * math.cos(wd * period) + h * h
    alpha, beta = -(1.0 + r) * phi12 / d1, (1.0 + r) * (phi11 - 1.0) / d1 + (1.0 + r)
    size = (1.0 - w * w) ** 2 + 4.0 * zeta * zeta * w * w
    c, s = force * (1.0 - w * w) / size, 2.0 * zeta * w * force / size
    square = c * c + s * s
    a2, a1, a0 = alpha**2 + ((1.0 - beta) / w) ** 2, -2.0 * stop * alpha, stop * stop - square
    if a1 * a1 < 4.0 * a2 * a0:
        return []
    orbits = []
    for sign in (1.0, -1.0):
        velocity = (-a1 + sign * math.sqrt(a1 * a1 - 4.0 * a2 * a0)) / (2.0 * a2)
        y, slope = stop - alpha * velocity, (1.0 - beta) * velocity / w
        phase = math.atan2(s * y - c * slope, c * y + s * slope) % (2.0 * math.pi)
        if velocity > 0.0 and _stays_below(zeta, w, (c, s), stop, r, phase, velocity):
            trace = (1.0 + r) * phi12 * (force * math.cos(phase) - stop) / velocity
            trace -= 2.0 * r * h * math.cos(wd * period)
            orbits.append(Orbit(phase, velocity, _largest_multiplier(trace, (r * h) ** 2)))
    return orbits


def _largest_multiplier(trace: float, determinant: float) -> float:
    square = trace * trace - 4.0 * determinant
    return (abs(trace) + math.sqrt(square)) / 2.0 if square > 0.0 else math.sqrt(determinant)


def _stays_below(
    zeta: float, w: float, steady: tuple[float, float], stop: float, r: float, phase: float, velocity: float
) -> bool:
    wd, (c, s) = math.sqrt(1.0 - zeta * zeta), steady
    x = stop - c * math.cos(phase) - s * math.sin(phase)
    v = -r * velocity - w * (s * math.cos(phase) - c * math.sin(phase))
    u = np.arange(1, 2000) / 2000 * 2.0 * math.pi / w
    e_sin = np.exp(-zeta * u) * np.sin(wd * u) / wd
    e_cos = np.exp(-zeta * u) * np.cos(wd * u)
    now = (e_cos + zeta * e_sin) * x + e_sin * v
    now += c * np.cos(phase + w * u) + s * np.sin(phase + w * u)
    return bool((now < stop).all())
