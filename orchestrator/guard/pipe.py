"""What a guard and its child say to each other: messages with their length in front.

Both ends are this package in processes of one user; nothing else can write to these pipes. Messages are pickled,
but for records, of which there is one for each point: packed by their fields they take a quarter of the time.
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

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.scene import Scene

#: Stands before each message: its length, and whether it is a record.
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


def _packed_record(record: RunRecord) -> bytes:
    """Return the bytes of a record: its numbers, what else there is, and its arrays of float64."""
    arrays = [None if array is None else (array.shape, array.tobytes()) for array in _arrays_of(record)]
    numbers = _NUMBERS.pack(*_numbers_of(record))
    residual = None if record.loop_residual is None else float(record.loop_residual)
    return marshal.dumps((numbers, record.message, residual, arrays))


def _unpacked_record(data: bytes) -> RunRecord:
    numbers, message, residual, arrays = marshal.loads(data)
    outcome, displacement, velocity, phase, seconds = _NUMBERS.unpack(numbers)
    return RunRecord(
        Outcome(outcome),
        message,
        final_displacement=displacement,
        final_velocity=velocity,
        final_phase=phase,
        seconds=seconds,
        loop_residual=residual,
        **{
            name: None if array is None else np.frombuffer(array[1]).reshape(array[0]).copy()
            for name, array in zip(_ARRAYS, arrays, strict=True)
        },
    )


def packed(message: Any) -> bytes:
    """Return the bytes of a message: a record, an object of this module, or a tuple of points."""
    is_record = isinstance(message, RunRecord)
    data = _packed_record(message) if is_record else pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    return HEAD.pack(len(data), is_record) + data


def send(pipe: IO[bytes], message: Any) -> None:
    """Write one message."""
    pipe.write(packed(message))
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
    return _unpacked_record(data) if is_record else pickle.loads(data)
