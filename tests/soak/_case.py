"""The child process: reads `[kind, seed]` line by line, tries each case, answers `[seconds, problem]`."""

from __future__ import annotations

import faulthandler
import json
import os
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

from soak._kinds import load


def attempt(name: str, package: str, seed: int) -> tuple[float, str | None]:
    """Try one case in an empty folder of its own; return its processor time in s and its problem."""
    before, parent = Path.cwd(), tempfile.tempdir
    folder = tempfile.mkdtemp(prefix=f"{name}-{seed}-")
    check = load(name, package)
    began = _processor_time()
    try:
        os.chdir(folder)
        tempfile.tempdir = folder
        problem = check(seed)
    except Exception as error:
        problem = _described(error)
    finally:
        seconds = _processor_time() - began
        os.chdir(before)
        tempfile.tempdir = parent
        shutil.rmtree(folder, ignore_errors=True)
    return seconds, None if problem is None else " ".join(problem.split())


def _processor_time() -> float:
    used = os.times()
    return used.user + used.system + used.children_user + used.children_system


def _described(error: Exception) -> str:
    place = traceback.extract_tb(error.__traceback__)[-1]
    where = f"{Path(place.filename).name}:{place.lineno} ({place.name})"
    return f"{type(error).__name__}: {str(error)[:500]} at {where}"


def serve(package: str) -> None:
    """Answer until the other side ends; a case prints to `log` in the folder where the process starts."""
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    log = os.open("log", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 1)
    os.dup2(log, 2)
    faulthandler.enable()
    if hasattr(faulthandler, "register"):
        # the runner asks a case that does not answer for its stack
        faulthandler.register(signal.SIGUSR1)
    warnings.simplefilter("error")
    for line in sys.stdin:
        os.truncate(log, 0)
        name, seed = json.loads(line)
        answer = attempt(name, package, seed)
        print(json.dumps(answer), file=answers, flush=True)
