"""Complex shapes made real: the phase of each mode is turned to its best line, and the rest is left out.

The values of a normal mode lie on one line of the complex plane, and those of a measured one near it. The best line has
half the angle of the sum of phi^2. The part of the shape phi across it has the least square (docs/equations.md 8.11).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError

Shapes = NDArray[np.float64] | NDArray[np.complex128]
FAR_FROM_REAL = 0.1
"""Part of a shape across its line, relative to its norm, above which the mode is refused."""
_ROUNDING = 1e-12
"""Part across the line that is not told."""


def real_shapes(shapes: Shapes) -> tuple[Floats, tuple[str, ...]]:
    """Return real shapes, and a remark on the parts that are left out.

    Parameters
    ----------
    shapes : ndarray of float or complex, shape (point, mode)

    Returns
    -------
    shapes : ndarray, shape (point, mode)
        Real ones as they are. The largest value of others is positive.
    remarks : tuple of str
        The largest part that is left out, relative to the norm of its shape; empty where all shapes are real.

    Raises
    ------
    UsageError
        A mode is far from real.
    """
    if not np.iscomplexobj(shapes):
        return shapes.astype(np.float64), ()
    scales = np.maximum(np.abs(shapes.real), np.abs(shapes.imag)).max(axis=0)
    scaled = shapes / np.where(scales > 0.0, scales, 1.0)
    turned = scaled * np.exp(-0.5j * np.angle(np.sum(scaled**2, axis=0)))
    norms = np.linalg.norm(turned, axis=0)
    parts = np.linalg.norm(turned.imag, axis=0) / np.where(norms > 0.0, norms, 1.0)
    worst = int(np.argmax(parts))
    if parts[worst] > FAR_FROM_REAL:
        got = f"{100.0 * parts[worst]:.1f} % of it across its line"
        raise UsageError(
            f"mode {worst + 1}: expected a shape within {100.0 * FAR_FROM_REAL:g} % of a real one, got {got}."
        )
    found = turned.real * scales
    largest = np.argmax(np.abs(found), axis=0)
    found = found * np.where(found[largest, np.arange(found.shape[1])] < 0.0, -1.0, 1.0)
    if parts[worst] <= _ROUNDING:
        return found, ()
    told = f"{100.0 * parts[worst]:.2g} % of a shape (mode {worst + 1})"
    return found, (f"Complex shapes are made real; at most {told} is left out.",)
