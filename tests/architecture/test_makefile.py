"""The targets of `make` do what their help says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys

import pytest
from harness.kept_costs import expensive_tests
from support.places import ROOT

pytestmark = pytest.mark.skipif(shutil.which("make") is None, reason="there is no make here")


def make(*arguments: str) -> subprocess.CompletedProcess[str]:
    # the make that runs these tests passes its own variables on
    theirs = ("MAKEFLAGS", "MFLAGS", "MAKEOVERRIDES", "MAKELEVEL", "PYTHON", "VENV", "INSTALL")
    environment = {name: value for name, value in os.environ.items() if name not in theirs}
    return subprocess.run(
        ["make", *arguments], cwd=ROOT, env=environment, capture_output=True, text=True, timeout=60
    )


def targets() -> set[str]:
    (line,) = re.findall(r"^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    return set(line.split())


def test_help_names_every_target() -> None:
    listed = {line.split()[0] for line in make("help").stdout.splitlines()}
    assert listed == targets()


def test_the_page_for_contributors_names_every_target_they_need() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert [name for name in targets() - {"clean"} if f"make {name}" not in page] == []


def test_a_python_that_is_given_has_an_environment_of_its_own() -> None:
    version = f"{sys.version_info[0]}.{sys.version_info[1]}"
    given = make("--dry-run", "--always-make", "demo", f"PYTHON={sys.executable}").stdout
    assert f".venv-{version}/bin/vibroimpact demo" in given
    assert ".venv/bin/vibroimpact demo" in make("--dry-run", "--always-make", "demo").stdout


def test_the_lowest_versions_are_refused_on_another_python() -> None:
    refused = make("oldest", "PYTHON=false")
    assert refused.returncode != 0
    assert "expected Python 3.11" in refused.stderr


def test_the_fast_tests_say_what_they_leave_out() -> None:
    folders = ["tests/architecture", "tests/interval_coverage"]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "--fast",
        "--collect-only",
        "-q",
        "-p",
        "no:cacheprovider",
        *folders,
    ]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
    collected = set(result.stdout.splitlines())
    assert "tests/architecture/test_c_rooms.py::test_folders_of_the_core_look_down_only" in collected
    assert not collected & expensive_tests().keys()
    assert re.search(
        r"^\d+ dear or long tests, and tests/conformance, tests/documentation, tests/end_to_end, .*tests/zoo$",
        result.stdout,
        re.M,
    )


@pytest.mark.parametrize("target", ["demo", "fast", "test", "bench", "lint", "oldest"])
def test_an_installation_says_what_it_does(target: str) -> None:
    commands = make("--dry-run", "--always-make", target, f"OLDEST={sys.executable}").stdout.splitlines()
    installing = [line for line in commands if " pip install" in line]
    assert installing
    assert [line for line in installing if "--quiet" in line or " -q" in line] == []
    assert any(
        line.startswith('echo "Installing vibroimpact and what it needs into .venv') for line in commands
    )
