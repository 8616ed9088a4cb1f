"""`--budget`: the processor time of all tests against a stored figure, and a list of the most expensive tests.

The processor time of a busy machine varies. So it is counted in yardsticks: a fixed piece of Python and C that each
worker runs now and then.
"""

from __future__ import annotations

import statistics
import time
import tomllib
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from harness import kept_costs, warm

KEPT = Path(__file__).with_name("budget.toml")
LISTED = 20
MAY_GROW = 0.1
"""Share of the stored figure by which processor time may grow."""
SHARED = "shared fixtures: services, clusters, folders"
"""Entry among the most expensive tests for the end of fixtures that outlive a worker's last test."""
EVERY = 20.0
"""Wall time between two yardsticks of a worker, s."""


def processor_time() -> float:
    """Return the processor time of this process and of its ended children, s."""
    import resource  # not on Windows

    each = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in each)


def _seconds_used() -> float:
    return processor_time() + warm.seconds_used()


def yardstick() -> float:
    """Return the processor time of a fixed piece of Python and C, s."""
    began = time.process_time()
    numbers = [number * number % 1009 for number in range(40_000)]
    counted = Counter(numbers)
    packed = zlib.compress(",".join(map(str, numbers)).encode(), 9)
    assert len(counted) == 505
    assert zlib.decompress(packed).startswith(b"0,1,4,9,")
    return time.process_time() - began


class Costs:
    """Costs of the tests of this process, and of its copies once they have ended."""

    def __init__(self) -> None:
        self.tests: dict[str, float] = {}
        self.shared = self._ends = 0.0
        self.modules: Counter[str] = Counter()
        self.yardsticks = [yardstick()]
        self._measured = time.monotonic()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Any:
        """Measure the processor time of a test, its fixtures and its ended processes."""
        before, self._ends = _seconds_used(), 0.0
        try:
            return (yield)
        finally:
            self.tests[item.nodeid] = _seconds_used() - before - self._ends
            if time.monotonic() - self._measured > EVERY:
                self.yardsticks.append(yardstick())
                self._measured = time.monotonic()

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, nextitem: pytest.Item | None) -> Any:
        """Measure the fixtures that end with the last test of this worker, but do not belong to that test alone."""
        before = _seconds_used()
        try:
            return (yield)
        finally:
            if nextitem is None:
                self._ends = self.shared = _seconds_used() - before

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.modules[report.nodeid.partition("::")[0]] += report.duration

    def pytest_handed_over(self) -> dict[str, Any]:
        return {"costs": (self.tests, self.shared, self.yardsticks)}

    def pytest_taken_over(self, given: dict[str, Any]) -> None:
        tests, shared, yardsticks = given["costs"]
        self.tests |= tests
        self.shared += shared
        self.yardsticks += yardsticks


COSTS = pytest.StashKey[Costs]()
TOTAL = pytest.StashKey[tuple[float, float]]()
"""Processor time of the whole session, s, and the same in yardsticks."""


def pytest_addoption(parser: pytest.Parser) -> None:
    text = "fail if the processor time of all tests exceeds the stored figure; list the most expensive tests"
    parser.addoption("--budget", action="store_true", help=text)
    text = f"write {kept_costs.FILE.name}: the order of modules, and the tests that --fast leaves out"
    parser.addoption("--keep-costs", action="store_true", help=text)


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("budget") or config.getoption("keep_costs"):
        config.stash[COSTS] = Costs()
        config.pluginmanager.register(config.stash[COSTS])


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    config = session.config
    if COSTS not in config.stash:
        return
    # afterwards this process has waited for all of its children
    warm.end_server()
    costs, seconds = config.stash[COSTS], processor_time()
    costs.yardsticks.append(yardstick())
    config.stash[TOTAL] = seconds, seconds / statistics.mean(costs.yardsticks)
    ended = session.exitstatus in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED)
    if config.getoption("keep_costs") and ended:
        kept_costs.keep(costs.modules, costs.tests)
    if config.getoption("budget") and session.exitstatus == pytest.ExitCode.OK and _excess(config) > MAY_GROW:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def kept_yardsticks() -> float:
    """Return the stored processor time of all tests, in yardsticks."""
    return float(tomllib.loads(KEPT.read_text(encoding="utf-8"))["yardsticks"])


def _excess(config: pytest.Config) -> float:
    return config.stash[TOTAL][1] / kept_yardsticks() - 1.0


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Write the most expensive tests and the sum."""
    if TOTAL not in config.stash:
        return
    costs, (seconds, yardsticks) = config.stash[COSTS], config.stash[TOTAL]
    terminalreporter.section(f"processor time: the {LISTED} dearest tests")
    for name, took in sorted((costs.tests | {SHARED: costs.shared}).items(), key=lambda item: -item[1])[
        :LISTED
    ]:
        terminalreporter.line(f"{took:7.1f} s  {name}")
    each = statistics.mean(costs.yardsticks)
    terminalreporter.line(
        f"All tests and their processes took {seconds:.0f} s, {yardsticks:.0f} yardsticks of {each * 1e3:.1f} ms."
    )
    if config.getoption("budget") and (excess := _excess(config)) > MAY_GROW:
        terminalreporter.line(
            f"ERROR: this is {excess:.0%} above the {kept_yardsticks():.0f} that tests/harness/{KEPT.name} keeps; "
            f"expected at most {MAY_GROW:.0%}. Make tests cheaper, or raise the figure and say why beside it.",
            red=True,
        )
