"""Reduction of matrices to their lowest modes and residual vectors at points: equations.md 6.14."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.checking import checked
from vibroimpact.orchestrator.structures.factors import Flexibility
from vibroimpact.orchestrator.structures.lanczos import Lanczos
from vibroimpact.orchestrator.structures.matrices import Matrices
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.one_thread import on_one_thread
from vibroimpact.orchestrator.structures.request import Weights
from vibroimpact.orchestrator.structures.residual import Rest

MOST_MODES = 64
BAND, MARGIN = 10.0, 2.0
"""Band of `modes = "auto"`: this many times the lowest elastic natural frequency, and the highest one that drives."""
SHARE_OF_HIGHEST = 0.5
"""Band of a given number of modes: this share of the highest natural frequency that is kept."""
SAID = 1e-6
"""Share of the flexibility of a point, above which a remark says that it is left out."""


@on_one_thread()
def reduce(
    matrices: Matrices,
    points: Mapping[str, Weights],
    *,
    modes: int | Literal["auto"] = 20,
    tolerance: float = 1e-3,
    residual: bool = True,
    base: Weights | str | None = None,
    damping_ratio: float | Sequence[float] = 0.0,
    rayleigh: tuple[float, float] = (0.0, 0.0),
    band: float | None = None,
    driven: float = 0.0,
    shown: Sequence[str] = (),
) -> Modes:
    """Return the lowest modes of a structure with residual vectors at points, and the error of its flexibility there.

    Parameters
    ----------
    matrices : Matrices
    points : mapping of str to mapping of str to float
        Weights of the degrees of freedom at each named point.
    modes : int or "auto"
        Number of modes, residual vectors among them, 1 to 64; `"auto"`: the fewest that meet the tolerance.
    tolerance : float
        Largest relative error of the flexibility at the points for `"auto"`.
    residual : bool
        Whether the last modes are residual vectors, at most one for each point.
    base : mapping, str or None
        Motion of the degrees of freedom for 1 m of the base: weights, or the last part of their names, such as `"z"`.
    damping_ratio : float or sequence of float
        One for all modes, or one for each.
    rayleigh : tuple of float
        Damping a M + b K, 1/s and s.
    band : float or None
        Angular frequency up to which the error is taken, rad/s. None: half of the highest natural frequency that is
        kept; for `"auto"` as far as `driven` and the lowest elastic ones ask for (equations.md 6.14).
    driven : float
        Highest angular frequency of what drives the structure, rad/s, for `"auto"`.
    shown : sequence of str
        Further degrees of freedom with shapes, which get no residual vectors.

    Raises
    ------
    UsageError
        The matrices are those of no structure (`checked`), or their factors do not fit into the memory.
        A point or the base is unknown, or no number of modes up to 64 fits.

    Examples
    --------
    >>> from scipy.sparse import csc_array
    >>> chain = Matrices(csc_array([[2.0, -1.0], [-1.0, 1.0]]), csc_array(np.eye(2)), None, ("1.x", "2.x"))
    >>> found = reduce(chain, {"tip": {"2.x": 1.0}}, modes=1, residual=False)
    >>> print(found.natural.round(6), found.shapes["tip"].round(6), round(found.error, 3))
    [0.618034] [0.850651] 0.055
    """
    if modes != "auto" and not 1 <= modes <= MOST_MODES:
        raise UsageError(f"expected 1 to {MOST_MODES} modes, got {modes}.")
    sound, remarks = checked(matrices)
    loads = np.zeros((len(sound.freedoms), len(points)))
    for number, (name, at) in enumerate(points.items()):
        loads[:, number] = _row(sound, matrices, name, at)
    reduction = _Reduction(sound, loads, residual)
    found = reduction.fewest(tolerance, band, driven) if modes == "auto" else reduction.of(modes, band)
    shapes = found.shapes
    participation = None if base is None else shapes.T @ (sound.mass @ _base(sound, base))
    ratios, damping = _damping(found.natural, damping_ratio, rayleigh)
    if sound.damping is not None:
        damping = (0.0 if damping is None else damping) + shapes.T @ (sound.damping @ shapes)
        damping = 0.5 * (damping + damping.T)
    row_of = {name: row for row, name in enumerate(sound.freedoms)}
    seen = {name: shapes[row_of[name]] for name in shown if name in row_of}
    return Modes(
        natural=found.natural,
        damping_ratios=ratios,
        damping=damping,
        shapes=dict(zip(points, loads.T @ shapes, strict=True)) | seen,
        participation=participation,
        residual_vectors=found.vectors,
        error=found.error if points else None,
        remarks=(*remarks, *reduction.remarks, *found.remarks),
        coordinates=matrices.places_of({**points, **{name: {name: 1.0} for name in seen}}),
        masses=matrices.masses(),
        centre=matrices.centre(),
    )


def _row(sound: Matrices, given: Matrices, name: str, at: Weights) -> Floats:
    unused = [each for each in at if each in given.freedoms and each not in sound.freedoms]
    if unused:
        raise UsageError(
            f"expected a degree of freedom with stiffness or mass at {name!r}, got {unused[0]!r}."
        )
    row = sound.combination(at)
    if not np.isfinite(row).all() or not row.any():
        raise UsageError(f"expected finite weights of the point {name!r} that are not all 0, got others.")
    return row


def _base(sound: Matrices, base: Weights | str) -> Floats:
    if not isinstance(base, str):
        return sound.combination(base)
    found = sound.rigid(base)
    if not found.any():
        raise UsageError(f"expected a base direction that some degrees of freedom end in, got {base!r}.")
    return found


def _damping(
    natural: Floats, ratio: float | Sequence[float], rayleigh: tuple[float, float]
) -> tuple[Floats, Floats | None]:
    """Return the damping ratios, and a modal damping matrix where Rayleigh damping acts on rigid-body modes."""
    ratios = np.array(ratio, dtype=np.float64)
    if ratios.ndim and ratios.shape != natural.shape:
        raise UsageError(f"expected a damping ratio for each of {len(natural)} modes, got {len(ratios)}.")
    mass, stiffness = rayleigh
    elastic = np.where(natural > 0.0, natural, 1.0)
    ratios = ratios + np.where(natural > 0.0, 0.5 * (mass / elastic + stiffness * natural), 0.0)
    if mass == 0.0 or (natural > 0.0).all():
        return ratios, None
    return ratios, np.diag(np.where(natural > 0.0, 0.0, mass))


@dataclass(frozen=True, slots=True, eq=False)
class _Found:
    """Modes that are kept: natural angular frequencies, and shapes, shape (freedom, mode)."""

    natural: Floats
    shapes: Floats
    vectors: int
    error: float
    remarks: tuple[str, ...]


def _band(squares: Floats, driven: float) -> tuple[float, str]:
    """Return the angular frequency up to which `modes = "auto"` takes its error, and why."""
    lowest = np.sqrt(squares[:2])
    bands = {
        "ten times the lowest elastic frequency": BAND * float(lowest[:1].max(initial=0.0)),
        "the second elastic frequency": float(lowest[1:].max(initial=0.0)),
        "twice the highest frequency of the forces and stops": MARGIN * driven,
    }
    reason = max(bands, key=lambda each: bands[each])
    return bands[reason], reason


class _Reduction:
    """The modes of a structure as its points see them; `loads` has the shape (freedom, point)."""

    def __init__(self, matrices: Matrices, loads: Floats, residual: bool) -> None:
        self._mass, self._loads, self._residual = matrices.mass, loads, residual
        self._flexibility = Flexibility(matrices)
        self.remarks = self._flexibility.remarks
        self._lanczos = Lanczos(self._flexibility, matrices.mass)
        self._deflections = self._flexibility(loads)
        self._static = np.maximum((loads * self._deflections).sum(axis=0), 0.0)
        self._rigid = self._flexibility.rigid
        inertia = (self._deflections * (self._mass @ self._deflections)).sum(axis=0)
        self._slowest = float((inertia / np.where(self._static > 0.0, self._static, np.inf)).max(initial=0.0))

    def of(self, count: int, band: float | None) -> _Found:
        """Return a number of modes, residual vectors among them."""
        rigid = self._rigid.shape[1]
        vectors = min(self._loads.shape[1], max(count - max(rigid, 1), 0)) if self._residual else 0
        while True:
            squares, shapes = self._lanczos.modes(max(count - rigid - vectors, 0))
            rest, away = self._rest(squares, shapes)
            found = len(rest.vectors()[0]) if self._residual else 0
            if found >= vectors:
                break
            vectors = found  # points that depend on each other leave room for natural modes
        if max(rigid, 1) + found > count or rigid > count:
            raise UsageError(
                f"expected at least {max(rigid, 1) + found} modes ({rigid} of a rigid body, {found} residual vectors, "
                f"1 natural one), got {count}."
            )
        return self._kept(squares, shapes, rest, away, band, count)

    def fewest(self, tolerance: float, band: float | None, driven: float) -> _Found:
        """Return the fewest modes that meet a tolerance."""
        rigid = self._rigid.shape[1]
        most = MOST_MODES - rigid
        squares, shapes = self._lanczos.modes(min(8, most))
        while True:
            highest, reason = (band, "as given") if band is not None else _band(squares, driven)
            end = f"{highest / (2.0 * np.pi):.4g} Hz, {reason}"
            rest, away = self._rest(squares, shapes)
            seen = shapes.T @ self._loads
            for count in range(len(squares) + 1):
                fewer = rest.with_modes(squares[count:], seen[count:])
                vectors = len(fewer.vectors()[0]) if self._residual else 0
                if rigid + count + vectors > MOST_MODES:
                    break
                if rigid + count + vectors and fewer.error(highest, self._residual) <= tolerance:
                    own = away + shapes[:, count:] @ (seen[count:] / squares[count:, None])
                    found = self._kept(squares[:count], shapes[:, :count], fewer, own, highest, None)
                    kept = f"{len(found.natural)} modes meet the tolerance {tolerance:g} up to {end}."
                    return replace(found, remarks=(*found.remarks, kept))
            if len(squares) >= most:
                break
            wider = self._lanczos.modes(min(2 * len(squares), most))
            if len(wider[0]) == len(squares):
                break
            squares, shapes = wider
        raise UsageError(f"expected a tolerance that {MOST_MODES} modes meet up to {end}, got {tolerance:g}.")

    def _rest(self, squares: Floats, shapes: Floats) -> tuple[Rest, Floats]:
        """Return the modes that are left out, and their static deflections under the loads, shape (freedom, point)."""

        def apart(moves: Floats) -> Floats:
            return np.asarray(moves - shapes @ (shapes.T @ (self._mass @ moves)))

        one = apart(apart(self._deflections))
        two = apart(apart(self._flexibility(self._mass @ one)))
        heavy = self._mass @ one, self._mass @ two
        moments = self._loads.T @ one, one.T @ heavy[0], one.T @ heavy[1], two.T @ heavy[1]
        first, second, third, fourth = (0.5 * (each + each.T) for each in moments)
        return Rest((first, second, third, fourth), self._static, self._slowest), one

    def _kept(
        self,
        squares: Floats,
        shapes: Floats,
        rest: Rest,
        away: Floats,
        band: float | None,
        count: int | None,
    ) -> _Found:
        """Return rigid-body modes, natural modes and residual vectors with their error; `away` as of `_rest`."""
        natural = np.concatenate([np.zeros(self._rigid.shape[1]), np.sqrt(squares)])
        highest = SHARE_OF_HIGHEST * natural.max(initial=0.0) if band is None else band
        kept = [self._rigid, shapes]
        vectors = 0
        if self._residual:
            own, weights = rest.vectors()
            vectors = len(own)
            natural = np.concatenate([natural, np.sqrt(own)])
            kept.append(away @ weights)
        error = rest.error(highest, self._residual)
        remarks: tuple[str, ...] = ()
        massless = rest.without_mass()
        if massless > SAID:
            error = max(error, massless)
            remarks += (
                f"{100.0 * massless:.2g} % of the flexibility of a point has no mass, and is left out.",
            )
        if count is not None and len(natural) < count:
            remarks += (f"{len(natural)} of {count} modes are kept: the structure has no more.",)
        return _Found(natural, np.hstack(kept), vectors, error, remarks)
