"""Bodies that nothing ties to the ground: the motion of the whole, which no contact sees, and the rest of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats, ImpactingBody
from vibroimpact.fmus.errors import UsageError

UNSEEN = 1e-9
"""Displacement of all contacts by a motion without springs, over the largest, below which no contact sees it."""


def without_drift(body: ImpactingBody, velocities: Floats) -> ImpactingBody:
    """Return a body without the motions that no spring and no contact holds; they are kept as its drift.

    Parameters
    ----------
    body : ImpactingBody
        Mass-normalised modes, those without a spring first.
    velocities : array, shape (modes,)
        Modal velocities at the start, kg^(1/2) m/s: they decide how fast the whole body drifts.

    Returns
    -------
    ImpactingBody
        The same body where contacts see all its motions.

    Raises
    ------
    UsageError
        A constant force accelerates the whole body.
    """
    loose = body.loose
    shapes = np.array([contact.shape for contact in body.contacts])[:, :loose]
    _, sizes, turned = np.linalg.svd(shapes, full_matrices=True)
    seen = int(np.count_nonzero(sizes > UNSEEN * sizes.max(initial=0.0)))
    if seen == loose:
        return body
    unseen = turned[seen:]

    sprung = body.frequencies.size - loose
    keeping = np.block(
        [[turned[:seen], np.zeros((seen, sprung))], [np.zeros((sprung, loose)), np.eye(sprung)]]
    )
    if np.abs(unseen @ body.held[:loose]).max() > UNSEEN * np.abs(body.held).max():
        raise UsageError(
            "orbit: expected no constant force on a body that nothing ties to the ground, got one that "
            "accelerates it."
        )
    answers = {
        order: -complex(unseen @ body.observed[:loose] @ (unseen @ force[:loose]))
        / (order * body.angular_frequency) ** 2
        for order, force in body.harmonics.items()
    }
    # velocity at the start, less that of the answer to the force
    swing = sum(
        (1j * order * body.angular_frequency * each * np.exp(1j * order * body.phase)).real
        for order, each in answers.items()
    )
    speed = float(unseen @ body.observed[:loose] @ (unseen @ velocities[:loose])) - float(swing)
    seen_body = _turned(body, keeping, np.append(np.zeros(seen), body.frequencies[loose:]))
    return replace(seen_body, drift=speed, unseen=answers)


def loose_first(body: ImpactingBody, order: NDArray[np.intp]) -> ImpactingBody:
    """Return a body with its modes in another order, which puts those without a spring before negative springs."""
    if (order == np.arange(order.size)).all():
        return body
    return _turned(body, np.eye(order.size)[order], body.frequencies[order])


def _turned(body: ImpactingBody, matrix: Floats, frequencies: Floats) -> ImpactingBody:
    """Return a body in other modes: orthonormal rows of the present ones, those without a spring among themselves."""
    return replace(
        body,
        frequencies=frequencies,
        damping_ratios=np.abs(matrix) @ body.damping_ratios,
        force=matrix @ body.force,
        held=matrix @ body.held,
        contacts=tuple(replace(contact, shape=matrix @ contact.shape) for contact in body.contacts),
        observed=matrix @ body.observed,
        coupling=None if body.coupling is None else matrix @ body.coupling @ matrix.T,
        further={order: matrix @ force for order, force in body.further.items()},
    )
