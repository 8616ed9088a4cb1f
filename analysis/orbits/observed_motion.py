"""The motion of the observed point of a body between the impacts of an orbit, by the exact flow of its modes."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody


def observed_motion(
    body: ImpactingBody, impacts: Floats, states: Floats, phases: Floats
) -> tuple[Floats, Floats]:
    """Return displacement, m, and velocity, m/s, of the observed point at phases from the first impact on.

    Impacts are at their own phases, rad, and leave the modes in `states`, shape (impact, 2 modes). The drift of a body
    that nothing ties to the ground is left out.
    """
    flight = np.clip(np.searchsorted(impacts, phases, side="right") - 1, 0, impacts.size - 1)
    u = ((phases - impacts[flight]) / body.angular_frequency)[:, None]
    modes = body.frequencies.size
    after = states[flight]
    start = _steady(body, impacts[flight])
    now = _steady(body, phases)
    x, v = after[:, :modes] - start[0], after[:, modes:] - start[1]
    moved, faster = _free(body, u, x, v)
    pushed = np.where(body.frequencies == 0.0, body.held, 0.0)
    moved, faster = moved + 0.5 * pushed * u**2, faster + pushed * u
    whole = np.zeros((2, phases.size))
    for order, amplitude in body.unseen.items():
        turned = amplitude * np.exp(1j * order * phases)
        whole += turned.real, (1j * order * body.angular_frequency * turned).real
    return (moved + now[0]) @ body.observed + whole[0], (faster + now[1]) @ body.observed + whole[1]


def _free(body: ImpactingBody, u: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return displacements and velocities of the modes, free from (x, v) for u seconds, shape (time, mode)."""
    w, z = np.abs(body.frequencies), body.damping_ratios
    if body.coupling is not None:
        loose, w = body.loose, w[body.loose :]
        rates, vectors = body.complex_modes
        parts = np.linalg.solve(vectors, np.concatenate([w * x[:, loose:], v[:, loose:]], axis=1).T)
        later = (vectors @ (parts * np.exp(rates * u).T)).real.T
        moved = np.concatenate([x[:, :loose] + v[:, :loose] * u, later[:, : w.size] / w], axis=1)
        return moved, np.concatenate([v[:, :loose], later[:, w.size :]], axis=1)
    sign, stiffness = np.sign(body.frequencies), body.stiffnesses
    decay, rate = z * w, np.sqrt(np.abs(sign - z**2)) * w
    # exponentials, never a cosh that overflows; the smaller rate from the larger one: equations.md 1.2, 1.9
    is_real = z**2 > sign
    larger = decay + np.copysign(rate, decay)
    fast = np.where(is_real, -larger, -decay - 1j * rate)
    slow = np.where(is_real, -stiffness / np.where(is_real, larger, 1.0), -decay + 1j * rate)
    left, gone = np.exp(slow * u), np.exp(fast * u)
    apart = np.where(rate == 0.0, 1.0, slow - fast)
    c = 0.5 * (left + gone)
    s = np.where(rate == 0.0, u * left, (left - gone) / apart)
    return ((c + decay * s) * x + s * v).real, (-stiffness * s * x + (c - decay * s) * v).real


def _steady(body: ImpactingBody, phases: Floats) -> tuple[Floats, Floats]:
    """Return the steady displacements and velocities of the modes, shape (phase, mode)."""
    moved, faster = np.broadcast_to(body.levels, (phases.size, body.levels.size)), np.zeros(1)
    for order, force in body.harmonics.items():
        if force.any():
            w = order * body.angular_frequency
            turned = body.steady(w, force) * np.exp(1j * order * phases)[:, None]
            moved, faster = moved + turned.real, faster + (1j * w * turned).real
    return moved, faster
