"""Residual vectors: what the modes that are left out give to points, and the error that remains: equations.md 6.14."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats

DEPENDENT = 1e-10
"""Share of the flexibility of the points, below which a residual vector adds nothing."""
MASSLESS = 1e-24
"""w^-2 of a residual vector over the largest of a point, below which its mass is rounding."""
FREQUENCIES = 33
"""Frequencies of the band at which the error is taken."""


@dataclass(frozen=True, slots=True, eq=False)
class Rest:
    """The modes that are left out, as the points see them.

    Attributes
    ----------
    moments : tuple of 4 ndarrays, shape (point, point)
        Sums of a a' / w^(2k) over the modes left out, k = 1 to 4, with their shapes a at the points.
    flexibility : ndarray, shape (point,)
        Static elastic flexibility of each point by itself by all modes, m/N.
    slowest : float
        Largest mean of w^-2 over the flexibility of a point, s^2.
    """

    moments: tuple[Floats, Floats, Floats, Floats]
    flexibility: Floats
    slowest: float

    def with_modes(self, squares: Floats, shapes: Floats) -> Rest:
        """Return the rest when further modes are left out: w^2, shape (mode,), and shapes at points (mode, point)."""
        powers = [np.einsum("mp,mq,m->pq", shapes, shapes, squares**-k) for k in (1.0, 2.0, 3.0, 4.0)]
        one, two, three, four = (own + more for own, more in zip(self.moments, powers, strict=True))
        return Rest((one, two, three, four), self.flexibility, self.slowest)

    def vectors(self) -> tuple[Floats, Floats]:
        """Return w^2 of the residual vectors, ascending, shape (vector,), and their weights, shape (point, vector).

        A weight is the force at each point, whose static deflection by the rest is the mass-normalised vector.
        """
        return _modes(self.moments[0], self.moments[1], self.flexibility, self._least)

    @property
    def _least(self) -> float:
        return MASSLESS * self.slowest

    def without_mass(self) -> float:
        """Return the largest share of the flexibility of a point that no residual vector has, since it has no mass."""
        kept = _Flexibility.of(self.moments[0], *self.vectors()).at(0.0).diagonal()
        own = np.where(self.flexibility > 0.0, self.flexibility, np.inf)
        return float(((self.moments[0].diagonal() - kept) / own).max(initial=0.0))

    def error(self, angular: float, residual: bool) -> float:
        """Return the error of the flexibility without the rest, or with its residual vectors, up to w in rad/s.

        It is relative to sqrt(f_p f_q) of the static flexibilities of two points. The reference has two residual
        vectors for each point.
        """
        one, two, three, four = self.moments
        if not len(one):
            return 0.0
        wide = np.block([[one, two], [two, three]]), np.block([[two, three], [three, four]])
        # the second vector in units of the first, so that both have a like size
        ratio = np.sqrt(two.diagonal().max() / max(four.diagonal().max(), 1e-300))
        scale = np.repeat([1.0, ratio], len(one))
        wide = wide[0] * np.outer(scale, scale), wide[1] * np.outer(scale, scale)
        sizes = np.concatenate([self.flexibility, np.abs(wide[0].diagonal()[len(one) :])])
        reference = _Flexibility.of(np.vstack([one, two * ratio]), *_modes(*wide, sizes, self._least))
        kept = _Flexibility.of(one, *self.vectors()) if residual else None
        # a point that only rigid-body modes move has no flexibility; the product of two small ones may underflow
        own = np.sqrt(np.where(self.flexibility > 0.0, self.flexibility, np.inf))
        unit = np.outer(own, own)
        worst = 0.0
        for each in np.linspace(0.0, angular, FREQUENCIES) ** 2:
            if each >= reference.lowest or (kept is not None and each >= kept.lowest):
                return float("inf")
            off = reference.at(each) - (0.0 if kept is None else kept.at(each))
            worst = max(worst, float((np.abs(off) / unit).max()))
        return worst


@dataclass(frozen=True, slots=True, eq=False)
class _Flexibility:
    """Flexibility of points by modes: sum of a a' / (w^2 - W^2)."""

    squares: Floats
    shapes: Floats

    @classmethod
    def of(cls, loads: Floats, squares: Floats, weights: Floats) -> _Flexibility:
        return cls(squares, loads.T @ weights)

    @property
    def lowest(self) -> float:
        return float(self.squares.min(initial=np.inf))

    def at(self, square: float) -> Floats:
        return np.asarray((self.shapes / (self.squares - square)) @ self.shapes.T)


def _modes(stiffness: Floats, mass: Floats, sizes: Floats, least: float) -> tuple[Floats, Floats]:
    """Return w^2, up to 1 / `least`, and mass-normalised vectors of a small pair, without dependent motions."""
    unit = 1.0 / np.sqrt(np.where(sizes > 0.0, sizes, 1.0))
    values, ways = np.linalg.eigh(stiffness * np.outer(unit, unit))
    above = values > DEPENDENT
    basis = unit[:, None] * ways[:, above] / np.sqrt(values[above])
    shares, ways = np.linalg.eigh(basis.T @ mass @ basis)
    above = shares > max(1e-14 * shares.max(initial=0.0), least)
    shares, ways = shares[above][::-1], ways[:, above][:, ::-1]
    return 1.0 / shares, basis @ (ways / np.sqrt(shares))
