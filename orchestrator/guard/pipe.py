"""The messages between a guard and its child, each with its length in front.

Both ends are this package in processes of one user; nobody else can write to these pipes. Messages are pickled, except
the one record of each point. Its arrays follow in the pipe as they lie in memory. Large arrays go by a file in memory,
if the system has such files. Its pages exist already; a pipe needs new pages for all its data. The child writes the
file and does not map it, so that an FMU cannot reach it.
"""

from __future__ import annotations

import marshal
import os
import pickle
import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.scene import Scene

#: Head of each message: its length without the arrays of a record, and the place of the arrays. The place is an offset
#: in the shared memory, or one of the two values below.
HEAD = struct.Struct("<Qq")
NO_RECORD, FOLLOWING = -1, -2
#: Bytes of a record's arrays, below which they go through the pipe, and bytes of memory for the arrays of a batch.
LARGE, MEMORY_ROOM = 1 << 14, 1 << 24
#: Message on a child's bell: the number of answers to read, and whether they are the last of the batch.
BELL = struct.Struct("<B?")
#: Most points in a batch: their number is one byte on the bell.
MOST_POINTS = 64
#: Time in a batch after which a child starts no further point, s.
BATCH_TIME = 0.25

PointTask = tuple[Mapping[str, float], tuple[float, ...] | None]
"""One point to run: its values, and its start state. A child is given a tuple of points."""


@dataclass(frozen=True, slots=True)
class Order:
    """The child's order: a scene, its execution, the file of notes, and whether to note every call there.

    `memory`: the descriptor of the file in memory for arrays, or None.
    """

    scene: Scene
    execution: str
    notes: str
    noting: bool
    memory: int | None = None


@dataclass(frozen=True, slots=True)
class Failure:
    """The point (or the scene) failed with this message; the child lives on.

    `misuse`: the input is at fault (an FMU file for another machine), not the run.
    """

    message: str
    misuse: bool = False


_numbers_of = attrgetter("outcome", "final_displacement", "final_velocity", "final_phase", "seconds")
_NUMBERS = struct.Struct("<b4d")
_ARRAYS = (
    "periods",
    "impacts",
    "sticks",
    "samples",
    "events",
    "energy_residual",
    "final_state",
    "scores",
    "chosen_steps",
    "step_trace",
)
_arrays_of = attrgetter(*_ARRAYS)


class Memory:
    """The file in memory for arrays of records; a child writes one after the other until a batch has been read."""

    def __init__(self, file: int | None) -> None:
        self._file, self._used = file, 0

    def clear(self) -> None:
        """Start again at the beginning: all contents have been read."""
        self._used = 0

    def place(self, arrays: Sequence[memoryview]) -> int | None:
        """Write arrays and return their place; None if they must go through the pipe."""
        size = sum(len(array) for array in arrays)
        if self._file is None or size < LARGE or self._used + size > MEMORY_ROOM:
            return None
        try:
            if os.pwritev(self._file, arrays, self._used) < size:
                return None
        except OSError:  # the system has no memory left for it; the pipe needs none
            return None
        place, self._used = self._used, self._used + size
        return place


def _packed_record(record: RunRecord, memory: Memory | None) -> list[memoryview]:
    """Return the rows of a record's message: its head with its numbers, then its arrays of float64."""
    arrays = [None if array is None else np.ascontiguousarray(array) for array in _arrays_of(record)]
    shapes = [None if array is None else array.shape for array in arrays]
    numbers = _NUMBERS.pack(*_numbers_of(record))
    residual = None if record.loop_residual is None else float(record.loop_residual)
    data = marshal.dumps((numbers, record.message, residual, shapes, _packed_forms(record)))
    rows = [_bytes_of(array) for array in arrays if array is not None and array.size]
    place = None if memory is None else memory.place(rows)
    head = memoryview(HEAD.pack(len(data), FOLLOWING if place is None else place) + data)
    return [head, *rows] if place is None else [head]


def _packed_forms(record: RunRecord) -> list[tuple[str, tuple[int, ...], Any]] | None:
    """Return the samples with a form: type, shape, and texts or bytes of each."""
    if record.formed_samples is None:
        return None
    return [
        (
            array.dtype.str,
            array.shape,
            array.reshape(-1).tolist() if array.dtype.kind == "O" else array.tobytes(),
        )
        for array in record.formed_samples
    ]


def _received_forms(forms: list[tuple[str, tuple[int, ...], Any]] | None) -> tuple[NDArray[Any], ...] | None:
    if forms is None:
        return None
    found = []
    for dtype, shape, values in forms:
        flat = np.array(values, dtype=object) if dtype == "|O" else np.frombuffer(values, dtype=dtype).copy()
        found.append(flat.reshape(shape))
    return tuple(found)


def _bytes_of(array: NDArray[np.float64]) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _received_record(data: bytes, place: int, pipe: IO[bytes], memory: int | None) -> RunRecord | None:
    """Return the record that begins with `data`, with its arrays from `place`; None if they are incomplete."""
    numbers, message, residual, shapes, forms = marshal.loads(data)
    outcome, displacement, velocity, phase, seconds = _NUMBERS.unpack(numbers)
    arrays = {
        name: None if shape is None else np.empty(shape) for name, shape in zip(_ARRAYS, shapes, strict=True)
    }
    rows = [_bytes_of(array) for array in arrays.values() if array is not None and array.size]
    if place == FOLLOWING:
        are_whole = all(pipe.readinto(row) == len(row) for row in rows)  # type: ignore[attr-defined]  # of all pipes, not of all IO
    else:
        assert memory is not None  # the child has it from here
        are_whole = os.preadv(memory, rows, place) == sum(map(len, rows))
    if not are_whole:
        return None
    return RunRecord(
        Outcome(outcome),
        message,
        final_displacement=displacement,
        final_velocity=velocity,
        final_phase=phase,
        seconds=seconds,
        loop_residual=residual,
        formed_samples=_received_forms(forms),
        **arrays,
    )


def packed(message: Any, memory: Memory | None = None) -> list[memoryview]:
    """Return the bytes of a message, in rows: a record, an object of this module, or a tuple of points.

    `memory`: the file for large arrays; None: they follow in the message.
    """
    if isinstance(message, RunRecord):
        return _packed_record(message, memory)
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return [memoryview(HEAD.pack(len(data), NO_RECORD) + data)]


def send(pipe: IO[bytes], message: Any) -> None:
    """Write one message."""
    pipe.writelines(packed(message))
    pipe.flush()


def receive(pipe: IO[bytes], memory: int | None = None) -> Any:
    """Read one message; None if the other end is gone, or if a pipe that does not block has no whole message.

    `memory`: the descriptor of the file in memory that both ends have.
    """
    head = pipe.read(HEAD.size) or b""
    if len(head) < HEAD.size:
        return None
    size, place = HEAD.unpack(head)
    data = pipe.read(size) or b""
    if len(data) < size:
        return None
    return pickle.loads(data) if place == NO_RECORD else _received_record(data, place, pipe, memory)
