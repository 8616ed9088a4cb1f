"""The runner of `make soak`: no case can stop it, every problem is named with its seed, nothing is tried twice."""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from soak import __main__ as soak_main
from soak import _child
from soak.__main__ import main
from soak._journal import Journal, Tried, state_of_the_code
from soak._kinds import SEED_STRIDE, Kind, kind, names
from soak._runner import run

BAD = """
import os, subprocess, sys, tempfile, time, warnings
from pathlib import Path
SECONDS = 0.4

def check(seed):
    case = seed % 10
    if case == 1:
        return "two\\nlines"
    if case == 2:
        raise ValueError("no such law")
    if case == 3:
        print("about to end", flush=True)
        os.abort()
    if case == 4:
        subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)", "left behind by a case"])
        while True:
            pass
    if case == 5:
        time.sleep(600)
    if case == 6:
        warnings.warn("deprecated", DeprecationWarning)
    if case == 7:
        assert list(Path().iterdir()) == []
        assert Path(tempfile.gettempdir()) == Path().absolute()
        Path("left").mkdir()
        Path("left/file").write_text("here")
    if case == 8:
        os._exit(3)
    return None
"""


@pytest.fixture
def kinds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Make a package of two kinds, one of them bad in every way."""
    name = f"kinds_{tmp_path.name}"
    package = tmp_path / "packages" / name
    package.mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "bad.py").write_text(BAD, encoding="utf-8")
    (package / "good.py").write_text("def check(seed):\n    return None\n", encoding="utf-8")
    (package / "_helper.py").touch()
    monkeypatch.syspath_prepend(str(package.parent))
    monkeypatch.setattr(_child, "START_SECONDS", 2.0)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return name


def test_kinds_are_the_modules_of_the_package_with_their_settings(kinds: str) -> None:
    assert names(kinds) == ["bad", "good"]
    assert kind("bad", kinds) == Kind("bad", kinds, 5000, 40, 0.4)
    assert kind("bad", kinds).seed(3, 7) == 3 * SEED_STRIDE + 7
    assert all(kind(name).cases <= SEED_STRIDE for name in names())


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_no_case_stops_the_runner_and_every_problem_is_named(kinds: str, tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.jsonl")
    assert run([kind("bad", kinds)], {"bad": 10}, 2, journal, 120.0, processes=2)
    journal.close()
    problems = {entry.seed % 10: entry.problem for entry in journal.of("bad")}
    assert {case for case, problem in problems.items() if problem is None} == {0, 7, 9}
    assert problems[1] == "two lines"
    assert str(problems[2]).startswith("ValueError: no such law at bad.py:")
    assert "SIGABRT" in str(problems[3])
    assert "no answer after" in str(problems[4])
    assert "(check)" in str(problems[4])
    assert "no answer after" in str(problems[5])
    assert "DeprecationWarning: deprecated" in str(problems[6])
    assert "exit code 3" in str(problems[8])
    assert [path.name for path in tmp_path.glob("vibroimpact-soak-*")] == []
    deadline = time.monotonic() + 5.0
    while alive := [p.pid for p in psutil.process_iter() if "left behind by a case" in _words(p)]:
        assert time.monotonic() < deadline, alive
        time.sleep(0.1)


def _words(process: psutil.Process) -> str:
    try:
        return " ".join(process.cmdline())
    except psutil.Error:
        return ""


def test_a_run_goes_on_where_it_ended_and_tries_nothing_twice(kinds: str, tmp_path: Path) -> None:
    path, reported = tmp_path / "journal.jsonl", []
    first = Journal(path)
    assert run([kind("good", kinds)], {"good": 3}, 0, first, 60.0, processes=1)
    first.close()
    # the file of a machine that lost power in the middle of a line
    path.write_text(path.read_text() + '{"kind": "good", "ca')
    second = Journal(path)
    assert run([kind("good", kinds)], {"good": 5}, 0, second, 60.0, processes=1, report=reported.append)
    second.close()
    assert [entry.case for entry in reported] == [3, 4]
    third = Journal(path)
    third.close()
    assert [entry.case for entry in third.of("good")] == [0, 1, 2, 3, 4]


def test_kinds_advance_by_equal_shares_and_the_end_of_the_time_is_said(kinds: str, tmp_path: Path) -> None:
    journal, reported = Journal(tmp_path / "journal.jsonl"), list[Tried]()
    both = [kind("good", kinds), kind("bad", kinds)]
    assert not run(both, {"good": 8, "bad": 8}, 5, journal, 0.0, processes=1, report=reported.append)
    assert reported == []
    assert run(both, {"good": 2, "bad": 1}, 5, journal, 60.0, processes=1, report=reported.append)
    assert [entry.kind for entry in reported] == ["bad", "good", "good"]
    journal.close()


def test_cases_that_measure_time_come_first_and_alone(kinds: str, tmp_path: Path) -> None:
    journal, reported = Journal(tmp_path / "journal.jsonl"), list[Tried]()
    both = [kind("bad", kinds), replace(kind("good", kinds), is_alone=True)]
    assert run(both, {"good": 3, "bad": 1}, 5, journal, 60.0, processes=2, report=reported.append)
    assert [entry.kind for entry in reported] == ["good"] * 3 + ["bad"]
    journal.close()
    assert kind("service_strangers").is_alone


def test_few_long_cases_wait_for_no_more_than_their_share_of_many_short_ones(
    kinds: str, tmp_path: Path
) -> None:
    journal, reported = Journal(tmp_path / "journal.jsonl"), list[Tried]()
    both = [kind("good", kinds), replace(kind("good", kinds), name="better")]
    (tmp_path / "packages" / kinds / "better.py").write_text(
        "def check(seed):\n    return None\n", encoding="utf-8"
    )
    assert run(both, {"good": 400, "better": 4}, 0, journal, 120.0, processes=1, report=reported.append)
    journal.close()
    places = [place for place, entry in enumerate(reported) if entry.kind == "better"]
    assert len(reported) == 404
    assert all(abs(place - 100 * number) <= 8 for number, place in enumerate(places))


def test_what_was_tried_with_other_sources_is_tried_again(tmp_path: Path) -> None:
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus" / "body.c").write_text("int a;")
    before = state_of_the_code(tmp_path)
    (tmp_path / "fmus" / "README.md").write_text("no source")
    assert state_of_the_code(tmp_path) == before
    (tmp_path / "fmus" / "body.c").write_text("int b;")
    assert state_of_the_code(tmp_path) != before


@pytest.mark.parametrize("arguments", [["nothing"], ["extremes", "nothing"], ["extremes", "-1"]])
def test_kinds_that_are_none_are_refused_before_anything_is_tried(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    said = capsys.readouterr().err
    assert said.startswith("soak: kinds: expected some of archives, attractors, ")
    assert said.endswith(f", got {arguments[-1]}.\n")


def test_arguments_choose_the_kinds(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen: list[list[str]] = []
    monkeypatch.setattr(soak_main, "_soak", lambda kinds, *_: chosen.append([one.name for one in kinds]) or 0)
    assert main(["service_strangers"]) == 0
    assert main(["extremes", "scenes"]) == 0
    assert chosen == [["service_strangers"], ["extremes", "scenes"]]
