"""Files of modes, written from their formats: universal files of normal and complex modes, and NetCDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import netCDF4
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Shapes = NDArray[np.float64] | NDArray[np.complex128]
Kind = Literal["NETCDF4", "NETCDF3_CLASSIC"]
MARK = "    -1\n"


def units(length: float = 1.0, force: float = 1.0) -> str:
    """Return a dataset 164 of the units of length and force per unit of SI."""
    factors = "".join(f"{each:25.17E}" for each in (length, force, 1.0)).replace("E", "D")
    return f"{MARK}{164:6d}\n{1:10d}{'some units':20}{2:10d}\n{factors}\n{0.0:25.17E}\n{MARK}"


def nodal_data(
    number: int,
    parameters: Sequence[float],
    shapes: Mapping[int, Shapes],
    *,
    analysis: int = 2,
    quantity: int = 8,
    characteristic: int | None = None,
) -> str:
    """Return a dataset 55: parameters of a mode, and its values at nodes, three or six of each."""
    width = len(next(iter(shapes.values())))
    is_complex = any(np.iscomplexobj(row) for row in shapes.values())
    kinds = (1, analysis, characteristic or (2 if width == 3 else 3), quantity, 5 if is_complex else 2, width)
    text = f"{MARK}{55:6d}\n" + "NONE\n" * 5
    text += "".join(f"{each:10d}" for each in kinds) + "\n"
    text += "".join(f"{each:10d}" for each in (2, len(parameters), 1, number)) + "\n"
    text += "".join(f"{each:13.5E}" for each in parameters) + "\n"
    for node, row in shapes.items():
        numbers = np.ascontiguousarray(row).view(np.float64) if is_complex else row
        text += f"{node:10d}\n"
        for at in range(0, len(numbers), 6):
            text += "".join(f"{each:13.5E}" for each in numbers[at : at + 6]) + "\n"
    return text + MARK


def six_digits(values: Any) -> Any:
    """Return numbers as a universal file has them."""
    if np.iscomplexobj(values):
        return six_digits(values.real) + 1j * six_digits(values.imag)
    return np.array([float(f"{each:.5E}") for each in np.ravel(values)]).reshape(np.shape(values))


def netcdf(
    variables: Mapping[str, tuple[tuple[str, ...], Any]],
    *,
    kind: Kind = "NETCDF4",
    units: Mapping[str, str] | None = None,
) -> bytes:
    """Return a NetCDF file of variables with their dimensions and values; classic files have texts as characters."""
    file = netCDF4.Dataset("modes.nc", "w", memory=1, format=kind)
    for name, (dimensions, values) in variables.items():
        array = np.asarray(values)
        if array.dtype.kind == "U" and kind != "NETCDF4":
            array = netCDF4.stringtochar(array.astype("S8"))
            dimensions = (*dimensions, "letter")
        for dimension, size in zip(dimensions, array.shape, strict=True):
            if dimension not in file.dimensions:
                file.createDimension(dimension, size)
        variable = file.createVariable(name, str if array.dtype.kind == "U" else array.dtype, dimensions)
        if name in (units or {}):
            variable.units = (units or {})[name]
        variable[:] = array.astype(object) if array.dtype.kind == "U" else array
    return bytes(file.close())
