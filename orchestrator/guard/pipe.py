"""What a guard and its child say to each other: messages with their length in front.

Both ends are this package in processes of one user; nothing else can write to these pipes. Messages are pickled,
but for records, of which there is one for each point: their arrays come after them as they lie in memory.
"""

from __future__ import annotations

import marshal
import pickle
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.scene import Scene

#: Stands before each message: its length, without the arrays of a record, and whether it is one.
HEAD = struct.Struct("<Q?")
#: What a child says on its bell: how many answers there are to read, and whether they end what it was given to run.
BELL = struct.Struct("<B?")
#: Points that a child is given at a time, at most: their number is one byte on the bell.
MOST_POINTS = 64
#: A child begins no further one of the points that it was given once it has been at them for so long, s.
BATCH_TIME = 0.25

PointTask = tuple[Mapping[str, float], tuple[float, ...] | None]
"""One point to run: its values, and the state that it starts from. A child is given a tuple of them."""


@dataclass(frozen=True, slots=True)
class Order:
    """What the child shall run: a scene, its execution, the file of notes, and whether to note every call there."""

    scene: Scene
    execution: str
    notes: str
    noting: bool


@dataclass(frozen=True, slots=True)
class Failure:
    """The point (or the scene) failed with this message; the child lives on.

    `misuse`: what was given is at fault (an FMU file for another machine), not the run.
    """

    message: str
    misuse: bool = False


_numbers_of = attrgetter("outcome", "final_displacement", "final_velocity", "final_phase", "seconds")
_NUMBERS = struct.Struct("<b4d")
_ARRAYS = ("periods", "impacts", "sticks", "samples", "events", "energy_residual", "final_state", "scores")
_arrays_of = attrgetter(*_ARRAYS)


def _packed_record(record: RunRecord) -> list[memoryview]:
    """Return what a record is sent as: its head with its numbers and what else there is, then its arrays of float64."""
    arrays = [None if array is None else np.ascontiguousarray(array) for array in _arrays_of(record)]
    shapes = [None if array is None else array.shape for array in arrays]
    numbers = _NUMBERS.pack(*_numbers_of(record))
    residual = None if record.loop_residual is None else float(record.loop_residual)
    data = marshal.dumps((numbers, record.message, residual, shapes))
    head = memoryview(HEAD.pack(len(data), True) + data)
    return [head, *(_bytes_of(array) for array in arrays if array is not None and array.size)]


def _bytes_of(array: NDArray[np.float64]) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _received_record(data: bytes, pipe: IO[bytes]) -> RunRecord | None:
    """Return the record that begins with `data`, its arrays read from the pipe; None where they are not whole."""
    numbers, message, residual, shapes = marshal.loads(data)
    outcome, displacement, velocity, phase, seconds = _NUMBERS.unpack(numbers)
    arrays: dict[str, NDArray[np.float64] | None] = {}
    for name, shape in zip(_ARRAYS, shapes, strict=True):
        arrays[name] = array = None if shape is None else np.empty(shape)
        if array is not None and array.size and _read_into(pipe, array) < array.nbytes:
            return None
    return RunRecord(
        Outcome(outcome),
        message,
        final_displacement=displacement,
        final_velocity=velocity,
        final_phase=phase,
        seconds=seconds,
        loop_residual=residual,
        **arrays,
    )


def _read_into(pipe: IO[bytes], array: NDArray[np.float64]) -> int:
    """Fill an array from a pipe; return how many bytes there were."""
    return pipe.readinto(_bytes_of(array)) or 0  # type: ignore[attr-defined]  # of all pipes, not of all IO


def packed(message: Any) -> list[memoryview]:
    """Return the bytes of a message, in rows: of a record, an object of this module, or a tuple of points."""
    if isinstance(message, RunRecord):
        return _packed_record(message)
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return [memoryview(HEAD.pack(len(data), False) + data)]


def send(pipe: IO[bytes], message: Any) -> None:
    """Write one message."""
    pipe.writelines(packed(message))
    pipe.flush()


def receive(pipe: IO[bytes]) -> Any:
    """Read one message; None when the other end is gone, or, of a pipe that does not block, where none is whole."""
    head = pipe.read(HEAD.size) or b""
    if len(head) < HEAD.size:
        return None
    size, is_record = HEAD.unpack(head)
    data = pipe.read(size) or b""
    if len(data) < size:
        return None
    return _received_record(data, pipe) if is_record else pickle.loads(data)
