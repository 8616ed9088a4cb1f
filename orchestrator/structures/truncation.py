"""Fewer modes of given ones, with residual vectors for the modes left out: equations.md 6.14."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.residual import Rest

UNCOUPLED = 1e-12
"""Damping between two modes over sqrt(d_ii d_jj), below which it is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class Truncation:
    """Fewer modes of a structure.

    Attributes
    ----------
    modes : Modes
    weights : ndarray, shape (given mode, kept mode)
        Orthonormal: each kept mode as a sum of given ones.
    """

    modes: Modes
    weights: Floats


def truncated(modes: Modes, points: Collection[str], count: int, *, residual: bool) -> Truncation | None:
    """Return the lowest modes of given ones, with or without residual vectors at points.

    Modes with residual vectors have the sums of a a' / w^2 and a a' / w^4 of the whole structure. So fewer of them
    have the residual vectors of the whole structure, too.

    Parameters
    ----------
    modes : Modes
    points : collection of str
        Points of the residual vectors, which have shapes.
    count : int
        Number of modes, residual vectors among them. Without residual vectors there are no more than natural modes.
    residual : bool
        Whether the last modes are residual vectors, at most one for each point.

    Returns
    -------
    Truncation or None
        All modes where there are no more than the count. None where the count leaves no room for rigid-body modes, one
        natural mode, and the residual vectors.

    Examples
    --------
    >>> given = Modes(np.array([1.0, 2.0, 4.0]), np.full(3, 0.1), None, {"tip": np.ones(3)})
    >>> found = truncated(given, ["tip"], 2, residual=True).modes
    >>> found.natural.round(6), found.shapes["tip"].round(6)
    (array([1.      , 2.169305]), array([1.      , 1.212678]))
    """
    size, natural = len(modes.natural), len(modes.natural) - modes.residual_vectors
    if count >= size and (residual or natural == size):
        return Truncation(modes, np.eye(size))
    rigid = int((modes.natural == 0.0).sum())
    least = max(rigid, 1)
    loads = np.array([modes.shapes[name] for name in points]).reshape(-1, size)
    vectors = min(len(loads), max(count - least, 0)) if residual else 0
    while True:
        kept = min(count - vectors, natural)
        own, weights = _residual_vectors(
            modes.natural, loads[:0] if not residual or kept < rigid else loads, kept
        )
        if len(own) >= vectors:
            break
        vectors = len(own)  # points that depend on each other leave room for natural modes
    if kept < least or kept + len(own) > count:
        return None
    together = np.hstack([np.eye(size)[:, :kept], np.zeros((size, len(own)))])
    together[kept:, kept:] = weights
    found = _in_kept(modes, np.concatenate([modes.natural[:kept], np.sqrt(own)]), together)
    return Truncation(replace(found, residual_vectors=len(own)), together)


def _residual_vectors(natural: Floats, loads: Floats, kept: int) -> tuple[Floats, Floats]:
    """Return w^2 of the residual vectors, and their weights of the modes left out, shape (mode left out, vector)."""
    squares, left_out = natural[kept:] ** 2, loads[:, kept:]
    if not len(squares) or not len(loads):
        return np.zeros(0), np.zeros((len(squares), 0))
    elastic = natural > 0.0
    inverse = np.where(elastic, 1.0 / np.where(elastic, natural, 1.0) ** 2, 0.0)
    flexibility, inertia = loads**2 @ inverse, loads**2 @ inverse**2
    slowest = float((inertia / np.where(flexibility > 0.0, flexibility, np.inf)).max(initial=0.0))
    nothing = np.zeros((len(loads), len(loads)))
    rest = Rest((nothing, nothing, nothing, nothing), flexibility, slowest)
    own, weights = rest.with_modes(squares, left_out.T).vectors()
    return own, (left_out.T / squares[:, None]) @ weights


def _in_kept(modes: Modes, natural: Floats, weights: Floats) -> Modes:
    """Return modes with shapes, participation and damping in the kept modes; one ratio of all modes stays one."""
    ratios, damping = np.full(len(natural), modes.damping_ratios[0]), modes.damping
    if damping is not None or (modes.damping_ratios != modes.damping_ratios[0]).any():
        whole = np.diag(2.0 * modes.damping_ratios * modes.natural) + (0.0 if damping is None else damping)
        damping = weights.T @ whole @ weights
        ratios = np.zeros(len(natural))
        own = np.sqrt(np.abs(damping.diagonal()))
        if (np.abs(damping) <= UNCOUPLED * np.outer(own, own))[~np.eye(len(own), dtype=bool)].all():
            damping = np.diag(damping.diagonal())
    return replace(
        modes,
        natural=natural,
        damping_ratios=ratios,
        damping=damping,
        shapes={name: shape @ weights for name, shape in modes.shapes.items()},
        participation=None if modes.participation is None else modes.participation @ weights,
    )
