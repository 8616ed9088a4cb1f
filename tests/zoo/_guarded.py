"""Trials in processes with limits: a crash, a hang or an appetite for memory ends one trial alone.

A process is a fork of a server that has the modules loaded and runs no FMU.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import pickle
import resource
import signal
import tempfile
from pathlib import Path

from zoo._trial import Facts, made

LONGEST = 180.0
"""Longest time of a trial, s; an FMU of Amesim needs 14 s of a processor that others may use too."""
MOST_MEMORY = 16 << 30
"""Largest address space of a trial, bytes; FMUs with Java inside reserve several GiB."""
HANGS = "no end in {:g} s"
_CONTEXT = multiprocessing.get_context("forkserver")
_CONTEXT.set_forkserver_preload(["zoo._trial"])


def tried(role: str, path: Path, longest: float = LONGEST) -> Facts:
    """Return the result of a trial; `refusal` has its error, its crash or its missing end, in one line."""
    with tempfile.TemporaryDirectory(prefix="vibroimpact-zoo-") as folder:
        process = _CONTEXT.Process(target=_limited, args=(role, path.resolve(), Path(folder)))
        process.start()
        process.join(longest)
        hangs = process.is_alive()
        _end(process.pid)
        process.join()
        results = (Path(folder) / name for name in ("result", "first"))
        found: Facts = next((pickle.loads(file.read_bytes()) for file in results if file.exists()), {})
        if hangs or process.exitcode:
            said = (Path(folder) / "said").read_text(errors="replace").strip().splitlines()
            found["refusal"] = HANGS.format(longest) if hangs else _ending(process.exitcode or 0, said)
        return found


def _limited(role: str, path: Path, folder: Path) -> None:
    """Make a trial: its output goes into a file, and FMUs see a folder of their own."""
    os.setsid()
    with (folder / "said").open("wb") as said:
        for stream in (1, 2):
            os.dup2(said.fileno(), stream)
    os.chdir(folder)
    resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    for name, found in made(role, path):
        (folder / "part").write_bytes(pickle.dumps(found))
        (folder / "part").rename(folder / name)


def _end(number: int | None) -> None:
    """End the processes of a trial, also those that an FMU has started."""
    with contextlib.suppress(ProcessLookupError):  # all have ended
        os.killpg(number or 0, signal.SIGKILL)


def _ending(code: int, lines: list[str]) -> str:
    if code < 0:
        return f"the process ended by {signal.Signals(-code).name}"
    return lines[-1] if lines else f"exit code {code}"
