"""Numbers of functions of the package that a use runs: `counts_of_uses` counts them in a new process."""

from __future__ import annotations

import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES, ROOT, TESTS
from support.serial_pool import workers_here

import vibroimpact as vi

ROOMS = ("analysis", "door", "fmus", "hardware", "orchestrator", "service")
SINGLE_RUN = EXAMPLES / "single_run.toml"
SWEEP = """
[sweep]
"forcing.angular_frequency" = { start = 0.8, stop = 0.9, points = 3 }
"""
Use = Callable[[Path], object]


def uses(folder: Path) -> dict[str, Use]:
    """Return the counted uses; each takes a new path for its result."""
    scene, swept = vi.Scene.from_file(SINGLE_RUN), folder / "swept.toml"
    swept.write_text(SINGLE_RUN.read_text(encoding="utf-8") + SWEEP, encoding="utf-8")
    rig = f"virtual:{_unhurried_rig(folder)}"
    follow = "--parameter forcing.angular_frequency --from 0.85 --to 0.9 -o"
    record = "--channel tip=Dev1/ai0,5 --rate 1000 --duration 0.1 -o"
    return {
        "vi.run": lambda path: vi.run(scene, progress=False),
        "reading a scene": lambda path: vi.Scene.from_file(SINGLE_RUN),
        "command run": lambda path: command("run", SINGLE_RUN, "-o", path),
        "command campaign": lambda path: command("campaign", swept, "-o", path.with_suffix("")),
        "command follow": lambda path: command("follow", SINGLE_RUN, *follow.split(), path),
        "command rig record": lambda path: command("rig", "record", "--rig", rig, *record.split(), path),
    }


def _unhurried_rig(folder: Path) -> Path:
    """Write a rig with a clock slower than real time: counting slows the program, and no buffer may overrun."""
    there = EXAMPLES / "rig"
    text = (there / "oscillator.toml").read_text(encoding="utf-8")
    slow = text.replace('scene = "', f'speed = 0.2\nscene = "{there.as_posix()}/')
    (folder / "rig.toml").write_text(slow, encoding="utf-8")
    return folder / "rig.toml"


def command(*words: str | Path) -> None:
    """Run a command in this process, a campaign with its workers."""
    with pytest.MonkeyPatch.context() as patch:
        workers_here(patch)
        done = in_this_process(*words)
    assert done.returncode == 0, done.stderr


def executed(use: Callable[[], object]) -> tuple[int, int]:
    """Return the numbers of functions and files of the package that a use runs, in all threads."""
    seen: set[CodeType] = set()

    def look(frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            seen.add(frame.f_code)

    threading.setprofile(look)
    sys.setprofile(look)
    try:
        use()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    # threads of a library may still be running
    own = [code for code in seen.copy() if is_own(code.co_filename)]
    return len(own), len({code.co_filename for code in own})


@cache
def is_own(name: str) -> bool:
    """Return whether a file belongs to the package."""
    path = os.path.realpath(name)
    return any(path.startswith(f"{ROOT / room}{os.sep}") for room in ROOMS)


def counts_of_uses() -> dict[str, tuple[int, int]]:
    """Return functions and files of each use, counted at its second run."""
    done = subprocess.run(
        [sys.executable, "-m", "architecture.uses"],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(TESTS)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return {name: (functions, files) for name, (functions, files) in json.loads(done.stdout).items()}


def main() -> None:
    """Print the counts as JSON."""
    with tempfile.TemporaryDirectory() as place, contextlib.redirect_stdout(io.StringIO()):
        folder = Path(place)
        counts = {}
        for name, use in uses(folder).items():
            use(folder / f"{name} first.nc")
            counts[name] = executed(lambda use=use, name=name: use(folder / f"{name}.nc"))  # type: ignore[misc]
    print(json.dumps(counts))


if __name__ == "__main__":
    main()
