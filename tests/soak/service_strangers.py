"""Strangers without the token at the port of a service: others are answered within a second, and no job is lost."""

from __future__ import annotations

import http.client
import multiprocessing
import random
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.sharedctypes import RawArray
from pathlib import Path

import httpx
import psutil
from support.served import Served, scene_file, sweep_text

from soak._strangers import WAYS, Place, attack
from vibroimpact.service.client import RemoteJob, ServiceError

CASES = 20
SAMPLE = 1
SECONDS = 300.0
ALONE = True
JOBS = 3
POINTS, TRANSIENT = 60, 20_000
ATTACKERS = 2
ATTACKED_SECONDS = 12.0
LOOK_SECONDS = 0.2
"""Pause between two looks at the service, s."""
ANSWER_SECONDS = 1.0
"""Time in which each question is answered, s, on two cores."""
PATIENCE_SECONDS = 10.0
"""Time after which a question counts as unanswered, s."""
MOST_GROWTH = 200 * 2**20
"""Growth of the memory of the service above which the case has a problem, byte."""
MOST_LOG = 2**20
"""Size of the log of the service above which the case has a problem, byte."""
WAIT_SECONDS = 120.0
"""Time after which jobs that have not ended are a problem, s."""
END_SECONDS = 10.0
"""Time that a stranger has to close its connections once the attack is over, s."""


def check(seed: int) -> str | None:
    """Serve jobs while strangers attack."""
    chance = random.Random(seed)
    ways = chance.sample(sorted(WAYS), chance.randint(1, len(WAYS)))
    served = Served(Path("service").absolute())
    try:
        with served.client() as service:
            scene = scene_file(Path.cwd(), sweep_text(POINTS, TRANSIENT))
            jobs = [service.submit(scene, workers=1) for _ in range(JOBS)]
            problem = attacked(served, jobs, ways, seed) or lost(jobs)
    finally:
        served.stop()
    problem = problem or logged(served.log)
    return problem and f"{', '.join(ways)}: {problem}"


class Watch:
    """Asks a service the usual questions, and notes the longest time of each question and the largest memory.

    Parameters
    ----------
    served : Served
    job : RemoteJob
        One of its jobs, for the question of a status.

    Attributes
    ----------
    slowest : dict
        Longest time of an answer by question, s.
    work : float
        Most processor time that the service used while one question waited, s. It bounds the service's own part of
        `slowest` where other programs keep the cores busy.
    growth : int
        Largest growth of the memory of the service since the watch began, byte.
    """

    def __init__(self, served: Served, job: RemoteJob) -> None:
        place = _place(served)
        token = {"Authorization": f"Bearer {(served.folder / 'token').read_text().strip()}"}
        self._questions: dict[str, Callable[[], object]] = {
            "health": lambda: _ask(place, "/healthz", {}),
            "status": lambda: _ask(place, f"/api/v1/campaigns/{job.id}", token),
            "status on a kept connection": job.refresh,
        }
        self._process = psutil.Process(served.process.pid)
        self._before = self._process.memory_info().rss
        self.slowest = dict.fromkeys(self._questions, 0.0)
        self.work = 0.0
        self.growth = 0

    def look(self) -> str | None:
        """Ask each question once; return the problem of an answer or of the memory."""
        for name, question in self._questions.items():
            began, used = time.monotonic(), self._used()
            try:
                question()
            except (OSError, http.client.HTTPException, ServiceError) as error:
                return f"{name}: no answer in {time.monotonic() - began:.1f} s: {error!r}"
            self.slowest[name] = max(self.slowest[name], time.monotonic() - began)
            self.work = max(self.work, self._used() - used)
            if self.slowest[name] > ANSWER_SECONDS:
                return f"{name}: an answer took {self.slowest[name]:.1f} s"
        self.growth = max(self.growth, self._process.memory_info().rss - self._before)
        return f"its memory grew by {self.growth >> 20} MB" if self.growth > MOST_GROWTH else None

    def _used(self) -> float:
        times = self._process.cpu_times()
        return float(times.user + times.system)

    def __str__(self) -> str:
        """Return its figures."""
        times = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in self.slowest.items())
        return f"slowest {times}; at most {self.work:.2f} s of work for one; memory +{self.growth / 2**20:.0f} MB"


def _place(served: Served) -> Place:
    url = httpx.URL(served.url)
    return url.host, url.port or 0


def _ask(place: Place, path: str, headers: dict[str, str]) -> None:
    """Ask on a new connection, which the service cannot recognize before its head has come."""
    connection = http.client.HTTPConnection(*place, timeout=PATIENCE_SECONDS)
    try:
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        answer.read()
        if answer.status != http.HTTPStatus.OK:
            raise http.client.HTTPException(f"status {answer.status}")
    finally:
        connection.close()


def attacked(served: Served, jobs: Sequence[RemoteJob], ways: list[str], seed: int) -> str | None:
    """Watch a service while strangers attack its port; return its problem, or the reason why nothing was tried."""
    if jobs[-1].refresh().status["state"] != "queued":
        return "no job waited when the strangers came"
    watch, came = Watch(served, jobs[0]), time.time()
    with strangers(_place(served), ways, seed) as opened:
        end = time.monotonic() + ATTACKED_SECONDS
        while time.monotonic() < end:
            if problem := watch.look():
                return problem
            time.sleep(LOOK_SECONDS)
    print(f"{watch}; {sum(opened)} connections of strangers", flush=True)
    if idle := [way for way in ways if not opened[list(WAYS).index(way)]]:
        return f"strangers opened no connection: {', '.join(idle)}"
    began = [job.refresh().status["started"] or 0.0 for job in jobs]
    return None if max(began) > came else "no job began while strangers were there"


@contextmanager
def strangers(
    place: Place, ways: list[str], seed: int, seconds: float = ATTACKED_SECONDS
) -> Iterator[Sequence[int]]:
    """Let strangers attack a port until they have ended; yield their numbers of connections in each of `WAYS`.

    Raises
    ------
    RuntimeError
        A stranger ended in an error: the attack was incomplete.
    """
    forked = multiprocessing.get_context("fork")
    opened = RawArray("q", len(WAYS))
    attackers = [
        forked.Process(target=attack, args=(place, ways[one:] + ways[:one], seed + one, seconds, opened))
        for one in range(ATTACKERS)
    ]
    for attacker in attackers:
        attacker.start()
    try:
        yield opened
        for attacker in attackers:
            attacker.join(END_SECONDS)
        if wrong := [attacker.exitcode for attacker in attackers if attacker.exitcode != 0]:
            raise RuntimeError(f"strangers ended with {wrong}")
    finally:
        for attacker in attackers:
            attacker.kill()
            attacker.join()


def lost(jobs: Sequence[RemoteJob]) -> str | None:
    """Wait for the end of all jobs; return the jobs that were not done at the first attempt."""
    end = time.monotonic() + WAIT_SECONDS
    while any(job.refresh().status["state"] in ("queued", "running") for job in jobs):
        if time.monotonic() > end:
            return f"had not ended after {WAIT_SECONDS:.0f} s: {[job.status['state'] for job in jobs]}"
        time.sleep(LOOK_SECONDS)
    found = [job.status for job in jobs if job.status["state"] != "done" or job.status["attempts"] != 1]
    return f"lost: {found}" if found else None


def logged(log: Path) -> str | None:
    """Return the problem of the log of a service; None without one."""
    if (size := log.stat().st_size) > MOST_LOG:
        return f"the log has {size} byte"
    return "the log has a traceback" if "Traceback" in log.read_text(encoding="utf-8") else None
