"""`--side-by-side N`: the tests are collected once, and N forked copies of this process run them.

Each copy has all imports of the collection, and shares its memory. A copy that dies fails its current test, and another
copy continues. If a process cannot be forked, the tests run one after the other.
"""

from __future__ import annotations

import gc
import os
import random
import sys
from collections.abc import Collection, Mapping
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any

import pytest

from harness import kept_costs, warm
from harness._shares import Shares
from harness._worker import run_share
from vibroimpact.fmus.processes.python_child import ending

FORKS = sys.platform == "linux"
"""Whether this system can fork safely: elsewhere system libraries do not survive a fork, or there is none."""


class Hooks:
    """Hooks by which a worker and the collecting process exchange data of their plugins."""

    @pytest.hookspec
    def pytest_handed_over(self, config: pytest.Config) -> dict[str, Any]:
        """Return the data of a worker's plugin after its last test."""
        raise NotImplementedError

    @pytest.hookspec
    def pytest_taken_over(self, config: pytest.Config, given: dict[str, Any]) -> None:
        """Take the data of all plugins of a worker, in one dictionary."""


def pytest_addhooks(pluginmanager: pytest.PytestPluginManager) -> None:
    pluginmanager.add_hookspecs(Hooks)


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "number of forked copies of this process that run the tests, if it can be forked"
    parser.addoption("--side-by-side", type=int, default=0, metavar="N", help=text)
    text = "with --side-by-side: start the modules in a random order, drawn with this seed"
    parser.addoption("--drawn-order", type=int, metavar="SEED", help=text)
    text = "with --side-by-side: start every program cold, and none as a copy of a warm process"
    parser.addoption("--cold", action="store_true", help=text)


def pytest_sessionstart(session: pytest.Session) -> None:
    if _is_active(session.config):
        # its objects are no garbage, and this process does little else
        gc.disable()
        if not session.config.option.cold:
            warm.start_server()


def _is_active(config: pytest.Config) -> bool:
    option = config.option
    return FORKS and option.side_by_side > 0 and not (option.collectonly or option.usepdb)


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> bool | None:
    if not _is_active(session.config) or not session.items or session.testsfailed:
        return None
    warm.refuse_threads()
    warm.wait_for_server()
    with _Workers(session) as workers:
        workers.run()
    return True


def pytest_unconfigure(config: pytest.Config) -> None:
    warm.end_server()


def _module(item: pytest.Item) -> str:
    return item.nodeid.partition("::")[0]


def _group(item: pytest.Item) -> str:
    """Return the group that one worker runs as a whole if possible: a module, or the tests marked `together`."""
    mark = item.get_closest_marker("together")
    return _module(item) if mark is None else str(mark.args[0])


def _seconds(config: pytest.Config, groups: Mapping[str, Collection[str]]) -> dict[str, float]:
    """Return the time of each group of modules, s; with `--drawn-order` random numbers."""
    if config.option.drawn_order is None:
        kept = kept_costs.seconds_of_modules()
        return {name: sum(kept.get(module, 0.0) for module in modules) for name, modules in groups.items()}
    chance = random.Random(config.option.drawn_order)
    return {name: chance.random() for name in sorted(groups)}


class _Workers:
    """The forked processes of a session, and the current task of each."""

    def __init__(self, session: pytest.Session) -> None:
        count = min(session.config.option.side_by_side, len(session.items))
        self._session = session
        each = [_group(item) for item in session.items]
        groups: dict[str, set[str]] = {}
        for name, item in zip(each, session.items, strict=True):
            groups.setdefault(name, set()).add(_module(item))
        whole = {name for name, modules in groups.items() if modules & kept_costs.whole_modules()}
        self._shares = Shares(each, _seconds(session.config, groups), count, whole)
        self._links: list[Connection | None] = [None] * count
        self._pids = [0] * count
        self._running: list[int | None] = [None] * count
        self._following: list[int | None] = [None] * count
        # it contains the workers' own temporary folders
        self._folder: Path = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]

    def __enter__(self) -> _Workers:
        for worker in range(len(self._pids)):
            self._start(worker)
        return self

    def __exit__(self, *_: object) -> None:
        for link in filter(None, self._links):
            link.close()
        for pid in filter(None, self._pids):
            os.waitpid(pid, 0)

    def _start(self, worker: int) -> None:
        here, there = Pipe()
        sys.stdout.flush()
        pid = os.fork()
        if not pid:
            for link in (here, *filter(None, self._links)):
                link.close()
            run_share(self._session, there, self._folder / f"worker{worker}")
        there.close()
        self._links[worker], self._pids[worker] = here, pid
        self._running[worker] = None
        self._following[worker] = self._shares.next(worker)
        here.send(self._following[worker])

    def run(self) -> None:
        """Hand out the tests and pass on the reports, until all tests have run or the session has to end."""
        while living := {link: worker for worker, link in enumerate(self._links) if link is not None}:
            for link in wait(list(living)):
                assert isinstance(link, Connection)
                try:
                    kind, given = link.recv()
                except EOFError:
                    self._ended(living[link])
                else:
                    getattr(self, f"_take_{kind}")(living[link], given)
            if self._session.shouldfail:
                raise self._session.Failed(self._session.shouldfail)
            if self._session.shouldstop:
                raise self._session.Interrupted(self._session.shouldstop)

    def _take_begun(self, worker: int, number: int) -> None:
        link = self._links[worker]
        assert link is not None
        self._running[worker] = number
        self._following[worker] = self._shares.next(worker)
        link.send(self._following[worker])

    def _take_start(self, worker: int, given: dict[str, Any]) -> None:
        self._session.config.hook.pytest_runtest_logstart(**given)

    def _take_finish(self, worker: int, given: dict[str, Any]) -> None:
        self._session.config.hook.pytest_runtest_logfinish(**given)

    def _take_report(self, worker: int, given: dict[str, Any]) -> None:
        config = self._session.config
        report = config.hook.pytest_report_from_serializable(config=config, data=given)
        config.hook.pytest_runtest_logreport(report=report)

    def _take_warning(self, worker: int, given: dict[str, Any]) -> None:
        self._session.config.hook.pytest_warning_recorded.call_historic(kwargs=given)

    def _take_end(self, worker: int, given: dict[str, Any]) -> None:
        self._session.config.hook.pytest_taken_over(config=self._session.config, given=given)
        self._running[worker] = None

    def _ended(self, worker: int) -> None:
        """Wait for a worker whose link is closed; if a test ended it, fail the test and start another worker."""
        link, number = self._links[worker], self._running[worker]
        assert link is not None
        link.close()
        _, status = os.waitpid(self._pids[worker], 0)
        self._links[worker], self._pids[worker] = None, 0
        if number is None and self._following[worker] is None:
            return
        if number is not None:
            self._fail(self._session.items[number], ending(os.waitstatus_to_exitcode(status)))
        if (following := self._following[worker]) is not None:
            self._shares.give_back(worker, following)
            self._start(worker)

    def _fail(self, item: pytest.Item, end: str) -> None:
        words = f"{item.nodeid}: the worker that ran it {end}."
        hook = self._session.config.hook
        where = {"nodeid": item.nodeid, "location": item.location}
        report = pytest.TestReport(
            **where, keywords={}, outcome="failed", longrepr=words, when="call", sections=[], duration=0.0
        )
        hook.pytest_runtest_logreport(report=report)
        hook.pytest_runtest_logfinish(**where)
