"""Groups of variables of one type, read or written by one prebound call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

Call = Callable[[], int]
#: FMI's status of a call that an FMU cannot carry out with these values.
DISCARDED = 2


class Owner(Protocol):
    """The owner of variables: an instance."""

    def check(self, status: int, function: str) -> None:
        """Raise unless a call ended with at most a warning."""

    def fail(self, function: str, what: str) -> NoReturn:
        """Raise the error of a call."""


@dataclass(frozen=True, slots=True)
class Setter:
    """A C function that sets variables in the form of FMI's, and its first argument."""

    function: ctypes.c_void_p
    owner: ctypes.c_void_p


class VariableGroup:
    """Variables of one type of one instance, with a buffer that is reused at every call.

    Attributes
    ----------
    instance : Owner
        The owner of the variables.
    name : str
        FMI's name of their type, in the version of the instance.
    references : tuple of int
        Their value references.
    values : ndarray
        The buffer: `get` fills it, `set` sends it. Its type is that of the variables in C.
    get_call, set_call : callable
        The bare calls, which return FMI's status, for code that checks it itself.
    setter : Setter or None
        The function that sets the variables in place of the FMU's own.
    """

    __slots__ = ("_array", "get_call", "instance", "name", "references", "set_call", "setter", "values")

    def __init__(
        self,
        name: str,
        functions: tuple[Callable[..., int], Callable[..., int]],
        pointer: ctypes.c_void_p,
        references: Sequence[int],
        values: NDArray[Any],
        owner: Owner,
        *,
        with_value_count: bool,
        setter: Setter | None = None,
    ) -> None:
        if not values.flags.c_contiguous:
            raise ValueError("values: expected a contiguous buffer")
        self.values = values
        self.name = name
        self.instance = owner
        self.references = tuple(references)
        self._array = (ctypes.c_uint32 * max(1, len(references)))(*references)
        tail = (ctypes.c_size_t(values.size),) if with_value_count else ()
        self.setter = setter
        arguments = (
            ctypes.byref(self._array),
            ctypes.c_size_t(len(references)),
            ctypes.c_void_p(values.ctypes.data),
            *tail,
        )
        self.get_call: Call = partial(functions[0], pointer, *arguments)
        owner_of_set = pointer if setter is None else setter.owner
        self.set_call: Call = partial(functions[1], owner_of_set, *arguments)

    @property
    def references_address(self) -> int:
        """Address of the value references, for C code that makes the calls itself."""
        return ctypes.addressof(self._array)

    def get(self) -> NDArray[Any]:
        """Read the variables; returns the buffer."""
        status = self.get_call()
        if status > 1:
            self.instance.check(status, "Get" + self.name)
        return self.values

    def set(self) -> None:
        """Write the buffer to the variables."""
        status = self.set_call()
        if status > 1:
            self.instance.check(status, "Set" + self.name)

    def try_get(self) -> bool:
        """Read the variables; returns false where the FMU discards the call, and the buffer has no values."""
        return self._is_kept(self.get_call(), "Get")

    def try_set(self) -> bool:
        """Write the buffer to the variables; returns false where the FMU discards the call, and takes no value."""
        return self._is_kept(self.set_call(), "Set")

    def _is_kept(self, status: int, direction: str) -> bool:
        if status == DISCARDED:
            return False
        if status:
            self.instance.check(status, direction + self.name)
        return True


class TextGroup(VariableGroup):
    """Variables of type String of one instance; the FMU's memory of a text is copied at once.

    Attributes
    ----------
    texts : ndarray of object
        The texts of the last read. Bytes that are no UTF-8 are replaced.
    """

    __slots__ = ("texts",)

    def __init__(
        self,
        functions: tuple[Callable[..., int], Callable[..., int]],
        pointer: ctypes.c_void_p,
        references: Sequence[int],
        size: int,
        owner: Owner,
        *,
        with_value_count: bool,
    ) -> None:
        addresses = np.zeros(size, dtype=np.uintp)
        super().__init__(
            "String", functions, pointer, references, addresses, owner, with_value_count=with_value_count
        )
        self.texts = np.full(size, "", dtype=object)
        read = self.get_call

        def read_texts() -> int:
            status = read()
            if 0 <= status < DISCARDED:
                self._take()
            return status

        self.get_call = read_texts

    def _take(self) -> None:
        for place, address in enumerate(self.values.tolist()):
            if address == 0:
                self.instance.fail("GetString", f"gave no text for value reference {self.references[0]}")
            self.texts[place] = ctypes.string_at(address).decode("utf-8", "replace")

    def get(self) -> NDArray[Any]:
        """Read the variables; returns the texts."""
        super().get()
        return self.texts


#: C types of values by FMI type, for each version.
DTYPES: dict[str, dict[str, Any]] = {
    "3.0": {
        "Float64": np.float64, "Float32": np.float32, "Boolean": np.bool_,
        "Int64": np.int64, "Int32": np.int32, "Int16": np.int16, "Int8": np.int8,
        "UInt64": np.uint64, "UInt32": np.uint32, "UInt16": np.uint16, "UInt8": np.uint8,
    },
    "2.0": {"Float64": np.float64, "Int64": np.int32, "Boolean": np.int32},
}  # fmt: skip
#: FMI 2.0's names of the types above.
FMI2_NAMES = {"Float64": "Real", "Int64": "Integer", "Boolean": "Boolean"}
