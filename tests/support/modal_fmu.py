"""The Structure FMU with arrays of modes, set as FMI 3.0 arrays or by its file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from support.component_fmu import ComponentFmu

MODES, CONTACTS, SINES, SIGNALS, TABLE_ROWS = 64, 32, 15, 8, 8192
#: Shapes of the arrays of a Structure that have not one number for each mode.
SHAPES = {
    "mode.contact_shape": (CONTACTS, MODES),
    "mode.damping": (MODES, MODES),
    "mode.sine": (SINES, MODES),
    "mode.signal": (SIGNALS, MODES),
    "table.time": (TABLE_ROWS,),
    "table.value": (TABLE_ROWS,),
}
Arrays = Mapping[str, ArrayLike]


def modes_of(
    mass: ArrayLike, stiffness: ArrayLike, damping: ArrayLike | None = None
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return angular frequencies, mass-normalised shapes (points, modes) and the modal damping matrix."""
    root = np.sqrt(np.asarray(mass, dtype=float))
    square, vectors = np.linalg.eigh(np.asarray(stiffness, dtype=float) / np.outer(root, root))
    shape = vectors / root[:, None]
    viscous = np.zeros((root.size, root.size)) if damping is None else np.asarray(damping, dtype=float)
    square = np.where(np.abs(square) < 1e-13 * max(np.abs(square).max(), 1e-300), 0.0, square)
    return np.sqrt(square), shape, shape.T @ viscous @ shape


def structure_fmu(
    arrays: Arrays, parameters: Mapping[str, float] = {}, *, coupled: bool = False, **options: Any
) -> ComponentFmu:
    """Return an initialized Structure whose arrays were set one by one (FMI 3.0)."""
    own = dict(options)
    initialize = own.pop("initialize", True)
    fmu = ComponentFmu("Structure", parameters, initialize=False, **own)
    fmu.set("modes", np.size(arrays["mode.angular_frequency"]))
    fmu.set("coupled", coupled)
    for name, values in arrays.items():
        set_array(fmu, name, values)
    if initialize:
        fmu.initialize(fmu.time)
    return fmu


def set_array(fmu: ComponentFmu, name: str, values: ArrayLike) -> None:
    """Set an array of the Structure from its part in use; the rest is 0."""
    part = np.asarray(values, dtype=float)
    whole = np.zeros(SHAPES.get(name, (MODES,)))
    whole[tuple(map(slice, part.shape))] = part
    fmu.fmu.setFloat64([fmu.reference(name)], whole.ravel().tolist())
