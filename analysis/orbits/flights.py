"""The motion of the observed point in the free flights between impacts: equations.md 1.2, 1.3, 4.7."""

from __future__ import annotations

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody


def observed_flights(
    body: ImpactingBody, impacts: Floats, states: Floats, phases: Floats
) -> tuple[Floats, Floats]:
    """Return displacement and velocity of the observed point between impacts.

    Parameters
    ----------
    body : ImpactingBody
    impacts : array, shape (p,)
        Forcing phases of the impacts, rad, ascending.
    states : array, shape (p, 2 modes)
        Modal displacements and velocities just after the impacts.
    phases : array
        rad, from the phase of the first impact on.

    Returns
    -------
    tuple of array
        m, m/s.
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
    return (moved + now[0]) @ body.observed, (faster + now[1]) @ body.observed


def _free(body: ImpactingBody, u: Floats, x: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Return displacements and velocities of the modes, free from (x, v) for u seconds, shape (time, mode)."""
    w, z = body.frequencies, body.damping_ratios
    if body.coupling is not None:
        loose, w = body.loose, w[body.loose :]
        rates, vectors = body.complex_modes
        parts = np.linalg.solve(vectors, np.concatenate([w * x[:, loose:], v[:, loose:]], axis=1).T)
        later = (vectors @ (parts * np.exp(rates * u).T)).real.T
        moved = np.concatenate([x[:, :loose] + v[:, :loose] * u, later[:, : w.size] / w], axis=1)
        return moved, np.concatenate([v[:, :loose], later[:, w.size :]], axis=1)
    decay, rate = z * w, np.sqrt(np.abs(1.0 - z**2)) * w
    # exponentials that decay, never a cosh that overflows: equations.md 1.2
    fast = np.where(z > 1.0, -(decay + rate), -decay - 1j * rate)
    slow = np.where(z > 1.0, -(w**2) / np.where(z > 1.0, decay + rate, 1.0), -decay + 1j * rate)
    left, gone = np.exp(slow * u), np.exp(fast * u)
    apart = np.where(rate == 0.0, 1.0, slow - fast)
    c = 0.5 * (left + gone)
    s = np.where(rate == 0.0, u * left, (left - gone) / apart)
    return ((c + decay * s) * x + s * v).real, (-(w**2) * s * x + (c - decay * s) * v).real


def _steady(body: ImpactingBody, phases: Floats) -> tuple[Floats, Floats]:
    """Return the steady displacements and velocities of the modes, shape (phase, mode)."""
    moved, faster = np.broadcast_to(body.levels, (phases.size, body.levels.size)), np.zeros(1)
    for order, force in body.harmonics.items():
        if force.any():
            w = order * body.angular_frequency
            turned = body.steady(w, force) * np.exp(1j * order * phases)[:, None]
            moved, faster = moved + turned.real, faster + (1j * w * turned).real
    return moved, faster
