"""Modes in NetCDF: `frequency` (mode), `damping_ratio` (mode) and `shape` (mode, point) with the names `point`.

`angular_frequency` may take the place of `frequency`. `modal_mass`, `participation` (mode), `damping_matrix` (mode,
mode), `shape_imaginary`, and places `x`, `y`, `z` (point) in m are optional; so are the attributes `residual_vectors`
and `error`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes_files.given import MOST_NUMBERS, GivenModes
from vibroimpact.orchestrator.structures.modes_files.real_shapes import Shapes

FIRST_BYTES = b"CDF", b"\x89HDF\r\n\x1a\n"
_UNITS: Mapping[str, tuple[str, ...]] = {
    "frequency": ("", "Hz", "hertz", "1/s", "s-1", "s^-1"),
    "angular_frequency": ("", "rad/s", "rad s-1", "1/s", "s-1"),
    "modal_mass": ("", "kg"),
    **dict.fromkeys("xyz", ("", "m")),
}
"""Units of each variable; others are refused."""


def read(content: bytes) -> GivenModes:
    """Return the modes of a NetCDF file.

    Raises
    ------
    UsageError
        A variable is missing, or has other dimensions, units or types.
    """
    import netCDF4

    with netCDF4.Dataset("modes.nc", memory=content) as file:
        names = set(file.variables)
        is_angular = "angular_frequency" in names
        if is_angular == ("frequency" in names):
            got = "both" if is_angular else f"variables {', '.join(sorted(names)[:12]) or 'none'}"
            raise UsageError(f"expected a variable frequency or angular_frequency, got {got}.")
        key = "angular_frequency" if is_angular else "frequency"
        mode = _dimensions(file, key, 1)[0]
        frequencies, points = _numbers(file, key, (mode,)).tolist(), _points(file)
        optional = {
            name: _numbers(file, name, (mode,)).tolist() if name in names else None
            for name in ("damping_ratio", "modal_mass", "participation")
        }
        ratios = optional["damping_ratio"]
        damping = _numbers(file, "damping_matrix", None) if "damping_matrix" in names else None
        return GivenModes(
            frequencies,
            points,
            _shapes(file, mode),
            0.0 if ratios is None else ratios,
            optional["modal_mass"],
            None if damping is None else damping.tolist(),
            optional["participation"],
            origin=_origin(file),
            is_angular=is_angular,
            coordinates=_coordinates(file, points),
        )


def _variable(file: Any, name: str) -> Any:
    if name not in file.variables:
        raise UsageError(
            f"expected a variable {name}, got {', '.join(sorted(file.variables)[:12]) or 'none'}."
        )
    return file.variables[name]


def _dimensions(file: Any, name: str, count: int) -> tuple[str, ...]:
    found: tuple[str, ...] = _variable(file, name).dimensions
    if len(found) != count:
        raise UsageError(f"{name}: expected {count} dimensions, got {len(found)}.")
    return found


def _numbers(file: Any, name: str, dimensions: tuple[str, ...] | None) -> Floats:
    """Return a variable of numbers; missing ones are NaN."""
    variable = _variable(file, name)
    if getattr(variable.dtype, "kind", "O") not in "fiu":
        raise UsageError(f"{name}: expected numbers, got {variable.dtype}.")
    if dimensions is not None and variable.dimensions != dimensions:
        expected, got = ", ".join(dimensions), ", ".join(variable.dimensions)
        raise UsageError(f"{name}: expected the dimension {expected}, got {got or 'none'}.")
    if dimensions is None and variable.ndim != 2:
        raise UsageError(f"{name}: expected 2 dimensions, got {variable.ndim}.")
    if variable.size > MOST_NUMBERS:
        raise UsageError(f"{name}: expected at most {MOST_NUMBERS} numbers, got {variable.size}.")
    unit = str(getattr(variable, "units", "")).strip()
    if unit not in _UNITS.get(name, (unit,)):
        raise UsageError(f"{name}: expected the unit {_UNITS[name][1]}, got {unit[:60]!r}.")
    return np.ma.filled(np.ma.asarray(variable[...], dtype=np.float64), np.nan)


def _points(file: Any) -> tuple[str, ...]:
    """Return the names of the points, from texts or rows of characters."""
    variable = _variable(file, "point")
    if variable.size > MOST_NUMBERS:
        raise UsageError(f"point: expected at most {MOST_NUMBERS} characters, got {variable.size}.")
    values = variable[...]
    if getattr(variable.dtype, "kind", "O") == "S" and variable.ndim == 2:
        values = ["".join(_text(each) for each in row).rstrip("\0 ") for row in np.ma.filled(values, b"")]
    if getattr(values, "ndim", 1) != 1:
        raise UsageError(f"point: expected a name for each point, got {variable.ndim} dimensions.")
    return tuple(_text(each) for each in values)


def _origin(file: Any) -> dict[str, Any]:
    """Return the numbers of residual vectors and the error that the file says, if it says them."""
    found = {name: getattr(file, name, None) for name in ("residual_vectors", "error")}
    kinds = {"residual_vectors": np.integer, "error": np.floating}
    return {name: value.item() for name, value in found.items() if isinstance(value, kinds[name])}


def _coordinates(file: Any, points: tuple[str, ...]) -> dict[str, tuple[float, float, float]]:
    """Return the places of points where the file has x, y and z of each."""
    if not {"x", "y", "z"} <= set(file.variables):
        return {}
    dimensions = file.variables["point"].dimensions[:1]
    x, y, z = (_numbers(file, name, dimensions).tolist() for name in "xyz")
    return dict(zip(points, zip(x, y, z, strict=True), strict=True))


def _text(value: object) -> str:
    return value.decode("latin-1") if isinstance(value, bytes) else str(value)


def _shapes(file: Any, mode: str) -> Shapes:
    """Return shapes of the dimensions point and mode, in either order."""
    dimensions = _dimensions(file, "shape", 2)
    if mode not in dimensions:
        raise UsageError(f"shape: expected the dimensions {mode} and point, got {', '.join(dimensions)}.")
    found: Shapes = _numbers(file, "shape", None)
    if "shape_imaginary" in file.variables:
        found = found + 1j * _numbers(file, "shape_imaginary", dimensions)
    return found.T if dimensions[0] == mode else found
