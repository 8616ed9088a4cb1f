"""What a guard and its child say to each other: pickled messages with their length in front.

Both ends are this package in processes of one user; nothing else can write to these pipes.
"""

from __future__ import annotations

import pickle
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import IO, Any

from vibroimpact.orchestrator.scene import Scene

LENGTH = struct.Struct("<Q")


@dataclass(frozen=True, slots=True)
class Order:
    """What the child shall run: a scene, its execution, the file of notes, and whether to note every call there."""

    scene: Scene
    execution: str
    notes: str
    noting: bool


@dataclass(frozen=True, slots=True)
class PointTask:
    """One point to run."""

    values: Mapping[str, float]
    start: tuple[float, ...] | None


@dataclass(frozen=True, slots=True)
class Failure:
    """The point (or the scene) failed with this message; the child lives on.

    `misuse`: what was given is at fault (an FMU file for another machine), not the run.
    """

    message: str
    misuse: bool = False


def send(pipe: IO[bytes], message: Any) -> None:
    """Write one message."""
    data = pickle.dumps(message, protocol=pickle.HIGHEST_PROTOCOL)
    pipe.write(LENGTH.pack(len(data)) + data)
    pipe.flush()


def receive(pipe: IO[bytes]) -> Any:
    """Read one message; None when the other end is gone."""
    head = pipe.read(LENGTH.size)
    if len(head) < LENGTH.size:
        return None
    (size,) = LENGTH.unpack(head)
    data = pipe.read(size)
    return pickle.loads(data) if len(data) == size else None
