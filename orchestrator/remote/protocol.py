"""The messages between an importer and a server of FMUs: batches of FMI calls, and their answers.

A batch has all calls of one step: the inputs, the step, the outputs. It ends with the first call that returns more than
a warning. `Describe` answers a batch with a description; `Run` is a stream of batches, each with one answer. The
messages are protobuf, version 3, with the fields of `_FIELDS`. Arrays are bytes, so that each bit arrives.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

PROTOCOL = "1"
"""Version of these messages; a server refuses any other."""
SERVICE = "vibroimpact.Fmu"
DESCRIBE, RUN = f"/{SERVICE}/Describe", f"/{SERVICE}/Run"
TOKEN_KEY, PROTOCOL_KEY, HASH_KEY = "authorization", "vibroimpact-protocol", "vibroimpact-sha256"
"""Names of the metadata of a call; `HASH_KEY` has the SHA-256 of the expected FMU."""
LARGEST_REQUEST = 4 * 2**20
"""Largest batch, byte; gRPC refuses a larger one before it is read."""
LARGEST_ANSWER = 32 * 2**20
"""Largest answer, byte: a description has at most 16 MiB."""
MOST_VALUES = LARGEST_REQUEST // 8
"""Most values of one call."""
MOST_CALLS = 4096
"""Most calls of one batch, and most saved states of one instance."""
INSTANTIATE = "Instantiate"

#: Codes of the scalar arguments and results of a function: d double, i int, ? bool.
SCALARS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "3.0": {
        "EnterConfigurationMode": ("", ""),
        "ExitConfigurationMode": ("", ""),
        "EnterInitializationMode": ("?dd?d", ""),
        "ExitInitializationMode": ("", ""),
        "EnterEventMode": ("", ""),
        "EnterStepMode": ("", ""),
        "Terminate": ("", ""),
        "Reset": ("", ""),
        "DoStep": ("dd?", "???d"),
        "UpdateDiscreteStates": ("", "?????d"),
    },
    "2.0": {
        "SetupExperiment": ("iddid", ""),
        "EnterInitializationMode": ("", ""),
        "ExitInitializationMode": ("", ""),
        "Terminate": ("", ""),
        "Reset": ("", ""),
        "DoStep": ("ddi", ""),
        "GetStatus": ("i", "i"),
        "GetBooleanStatus": ("i", "i"),
        "GetRealStatus": ("i", "d"),
    },
}
CODES: Mapping[str, Any] = {"d": ctypes.c_double, "i": ctypes.c_int, "?": ctypes.c_bool}
_WHOLE = {
    f"{u}Int{bits}": getattr(ctypes, f"c_{u.lower()}int{bits}") for u in ("", "U") for bits in (8, 16, 32, 64)
}
#: C types of the values of the functions Get... and Set..., by FMI's name of the type.
VALUES: Mapping[str, Mapping[str, Any]] = {
    "3.0": {"Float64": ctypes.c_double, "Float32": ctypes.c_float, "Boolean": ctypes.c_bool, **_WHOLE},
    "2.0": {"Real": ctypes.c_double, "Integer": ctypes.c_int32, "Boolean": ctypes.c_int32},
}
#: Names of the functions of saved states: their first word, and FMI's spelling of the second.
STATE_WORDS = {"3.0": "FMUState", "2.0": "FMUstate"}

#: The messages: type and name of each field, numbered from 1; a star marks a repeated field.
_FIELDS: Mapping[str, tuple[str, ...]] = {
    "Call": (
        "string function",  # FMI's name without prefix
        "uint32* references",
        "uint32* others",  # GetDirectionalDerivative: the known variable
        "uint32 size",  # number of values
        "bytes values",  # little-endian, in the C type of the function
        "double* numbers",  # the scalar arguments, integers and booleans too
        "string* texts",
        "uint32 slot",  # number of a saved state
    ),
    "Batch": ("Call* calls",),
    "Result": ("sint32 status", "bytes values", "double* numbers", "string* texts"),
    "Answer": ("Result* results", "string* log", "bool changed_rounding", "string refusal"),
    "Description": ("string version", "string name", "string sha256", "bytes xml"),
}


def _file() -> Any:
    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(
        name="vibroimpact_fmu.proto", package="vibroimpact", syntax="proto3"
    )
    for name, fields in _FIELDS.items():
        message = file.message_type.add(name=name)
        for number, field in enumerate(fields, start=1):
            kind, _, label = field.partition(" ")
            single = kind.removesuffix("*")
            repeated = kinds.LABEL_REPEATED if kind.endswith("*") else kinds.LABEL_OPTIONAL
            added = message.field.add(name=label, number=number, label=repeated)
            if single in _FIELDS:
                added.type, added.type_name = kinds.TYPE_MESSAGE, f".vibroimpact.{single}"
            else:
                added.type = getattr(kinds, f"TYPE_{single.upper()}")
    return file


_pool = descriptor_pool.DescriptorPool()
_pool.Add(_file())
_class = message_factory.GetMessageClass
Call, Batch, Result, Answer, Description = (
    _class(_pool.FindMessageTypeByName(f"vibroimpact.{name}")) for name in _FIELDS
)
