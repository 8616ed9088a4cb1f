"""The process that imports one uploaded file.

It reads untrusted files, and a library that crashes, hangs or fills the memory takes nothing else with it.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from vibroimpact.analysis.recording import Recording, write_recording
from vibroimpact.fmus.confinement import machine_memory
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.hardware.recordings import import_recording
from vibroimpact.service.memory import import_memory
from vibroimpact.service.passing import FULL


def limit_memory(size: int) -> None:
    """Let allocations beyond an address space (byte) fail."""
    if sys.platform == "linux":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        size = size if most == resource.RLIM_INFINITY else min(size, most)
        resource.setrlimit(resource.RLIMIT_AS, (size, most))


def contents(recording: Recording) -> list[dict[str, Any]]:
    """Return a description of a recording's channels."""
    channels = [
        {"name": one.name, "units": one.unit, "samples": len(one.values)}
        for one in recording.channels.values()
    ]
    events = [{"name": one.name, "units": "s", "events": len(one.times)} for one in recording.events.values()]
    return channels + events


def answer(file: str, target: str, settings: str) -> dict[str, Any]:
    """Import an uploaded file, with settings in JSON, and write its recording to the target.

    The answer has the `channels` of the recording, the reason why it `failed`, or the error of a `full` disk.
    """
    path = Path(file)
    memory = import_memory(machine_memory())
    limit_memory(memory)
    try:
        recording = import_recording(path, json.loads(settings))
        write_recording(recording, Path(target))
    except VibroimpactError as error:
        return {"failed": str(error).replace(f"{path.parent}/", "")}  # hide the service's own folder
    except MemoryError:
        gib = memory / 2**30
        return {"failed": f"{path.name}: expected a recording, got more than fits into {gib:.0f} GiB."}
    except OSError as error:
        if error.errno not in FULL:
            raise
        return {"full": [error.errno, error.strerror]}
    return {"channels": contents(recording)}
