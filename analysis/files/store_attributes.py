"""Attributes of datasets in the JSON of a store, and back with their types."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

TYPES = "attribute_types"
"""Attribute with the numpy types of the attributes that are numbers."""
COORDINATES = "coordinates"
"""Attribute with the names of the coordinates, as xarray and CF write it."""
STORE_ID = "store_id"
"""Attribute of a store with a number of its own: the chunks of Dask are named by it."""
_IN_STORES = (TYPES, STORE_ID, COORDINATES, "_FillValue")
_NUMBERS = "biuf"


def attributes_stored(attributes: Mapping[Any, Any]) -> dict[str, Any]:
    """Return attributes as JSON; `attribute_types` has the types of numbers.

    >>> attributes_stored({"units": "m", "error": np.float64("nan")})
    {'units': 'm', 'error': 'nan', 'attribute_types': {'error': 'float64'}}
    """
    stored: dict[str, Any] = {}
    types = {}
    for name, value in attributes.items():
        if name in _IN_STORES:
            continue
        if isinstance(value, str):
            stored[str(name)] = value
            continue
        array = np.asarray(value)
        # as NetCDF, where an array of one element is a number
        array = array.reshape(()) if array.size == 1 else array
        stored[str(name)] = _plain(array.tolist())
        types[str(name)] = array.dtype.name if array.dtype.kind in _NUMBERS else "str"
    return stored | ({TYPES: types} if types else {})


def _plain(value: Any) -> Any:
    """Return numbers as JSON has them: those that are not finite become texts."""
    if isinstance(value, list):
        return [_plain(each) for each in value]
    return repr(value) if isinstance(value, float) and not math.isfinite(value) else value


def attributes_read(stored: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes that `attributes_stored` has made to JSON.

    Raises
    ------
    ValueError, TypeError
        The types do not fit the values.

    Examples
    --------
    >>> attributes_read({"error": "nan", "attribute_types": {"error": "float64"}})
    {'error': np.float64(nan)}
    """
    types = stored.get(TYPES, {})
    found: dict[str, Any] = {}
    for name, value in stored.items():
        if name in _IN_STORES:
            continue
        if name not in types:
            if not isinstance(value, str):
                raise TypeError(f"attribute {name}: a value of no known type")
            found[name] = value
            continue
        kind = np.dtype(str(types[name]))
        if kind.kind not in f"{_NUMBERS}U":
            raise TypeError(f"attribute {name}: a type that is no number: {kind}")
        array = np.array(value, dtype=kind)
        found[name] = array.reshape(())[()] if array.ndim == 0 else array
    return found
