"""States of FMI instances as bytes, for another process: functions of the standard that only tests call."""

from __future__ import annotations

import ctypes
from ctypes import c_char_p, c_size_t, c_void_p

from vibroimpact.orchestrator.fmi.instance import Instance
from vibroimpact.orchestrator.fmi.instance3 import Instance3


def serialize(instance: Instance, slot: c_void_p) -> bytes:
    """Return a saved state as bytes."""
    state, size = "FMUState" if isinstance(instance, Instance3) else "FMUstate", c_size_t()
    _call(instance, f"Serialized{state}Size", slot, ctypes.byref(size))
    buffer = ctypes.create_string_buffer(size.value)
    _call(instance, f"Serialize{state}", slot, buffer, size)
    return buffer.raw


def deserialize(instance: Instance, data: bytes) -> c_void_p:
    """Return a saved state made from bytes of `serialize`."""
    name, slot = (
        "DeserializeFMUState" if isinstance(instance, Instance3) else "DeSerializeFMUstate",
        c_void_p(),
    )
    _call(instance, name, c_char_p(data), c_size_t(len(data)), ctypes.byref(slot))
    return slot


def _call(instance: Instance, name: str, *arguments: object) -> None:
    instance.check(instance._function(name)(instance._pointer, *arguments), name)
