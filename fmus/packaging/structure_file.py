"""The file of a Structure's modes in an FMU, for tools that cannot set arrays; `native/structure/structure_file.h`."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import UsageError

#: Place of the file in an FMU.
STRUCTURE_MEMBER = "resources/structure.bin"
MAGIC = b"VISTRUC2"
#: Bytes before the arrays, and the largest number of modes.
HEAD, MOST_MODES = len(MAGIC) + 4 * 8, 64
#: Arrays of the file in their order; each has a row of one number for each mode, or several rows.
STRUCTURE_ARRAYS = (
    *("mode.angular_frequency", "mode.damping_ratio", "mode.damping", "mode.contact_shape"),
    *("mode.observed_shape", "mode.forcing", "mode.base", "mode.force"),
    *("mode.displacement_start", "mode.velocity_start", "mode.sine"),
)


def structure_file(arrays: Mapping[str, Any], *, coupled: bool = False) -> bytes:
    """Return the content of the file for the arrays of a Structure, by variable name.

    `mode.angular_frequency` has one number for each mode, N; `mode.contact_shape` has shape (contacts, N),
    `mode.sine` (sines, N) and `mode.damping` (N, N). Absent arrays are zeros. Raise UsageError for an array of another shape or an unknown name.
    """
    natural = np.asarray(arrays["mode.angular_frequency"], dtype=np.float64)
    modes = natural.size
    shapes = dict.fromkeys(STRUCTURE_ARRAYS, (modes,)) | {"mode.damping": (modes, modes)}
    contacts, sines = (len(arrays.get(f"mode.{name}", ())) for name in ("contact_shape", "sine"))
    shapes |= {"mode.contact_shape": (contacts, modes), "mode.sine": (sines, modes)}
    for name in arrays:
        if name not in shapes:
            raise UsageError(f"{name}: expected one of {', '.join(STRUCTURE_ARRAYS)}, got another.")
    rows = [MAGIC, struct.pack("<4q", modes, contacts, sines, coupled)]
    for name, shape in shapes.items():
        array = np.asarray(arrays.get(name, np.zeros(shape)), dtype="<f8")
        if array.size != np.prod(shape) or (array.size > 0 and array.shape != shape):
            raise UsageError(f"{name}: expected an array of shape {shape}, got {array.shape}.")
        rows.append(array.tobytes())
    return b"".join(rows)


def natural_frequencies(content: bytes) -> tuple[float, ...]:
    """Return the angular frequencies in the content of a file, rad/s; those there are, if it is cut off."""
    modes = int.from_bytes(content[len(MAGIC) : len(MAGIC) + 8], "little")
    numbers = content[HEAD : HEAD + 8 * min(modes, MOST_MODES)]
    return tuple(np.frombuffer(numbers[: len(numbers) // 8 * 8], dtype="<f8").tolist())
