"""Groups of variables of one type, read or written by one prebound call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Raises when the status of a call is worse than a warning.
Check = Callable[[int, str], None]


class VariableGroup:
    """Variables of one type of one instance, with a buffer that is used again at every call.

    Attributes
    ----------
    values : ndarray
        The buffer: `get` fills it, `set` sends it. Float64, int64, int32 or bool, by the variables' type.
    """

    __slots__ = ("_check", "_get", "_name", "_set", "values")

    def __init__(
        self,
        name: str,
        getter: Callable[..., int],
        setter: Callable[..., int],
        instance: ctypes.c_void_p,
        references: Sequence[int],
        values: NDArray[Any],
        check: Check,
        *,
        with_value_count: bool,
    ) -> None:
        self.values = values
        self._name = name
        self._check = check
        count = ctypes.c_size_t(len(references))
        refs = (ctypes.c_uint32 * max(1, len(references)))(*references)
        buffer = ctypes.c_void_p(values.ctypes.data)
        tail = (ctypes.c_size_t(values.size),) if with_value_count else ()
        self._get = partial(getter, instance, refs, count, buffer, *tail)
        self._set = partial(setter, instance, refs, count, buffer, *tail)

    def get(self) -> NDArray[Any]:
        """Read the variables; returns the buffer."""
        status = self._get()
        if status > 1:
            self._check(status, "Get" + self._name)
        return self.values

    def set(self) -> None:
        """Write the buffer to the variables."""
        status = self._set()
        if status > 1:
            self._check(status, "Set" + self._name)


def buffer_of(kind: str, size: int) -> NDArray[Any]:
    """Return a zeroed buffer for `size` values of an FMI type."""
    types = {"Float64": np.float64, "Int64": np.int64, "Int32": np.int32, "Boolean": np.bool_}
    return np.zeros(size, dtype=types[kind])
