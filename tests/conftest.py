"""The tests of `--fast`; seed and number of examples of every property test. The end of a run reports both."""

from __future__ import annotations

import functools
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import hypothesis
import pytest
from _pytest.doctest import DoctestModule
from harness.kept_costs import EXPENSIVE_FIXTURE, expensive_tests, whole_modules
from harness.warm import WITHOUT_THREADS
from hypothesis.errors import UnsatisfiedAssumption

# Container images often forbid bytecode. Each worker would then rewrite the assertions of every test module, and each
# process started by a test would compile the whole package.
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
# before a test imports numpy and pyarrow: this process is forked
os.environ |= WITHOUT_THREADS

pytest_plugins = ["harness.costs", "harness.side_by_side", "support.cluster", "support.object_store"]

SEED = 4
"""Seed of every property test: a run can be repeated anywhere; `--hypothesis-seed=N` sets another."""

COUNTS = pytest.StashKey[dict[str, list[int]]]()
LEFT_OUT = pytest.StashKey[int]()
"""Number of tests that `--fast` leaves out of its folders."""

TESTS = Path(__file__).parent
FAST_FOLDERS = ("architecture", "unit")
"""The folders of `--fast`."""


def pytest_addoption(parser: pytest.Parser) -> None:
    text = f"run only the tests of {' and '.join(FAST_FOLDERS)} that are neither expensive nor long"
    parser.addoption("--fast", action="store_true", help=text)
    where = "a board for the tests of rigs: Dev1 of this machine, or grpc://HOST:PORT/Dev1"
    parser.addoption("--real-rig", metavar="BOARD", help=where)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    if not config.getoption("fast") or TESTS not in collection_path.parents:
        return None
    return True if collection_path.relative_to(TESTS).parts[0] not in FAST_FOLDERS else None


@pytest.hookimpl(wrapper=True)
def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> Any:
    """Let `--doctest-modules` look for examples only in the package, whose path is given next to the tests."""
    found = yield
    return [one for one in found if not (isinstance(one, DoctestModule) and TESTS in file_path.parents)]


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("fast"):
        return
    left_out = _left_out(items)
    config.stash[LEFT_OUT] = len(left_out)
    config.hook.pytest_deselected(items=left_out)
    excluded = set(left_out)
    items[:] = [item for item in items if item not in excluded]


def _left_out(items: list[pytest.Item]) -> list[pytest.Item]:
    """Return the expensive and long tests, and those of modules with an expensive fixture; every room keeps some."""
    costs, whole = expensive_tests(), whole_modules()
    short = [item for item in items if not item.get_closest_marker("long")]
    cheap = [item for item in short if item.nodeid not in costs]
    stay: list[pytest.Item] = []
    for chosen in (
        [item for item in cheap if item.nodeid.partition("::")[0] not in whole],
        cheap,
        [item for item in short if costs.get(item.nodeid, 0.0) < EXPENSIVE_FIXTURE],
    ):
        rooms = {item.path.parent for item in stay}
        stay += [item for item in chosen if item.path.parent not in rooms]
    staying = set(stay)
    return [item for item in items if item not in staying]


def _seed(config: pytest.Config) -> int | str:
    chosen = config.getoption("hypothesis_seed", None)
    if chosen is None:
        return SEED
    return int(chosen) if str(chosen).isdigit() else str(chosen)


def _counted(function: Callable[..., Any], count: list[int]) -> Callable[..., Any]:
    @functools.wraps(function)
    def run(*arguments: Any, **named: Any) -> Any:
        count[0] += 1
        try:
            return function(*arguments, **named)
        except UnsatisfiedAssumption:
            count[1] += 1
            raise

    return run


def _draw_the_same_whatever_is_loaded() -> None:
    """Keep hypothesis from drawing constants of whichever modules of this project happen to be loaded.

    The loaded modules depend on the earlier tests of a worker, so a run could not be repeated. Hypothesis has no
    setting for it; if its internals differ, nothing is changed.
    """
    from hypothesis.internal.conjecture import providers

    if hasattr(providers, "_get_local_constants") and hasattr(providers, "_local_constants"):
        providers._get_local_constants = lambda: providers._local_constants


def pytest_configure(config: pytest.Config) -> None:
    # no example fails for its time: the machine may be busy, and the first drawn text makes a table of all characters
    too_slow = [hypothesis.HealthCheck.too_slow]
    hypothesis.settings.register_profile("without a clock", deadline=None, suppress_health_check=too_slow)
    hypothesis.settings.load_profile("without a clock")
    _draw_the_same_whatever_is_loaded()
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        # a shell lets background jobs ignore SIGINT: tests send Ctrl-C, also to the processes that they start
        signal.signal(signal.SIGINT, signal.default_int_handler)
    config.stash.setdefault(COUNTS, {})


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item: pytest.Item) -> Any:
    """Count the examples of a hypothesis test, and seed it."""
    function = getattr(item, "obj", None)
    if not hypothesis.is_hypothesis_test(function):
        return (yield)
    counts = item.config.stash.setdefault(COUNTS, {})
    count = counts.setdefault(item.nodeid, [0, 0])
    handle = function.hypothesis  # type: ignore[union-attr]
    original, seed = handle.inner_test, _seed(item.config)
    if isinstance(seed, int):
        hypothesis.seed(seed)(function)
    handle.inner_test = _counted(original, count)
    try:
        return (yield)
    finally:
        handle.inner_test = original


def pytest_handed_over(config: pytest.Config) -> dict[str, Any]:
    """Return the numbers of examples tried by a copy of this process."""
    return {"examples": config.stash.get(COUNTS, {})}


def pytest_taken_over(config: pytest.Config, given: dict[str, Any]) -> None:
    """Add the numbers of examples tried by a copy of this process."""
    config.stash.setdefault(COUNTS, {}).update(given["examples"])


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Write the numbers of tried examples and of left-out tests."""
    _write_examples(terminalreporter, config)
    if config.getoption("fast"):
        folders = sorted({path.relative_to(TESTS).parts[0] for path in TESTS.glob("*/**/test_*.py")})
        left_out = [f"tests/{folder}" for folder in folders if folder not in FAST_FOLDERS]
        terminalreporter.section("left out")
        terminalreporter.line(
            f"{config.stash.get(LEFT_OUT, 0)} dear or long tests, and {', '.join(left_out)}"
        )


def _write_examples(terminalreporter: Any, config: pytest.Config) -> None:
    counts = config.stash.get(COUNTS, {})
    if not counts:
        return
    total = sum(tried for tried, _ in counts.values())
    terminalreporter.section(f"property tests: seed {_seed(config)}, {total} examples")
    for name, (tried, left_out) in sorted(counts.items()):
        note = f" ({left_out} of them outside the property's range)" if left_out else ""
        terminalreporter.line(f"{tried:6d} examples{note}: {name.split('::', 1)[-1]}")
