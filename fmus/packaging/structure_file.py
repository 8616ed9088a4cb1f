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
HEAD, MOST_MODES = len(MAGIC) + 6 * 8, 64
#: Arrays of the file in their order; each has a row of one number for each mode, or several rows.
STRUCTURE_ARRAYS = (
    *("mode.angular_frequency", "mode.damping_ratio", "mode.damping", "mode.contact_shape"),
    *("mode.observed_shape", "mode.forcing", "mode.base", "mode.force"),
    *(
        "mode.displacement_start",
        "mode.velocity_start",
        "mode.sine",
        "mode.signal",
        "table.time",
        "table.value",
    ),
)


def structure_file(arrays: Mapping[str, Any], *, coupled: bool = False) -> bytes:
    """Return the content of the file for the arrays of a Structure, by variable name.

    `mode.angular_frequency` has one number for each mode, N; `mode.contact_shape` has shape (contacts, N), `mode.sine`
    (sines, N), `mode.signal` (signals, N) and `mode.damping` (N, N). Tables have the shape (rows,). Absent arrays are
    zeros. Raise UsageError for an array of another shape or an unknown name.
    """
    natural = np.asarray(arrays["mode.angular_frequency"], dtype=np.float64)
    modes = natural.size
    shapes = dict.fromkeys(STRUCTURE_ARRAYS, (modes,)) | {"mode.damping": (modes, modes)}
    of_points = ("mode.contact_shape", "mode.sine", "mode.signal")
    counts = [len(arrays.get(name, ())) for name in (*of_points, "table.time")]
    shapes |= {name: (count, modes) for name, count in zip(of_points, counts, strict=False)}
    shapes |= {"table.time": (counts[-1],), "table.value": (counts[-1],)}
    for name in arrays:
        if name not in shapes:
            raise UsageError(f"{name}: expected one of {', '.join(STRUCTURE_ARRAYS)}, got another.")
    rows = [MAGIC, struct.pack("<6q", modes, *counts, coupled)]
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
