"""The modes that a body by matrices asks for: its files, its points, and how many modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Weights = Mapping[str, float]
"""Weights of degrees of freedom by name."""


@dataclass(frozen=True, slots=True)
class Request:
    """The keys of a body by matrices.

    Attributes
    ----------
    stiffness, mass, damping : str or None
        Files, or the names of the matrices within `file`; no damping matrix for None.
    file : Path or None
        A file that holds all matrices.
    freedoms : Path or None
        The table of the degrees of freedom; None where the matrices name them.
    folder : Path
        The folder that the names of files begin at.
    points : mapping of str to mapping of str to float
        Weights of the degrees of freedom at each named point.
    named : tuple of str
        Further points, which may be names of degrees of freedom.
    modes : int or "auto"
        How many modes, residual vectors among them.
    tolerance : float
        Largest error of the flexibility at the points for `"auto"`.
    driven : float
        Highest angular frequency of what drives the body, rad/s, for `"auto"`.
    residual : bool
        Whether residual vectors of the points are among the modes.
    base : mapping, str or None
        Motion of the degrees of freedom for 1 m of the base: weights, or a direction such as `"z"`.
    damping_ratio : float or tuple of float
    rayleigh : tuple of float
        Factors of the mass, 1/s, and of the stiffness, s, in the damping ratios.
    shown : int
        Largest number of further degrees of freedom with shapes, for a figure; they get no residual vectors.
    """

    stiffness: str
    mass: str
    folder: Path
    points: Mapping[str, Weights]
    damping: str | None = None
    file: Path | None = None
    freedoms: Path | None = None
    named: tuple[str, ...] = ()
    modes: int | Literal["auto"] = 20
    tolerance: float = 1e-3
    driven: float = 0.0
    residual: bool = True
    base: Weights | str | None = None
    damping_ratio: float | tuple[float, ...] = 0.0
    rayleigh: tuple[float, float] = (0.0, 0.0)
    shown: int = 0
