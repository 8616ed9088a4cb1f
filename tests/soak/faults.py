"""All faults at once: a campaign of misbehaving FMUs, disturbed in every way, loses and doubles no innocent point.

One point of a hundred segfaults, one hangs, one gives NaN. Meanwhile workers are killed and stopped, and the command is
killed. Its disk is full, parts are damaged and the scheduler is restarted; each time the same command goes on. The
result is compared, bit for bit, with an undisturbed one. In an object store requests fail where a disk would be full.
A service that is killed gets as many points of an oscillator, since it loads no foreign FMUs.
"""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import xarray as xr
from support import fmu_factory
from support.campaign_process import fork_servers_of, wait_until, workers_of
from support.command_line import ENTRY

from soak import service_kills
from soak._homes import KINDS, Home, entry, home_of, left_in
from soak.flipped_parts import DAMAGES
from soak.kills import Content, bits_of, difference
from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.analysis.dataset.places import dataset_place
from vibroimpact.analysis.dataset.stores.runs import read_runs
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.orchestrator.campaign.stores.seals import read_seal

CASES = 3
SAMPLE = 0
"""0: `make test` has a campaign of a few hundred points of its own (`tests/end_to_end/test_fault_campaign.py`)."""
SECONDS = 3600.0
POINTS = 10_000
SERVICE_TRANSIENT = 4_000
"""Forcing periods before the recording: a point of the service takes some two milliseconds."""
POINTS_PER_SECOND = 60.0
"""Rate on an idle machine of two processors, with hangs and crashes; it sets the time of a round before its kill."""
DEADLINE = 0.5
STOPPED_SECONDS = 3.0 * DEADLINE
"""Duration for which a process is stopped, s: longer than a point may take."""
WAIT_SECONDS = 1800.0
GUILTY = {4: Outcome.timeout, 7: Outcome.crash, 10: Outcome.error}
"""Outcomes of the inputs whose number modulo 100 is a key (`by_input` of Faulty)."""
FULL = 1024
"""Largest size of a file once the disk counts as full, byte."""
SCENE = """
[scene]
title = "guilty and innocent"
units = "SI"
[component.culprit]
fmu = "{fmu}"
parameters = {{ fault = "by_input", fault_time = 0.35 }}
[record]
recorded_time = 0.5
variables = ["culprit.y"]
rate = 20
[sweep]
"culprit.u" = {{ values = {values} }}
[execution]
macro_step = 0.1
deadline = {deadline}
"""


def check(seed: int) -> str | None:
    """Disturb a campaign of the command line, then one of a service."""
    chance = random.Random(seed)
    rounds = list(ROUNDS)
    chance.shuffle(rounds)
    return disturbed(chance, POINTS, rounds, KINDS[seed % len(KINDS)]) or service_kills.disturbed(
        chance, "independent", POINTS, SERVICE_TRANSIENT
    )


def disturbed(chance: random.Random, points: int, rounds: list[str], kind: str) -> str | None:
    """Disturb a campaign in a kind of home in each of the named ways, in order, let it end, and compare.

    A store has shards of a sixteenth of the points. Points in no order lie one after the other in a store.
    """
    with home_of(kind) as home:
        return _disturbed(chance, points, rounds, home)


def _disturbed(chance: random.Random, points: int, rounds: list[str], home: Home) -> str | None:
    values = list(map(float, range(points)))
    if chance.random() < 0.5:
        chance.shuffle(values)
    Path("scene.toml").write_text(
        SCENE.format(fmu=fmu_factory.faulty(Path.cwd(), "3.0").name, values=values, deadline=DEADLINE)
    )
    seconds = points / POINTS_PER_SECOND / (len(rounds) + 1)
    program = entry(points // 16, ENTRY)
    if problem := _begun(home, program, 0.2 * seconds):
        return f"the beginning: {problem}"
    for name in rounds:
        problem = ROUNDS[name](chance, home, program, seconds)
        if problem is not None:
            return f"{name}: {problem}"
    code, said = Command(home.place, program).end(by_force=False)
    return _compared(points, home) if code == 0 else f"the last command ended with {code}: {said}"


class Command:
    """`vibroimpact campaign scene.toml -o HOME` in a session of its own."""

    def __init__(self, home: str, program: str = ENTRY, *options: str) -> None:
        Path("scratch").mkdir(exist_ok=True)
        self._errors = Path(f"{home.rpartition('/')[2]}.err")
        arguments = ["campaign", "scene.toml", "-o", home, *(options or ("--workers", "2"))]
        with self._errors.open("w", encoding="utf-8") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-c", program, *arguments],
                stdout=subprocess.DEVNULL,
                stderr=errors,
                start_new_session=True,
                # Python itself leaves truncated compiled modules where the disk is full
                env=os.environ | {"TMPDIR": str(Path("scratch").absolute()), "PYTHONDONTWRITEBYTECODE": "1"},
            )

    def session(self) -> list[psutil.Process]:
        """Return its living processes."""
        found = []
        for process in psutil.process_iter():
            try:
                if os.getsid(process.pid) == self.process.pid and process.status() != psutil.STATUS_ZOMBIE:
                    found.append(process)
            except (ProcessLookupError, psutil.Error):
                continue
        return found

    def workers(self) -> list[psutil.Process]:
        """Return its worker processes."""
        return workers_of(self.process.pid)

    def runs_for(self, seconds: float) -> bool:
        """Wait for a number of seconds; return whether the command still runs."""
        try:
            self.process.wait(max(seconds, 0.0))
        except subprocess.TimeoutExpired:
            return True
        return False

    def said(self) -> str:
        """Return the text of its standard error."""
        return self._errors.read_text(encoding="utf-8")

    def end(self, *, by_force: bool) -> tuple[int | None, str]:
        """Kill it, or wait for its end; return its exit code (None: it hung) and its messages."""
        if by_force:
            self.process.kill()
        try:
            code: int | None = self.process.wait(WAIT_SECONDS)
        except subprocess.TimeoutExpired:
            code = None
        wait_until(lambda: not self.session(), seconds=20.0)
        outlived = self.session()
        for left in outlived:
            left.kill()
        return (1, f"processes outlived it: {outlived}") if outlived else (code, self.said()[-2000:])


def _begun(home: Home, program: str, seconds: float) -> str | None:
    """Begin the campaign in a format, which all later commands keep, and kill the command."""
    command = _started(home, program, "--workers", "2", *home.options)
    command.runs_for(seconds)
    return _killed(command)


def _started(home: Home, program: str, *options: str) -> Command:
    """Start the command and wait until it has computed some points."""
    before = _parts_there(home)
    command = Command(home.place, program, *options)
    wait_until(lambda: command.process.poll() is not None or _parts_there(home) - before != set())
    return command


def _parts_there(home: Home) -> set[str]:
    return {path.name for path in [*home.files("parts", "branch-"), *home.files("seals", "shard-")]}


# ---- rounds: each returns None or a problem ----


def _workers(chance: random.Random, home: Home, program: str, seconds: float) -> str | None:
    """Kill and stop workers and their fork server; stop all processes now and then, as Ctrl-Z and a closed lid do."""
    command, end = _started(home, program), time.monotonic() + seconds
    while command.runs_for(min(chance.expovariate(0.5), end - time.monotonic())):
        if time.monotonic() >= end:
            break
        workers = command.workers() + fork_servers_of(command.process.pid)
        draw = chance.random()
        if workers and draw < 0.4:
            _signal([chance.choice(workers)], signal.SIGKILL)
        elif workers:
            stopped = [chance.choice(workers)] if draw < 0.7 else command.session()
            _signal(stopped, signal.SIGSTOP)
            time.sleep(STOPPED_SECONDS)
            _signal(stopped, signal.SIGCONT)
    return _killed(command)


def _client(_chance: random.Random, home: Home, program: str, seconds: float) -> str | None:
    command = _started(home, program)
    command.runs_for(seconds)
    return _killed(command)


def _killed(command: Command) -> str | None:
    """Kill a command that still runs; a command that has ended must have ended well."""
    over = command.process.poll()
    code, said = command.end(by_force=True)
    return None if over in (None, 0) and code in (0, -signal.SIGKILL) else f"exit code {code}: {said}"


def _disk(_chance: random.Random, home: Home, program: str, seconds: float) -> str | None:
    """Fill the disk from some moment on: no file may grow. At an address many requests fail instead."""
    command = _started(home, program)
    command.runs_for(seconds)
    if home.is_address:
        home.switch.touch()
    for process in command.session() if not home.is_address else ():
        process.rlimit(psutil.RLIMIT_FSIZE, (FULL, FULL))
    code, said = command.end(by_force=False)
    home.switch.unlink(missing_ok=True)
    if code == 0:
        return None
    good = code == 1 and "Make room" in said and "Traceback" not in said
    return None if good else f"exit code {code} with a full disk: {said}"


def _parts(chance: random.Random, home: Home, program: str, seconds: float) -> str | None:
    """Damage parts and shards: each is named. A part that lost only its hash is whole, as in version 0.1."""
    parts = home.files("parts", "branch-")
    damaged = chance.sample(parts, min(3, len(parts)))
    hurt = []
    for part in damaged:
        sound = part.read_bytes()
        part.write_bytes(DAMAGES[chance.choice(sorted(DAMAGES))](chance, sound))
        if part.read_bytes() not in (sound, sound[:-LINE_LENGTH]):
            hurt.append(f"{part.name} was damaged and is removed")
    hurt += [f"{shard} of the store was damaged" for shard in _damaged_shards(chance, home)]
    command = _started(home, program)
    command.runs_for(seconds)
    said = command.said()
    unnamed = [words for words in hurt if words not in said]
    return _killed(command) or (f"not named: {unnamed}: {said[-2000:]}" if unnamed else None)


def _damaged_shards(chance: random.Random, home: Home) -> Iterator[str]:
    """Flip a bit of an object of some sealed shards, and yield their names."""
    seals = home.files("seals", "shard-")
    for seal in chance.sample(seals, min(3, len(seals))):
        objects = read_seal(seal).objects
        place = home.path / "dataset.zarr" / chance.choice(sorted(objects))
        content = bytearray(place.read_bytes())
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
        place.write_bytes(bytes(content))
        yield seal.stem


def _scheduler(chance: random.Random, home: Home, program: str, seconds: float) -> str | None:
    """Kill a worker of an external scheduler, then restart the scheduler in the middle of the campaign."""
    port = _free_port()
    address = f"tcp://127.0.0.1:{port}"
    with _external(port) as first:
        command = _started(home, program, "--scheduler", address)
        command.runs_for(0.3 * seconds)
        chance.choice(first[1:]).kill()
        command.runs_for(0.3 * seconds)
    before = _parts_there(home)
    with _external(port):
        wait_until(lambda: command.process.poll() is not None or _parts_there(home) > before, seconds=120.0)
        over = command.process.poll()
        code, said = command.end(by_force=True)
    good = over in (None, 0) or (over == 1 and "resumes" in said and "Traceback" not in said)
    return None if good and code is not None else f"exit code {code}: {said}"


def _free_port() -> int:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return int(listener.getsockname()[1])


@contextmanager
def _external(port: int) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Start a scheduler and three workers outside of the campaign; kill them at the end."""
    Path("external").mkdir(exist_ok=True)
    commands = [["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]]
    worker = ["worker", f"tcp://127.0.0.1:{port}", "--nthreads", "1", "--no-nanny", "--no-dashboard"]
    commands += [worker] * 3
    started = [
        subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"TMPDIR": str(Path("external").absolute())},
        )
        for arguments in commands
    ]
    try:
        yield started
    finally:
        for process in started:
            process.kill()
            process.wait()


def _signal(processes: list[psutil.Process], number: signal.Signals) -> None:
    for process in processes:
        try:
            process.send_signal(number)
        except psutil.Error:
            continue  # it ended by itself


ROUNDS: dict[str, Callable[[random.Random, Home, str, float], str | None]] = {
    "workers killed and stopped": _workers,
    "the command killed": _client,
    "a full disk": _disk,
    "damaged parts": _parts,
    "a scheduler that is restarted": _scheduler,
}


# ---- results ----


def _compared(points: int, home: Home) -> str | None:
    code, said = Command("undisturbed").end(by_force=False)
    if code != 0:
        return f"the undisturbed campaign ended with {code}: {said}"
    if left := left_in(Path("scratch")):
        return f"left behind in the folder for temporary files: {left}"
    got = read_runs(dataset_place(home.place))
    return _misjudged(got, points) or difference(
        _content(read_flat(Path("undisturbed", "dataset.nc"))), _content(got)
    )


def _misjudged(rows: xr.Dataset, points: int) -> str | None:
    """Name points that are lost, doubled, or blamed wrongly."""
    inputs = rows["u"].values
    if not np.array_equal(np.sort(inputs), np.arange(float(points))):
        return f"{len(inputs)} rows, which are not the {points} points each once"
    expected = np.array([GUILTY.get(int(u) % 100, Outcome.ok) for u in inputs])
    wrong = np.flatnonzero(rows["outcome"].values != expected)
    if wrong.size:
        at = wrong[0]
        outcome = Outcome(rows["outcome"].values[at]).name
        return f"{wrong.size} points misjudged, the first u = {inputs[at]:g}: {outcome}: {rows['message'].values[at]}"
    unnamed = [str(text) for text in rows["message"].values[expected != Outcome.ok] if "culprit" not in text]
    return f"{len(unnamed)} messages do not name the component: {unnamed[0]}" if unnamed else None


def _content(rows: xr.Dataset) -> Content:
    """Return the bits of all variables, without the messages of failed points: their text depends on the place."""
    innocent = rows["outcome"].values == Outcome.ok
    return bits_of(rows.assign(message=rows["message"].where(innocent, "")))
