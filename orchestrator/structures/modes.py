"""Modes of a structure with their mass-normalised shapes at named points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Modes from matrices or from a measurement.

    Attributes
    ----------
    natural : ndarray, shape (mode,)
        Natural angular frequencies, rad/s, ascending; 0 for a rigid body.
    damping_ratios : ndarray, shape (mode,)
    damping : ndarray or None, shape (mode, mode)
        Modal damping phi' C phi besides the ratios, 1/s; None without a matrix.
    shapes : mapping of str to ndarray, shape (mode,)
        Mass-normalised shapes at each named point, kg^(-1/2).
    participation : ndarray or None, shape (mode,)
        phi' M r for the base, kg^(1/2); None where no direction of the base is given.
    residual_vectors : int
        How many of the last modes are residual vectors.
    error : float or None
        Largest relative error of the static and dynamic flexibility at the points by the reduction; None if unknown.
    files : mapping of str to str
        SHA-256 of each file by its name.
    remarks : tuple of str
        What was changed or left out on the way, one sentence each.
    coordinates : mapping of str to tuple of float
        Place x, y, z of the node of each point that is a degree of freedom, m, where it is known.
    masses : mapping of str to float
        Mass that moves along each direction, kg, where degrees of freedom have names that end in x, y or z.
    centre : tuple of float
        Centre of mass x, y, z, m; empty where a place is not known.
    """

    natural: Floats
    damping_ratios: Floats
    damping: Floats | None
    shapes: Mapping[str, Floats]
    participation: Floats | None = None
    residual_vectors: int = 0
    error: float | None = None
    files: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    coordinates: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    masses: Mapping[str, float] = field(default_factory=dict)
    centre: tuple[float, ...] = ()

    def table(self) -> dict[str, Any]:
        """Return the table `[body]` of these modes, with where they come from."""
        found: dict[str, Any] = {
            "kind": "modes",
            "frequencies": in_hertz(self.natural).tolist(),
            "damping_ratio": self.damping_ratios.tolist(),
            "shapes": {name: shape.tolist() for name, shape in self.shapes.items()},
        }
        if self.damping is not None:
            found["damping_matrix"] = self.damping.tolist()
        if self.participation is not None:
            found["participation"] = self.participation.tolist()
        origin: dict[str, Any] = {"files": dict(self.files), "residual_vectors": self.residual_vectors}
        origin |= {} if self.error is None else {"error": self.error}
        origin |= {"remarks": list(self.remarks)} if self.remarks else {}
        return found | {"origin": origin}


def in_hertz(natural: Floats) -> Floats:
    """Return frequencies, Hz, of angular ones; 2 pi times each is the angular one to the last bit where a number is.

    >>> 2.0 * np.pi * float(in_hertz(np.array([393.7]))[0])
    393.7
    """
    found = natural / (2.0 * np.pi)
    for near in (np.nextafter(found, 0.0), np.nextafter(found, np.inf)):
        found = np.where((2.0 * np.pi * found != natural) & (2.0 * np.pi * near == natural), near, found)
    return found
