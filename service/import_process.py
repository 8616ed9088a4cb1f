"""The process that imports one file: `python -m vibroimpact.service.import_process FILE RECORDING SETTINGS`.

What a stranger has uploaded is read here, where a library that crashes, hangs or fills the memory takes nothing else
with it.
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
from vibroimpact.service.child import FULL, begin_as_child, say
from vibroimpact.service.memory import import_memory


def limit_memory(wanted: int) -> None:
    """Let allocations beyond an address space (byte) fail."""
    if sys.platform == "linux":
        import resource

        _, most = resource.getrlimit(resource.RLIMIT_AS)
        wanted = wanted if most == resource.RLIM_INFINITY else min(wanted, most)
        resource.setrlimit(resource.RLIMIT_AS, (wanted, most))


def contents(recording: Recording) -> list[dict[str, Any]]:
    """Return what is in a recording, for its list."""
    channels = [
        {"name": one.name, "units": one.unit, "samples": len(one.values)}
        for one in recording.channels.values()
    ]
    events = [{"name": one.name, "units": "s", "events": len(one.times)} for one in recording.events.values()]
    return channels + events


def main(arguments: list[str]) -> int:
    """Import the file that the arguments name; return the exit code."""
    file, target, settings = Path(arguments[0]), Path(arguments[1]), json.loads(arguments[2])
    begin_as_child()
    memory = import_memory(machine_memory())
    limit_memory(memory)
    try:
        recording = import_recording(file, settings)
        write_recording(recording, target)
        say(channels=contents(recording))
    except VibroimpactError as error:
        say(failed=str(error).replace(f"{file.parent}/", ""))  # its folder is the service's own matter
    except MemoryError:
        say(failed=f"{file.name}: expected a recording, got more than fits into {memory / 2**30:.0f} GiB.")
    except OSError as error:
        if error.errno not in FULL:
            raise
        say(full=[error.errno, error.strerror])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
