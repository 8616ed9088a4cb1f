"""Kills of a campaign's processes at random times, the command among them, change no bit of its dataset.

The dataset is a file, a store in a folder, or a store in an object store, whose process is not killed.
"""

from __future__ import annotations

import os
import random
import subprocess
import sys
import time
from functools import lru_cache
from pathlib import Path

import psutil
import xarray as xr
from support.campaign_process import BUSY, workers_of
from support.campaign_scenes import TIMING, frequency_text

from soak._homes import KINDS, Home, entry, home_of, left_in
from vibroimpact.analysis.dataset import read_flat
from vibroimpact.analysis.dataset.places import dataset_place
from vibroimpact.analysis.dataset.stores.runs import read_runs

CASES = 60
SAMPLE = 0
SECONDS = 400.0
WAIT_SECONDS = 150.0
"""Longest wall time of one command, s; on an idle machine it takes 4 s."""
MOST_COMMANDS = 6
"""Most commands of one case: all but the last may be killed."""
POINTS = {"independent": 120, "up-down": 60}
MILLISECONDS = 8.0
SHARD_POINTS = 16
LOST_MANIFESTS = 0.3
"""Share of the commands before which `campaign.json` is removed."""
STAMPS = ("history", "date_created", "creation_date")


def check(seed: int) -> str | None:
    """Kill at random, resume to the end, and compare with an undisturbed campaign."""
    with home_of(KINDS[seed % len(KINDS)]) as home:
        return _killed(random.Random(seed), home)


def _killed(chance: random.Random, home: Home) -> str | None:
    path = chance.choice(sorted(POINTS))
    expected = _undisturbed(path)
    scratch = Path("scratch")
    scratch.mkdir()
    Path("scene.toml").write_text(frequency_text(POINTS[path], path, MILLISECONDS))
    for number in range(MOST_COMMANDS):
        if chance.random() < LOST_MANIFESTS:
            (home.path / "campaign.json").unlink(missing_ok=True)
        last = number == MOST_COMMANDS - 1
        code, err = _command("scene.toml", home, scratch, None if last else chance)
        if code is None:
            return f"the command had not ended after {WAIT_SECONDS:.0f} s: {err}"
        if code == 0:
            break
        if code > 0 or last:
            return f"exit code {code}: {err}"
    if left := left_in(scratch):
        return f"left behind in the folder for temporary files: {left}"
    return difference(expected, bits_of(read_runs(dataset_place(home.place))))


Content = tuple[dict[str, tuple[str, bytes]], dict[str, str]]


@lru_cache(maxsize=2)
def _undisturbed(path: str) -> Content:
    """Return the content of an undisturbed campaign, made once in each process."""
    folder = Path(f"undisturbed-{path}")
    folder.mkdir()
    scene = folder / "scene.toml"
    scene.write_text(frequency_text(POINTS[path], path, MILLISECONDS))
    home = Home(str(folder / "campaign"), (), folder / "failing")
    code, err = _command(str(scene), home, folder, None)
    if code != 0:
        raise RuntimeError(f"the undisturbed campaign ended with {code}: {err}")
    return content(folder / "campaign" / "dataset.nc")


def content(dataset: Path) -> Content:
    """Return the content of a file, without attributes that differ between two computations."""
    return bits_of(read_flat(dataset))


def bits_of(flat: xr.Dataset) -> Content:
    """Return the bits of each variable, and the attributes that two computations share."""
    bits = {
        str(name): (
            str({key: str(value) for key, value in variable.attrs.items()}),
            repr(variable.values.tolist()).encode()
            if variable.dtype == object
            else variable.values.tobytes(),
        )
        for name, variable in flat.variables.items()
        if name not in TIMING
    }
    return bits, {key: str(value) for key, value in flat.attrs.items() if key not in STAMPS}


def difference(expected: Content, got: Content) -> str | None:
    for kind, one, other in zip(("variable", "attribute"), expected, got, strict=True):
        for name in sorted(one.keys() | other.keys()):
            if one.get(name) != other.get(name):
                return f"the {kind} {name} differs from that of an undisturbed campaign"
    return None


def _command(scene: str, home: Home, scratch: Path, chance: random.Random | None) -> tuple[int | None, str]:
    """Run a campaign and kill some of its processes; return its exit code (None: it hung) and its messages."""
    arguments = ["BusyRunner", "campaign", scene, "-o", home.place, "--workers", "2", *home.options]
    with subprocess.Popen(
        [sys.executable, "-c", entry(SHARD_POINTS, BUSY), *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"TMPDIR": str(scratch.absolute())},
    ) as process:
        try:
            if chance is not None:
                _kill_some(process, chance)
            _, err = process.communicate(timeout=WAIT_SECONDS)
            outlived = _still_there(process.pid)
            return (
                (1, f"processes outlived it: {outlived}") if outlived else (process.returncode, err[-1000:])
            )
        except subprocess.TimeoutExpired:
            process.kill()
            return None, process.communicate()[1][-1000:]
        finally:
            for left in _session(process.pid):
                _kill(left)


def _kill_some(process: subprocess.Popen[str], chance: random.Random) -> None:
    """Kill one to four times: workers, and in one case of six the command itself."""
    for _ in range(chance.randint(1, 4)):
        pause = chance.expovariate(1.0)
        try:
            process.wait(min(pause, 5.0))
            return
        except subprocess.TimeoutExpired:
            pass
        victims = sorted(worker.pid for worker in workers_of(process.pid))
        if chance.random() < 1 / 6:
            process.kill()
        elif victims:
            _kill(chance.choice(victims))


def _kill(process: int) -> None:
    try:
        psutil.Process(process).kill()
    except psutil.Error:
        return  # it ended by itself


def _still_there(session: int) -> list[int]:
    """Return the processes of a session that are still alive after some seconds."""
    deadline = time.monotonic() + 20.0
    while (left := _session(session)) and time.monotonic() < deadline:
        time.sleep(0.05)
    return left


def _session(session: int) -> list[int]:
    found = []
    for process in psutil.pids():
        try:
            if os.getsid(process) == session and psutil.Process(process).status() != psutil.STATUS_ZOMBIE:
                found.append(process)
        except (ProcessLookupError, psutil.Error):
            continue
    return found
