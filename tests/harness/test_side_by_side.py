"""Forked workers run the same tests as one process; none of them loses a test when it dies."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import TESTS

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="workers are forked on Linux alone"),
]

SUITE = """
import os, warnings
import pytest

@pytest.fixture(scope="module")
def made():
    yield os.getpid()
    with open("ended", "a") as ended:
        print(os.getpid(), file=ended)

@pytest.mark.parametrize("number", range(8))
def test_number(number, made, tmp_path):
    assert made == os.getpid()
    (tmp_path / "file").touch()
    print("number", number)
    assert number != 3

@pytest.mark.skip(reason="no need")
def test_left_out():
    pass

def test_remark():
    warnings.warn("a remark")
"""
DEADLY = "import os\n\ndef test_it():\n    os.abort()\n\ndef test_another():\n    pass\n"


def run(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    (folder / "pytest.ini").touch()
    plugins = ("-p", "harness.costs", "-p", "harness.side_by_side", "-p", "no:cacheprovider", "--cold")
    command = [sys.executable, "-m", "pytest", *plugins, *options]
    environment = os.environ | {"PYTHONPATH": str(TESTS)}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=60)


def counts(done: subprocess.CompletedProcess[str]) -> list[str]:
    return sorted(re.findall(r"\d+ (?:passed|failed|skipped|warning)", done.stdout.splitlines()[-1]))


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    for name in ("one", "two"):
        (tmp_path / f"test_{name}.py").write_text(SUITE)
    return tmp_path


def test_workers_say_what_one_process_says(suite: Path) -> None:
    alone, together = run(suite), run(suite, "--side-by-side", "3")
    assert counts(alone) == counts(together) == ["16 passed", "2 failed", "2 skipped", "2 warning"]
    assert alone.returncode == together.returncode == 1
    for done in (alone, together):
        assert done.stdout.count("number 3") == 2
        assert "number 4" not in done.stdout
    assert len((suite / "ended").read_text().split()) >= 4


def test_a_worker_that_dies_fails_its_test_and_all_others_are_run(suite: Path) -> None:
    (suite / "test_zero.py").write_text(DEADLY)
    done = run(suite, "--side-by-side", "2")
    assert counts(done) == ["17 passed", "2 skipped", "2 warning", "3 failed"]
    assert "test_zero.py::test_it: the worker that ran it was ended by SIGABRT." in done.stdout


def test_the_first_failure_ends_the_session_where_that_is_asked(suite: Path) -> None:
    done = run(suite, "--side-by-side", "2", "-x")
    assert "1 failed" in counts(done) or "2 failed" in counts(done)
    # the other worker's test may have failed in the meantime
    assert re.search(r"stopping after [12] failures", done.stdout)


@pytest.mark.parametrize(("kept", "code"), [(1e9, 0), (1.0, 1)])
def test_processor_time_above_the_kept_figure_is_an_error(kept: float, code: int, suite: Path) -> None:
    budget = suite / "budget.toml"
    budget.write_text(f"yardsticks = {kept}\n")
    conftest = "from pathlib import Path\nimport harness.costs\n"
    (suite / "conftest.py").write_text(f"{conftest}harness.costs.KEPT = Path({str(budget)!r})\n")
    done = run(suite, "--side-by-side", "2", "--budget", "-k", "not number[3]")
    assert done.returncode == code, done.stdout
    assert re.search(r"All tests and their processes took \d+ s, \d+ yardsticks", done.stdout)
    assert "test_one.py::test_number[0]" in done.stdout.partition("dearest tests")[2]
    assert ("above the 1 that tests/harness/budget.toml keeps" in done.stdout) == (code == 1)
