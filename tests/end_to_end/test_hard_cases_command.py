"""`vibroimpact hard-cases`: a table, a dataset, a figure; missed bounds, unknown names, Ctrl-C."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support.command_line import in_this_process

from vibroimpact.analysis.dataset import open_measured
from vibroimpact.orchestrator.hard_cases import CASES
from vibroimpact.orchestrator.hard_cases.case import Found


def test_the_cases_that_are_asked_for_leave_a_table_a_dataset_and_a_figure(tmp_path: Path) -> None:
    output, figure = tmp_path / "cases.nc", tmp_path / "cases.png"
    only = ["--only", "chatter", "--only", "grazing-from-below"]
    done = in_this_process("hard-cases", *only, "-o", str(output), "--figure", str(figure))
    assert done.returncode == 0, done.stderr
    assert "2 of 2 bounds met." in done.stdout
    assert figure.stat().st_size > 10_000
    with open_measured(output) as found:
        assert found.name.values.tolist() == ["grazing-from-below", "chatter"]
        assert bool(found.is_met.all())
    drawn = in_this_process("plot", str(output), "-o", str(tmp_path / "again.png"))
    assert drawn.returncode == 0, drawn.stderr


def test_all_names_are_listed_without_running_any() -> None:
    done = in_this_process("hard-cases", "--list")
    assert [line.partition(":")[0] for line in done.stdout.splitlines()] == [case.name for case in CASES]


def test_a_missed_bound_ends_with_1(monkeypatch: pytest.MonkeyPatch) -> None:
    case = replace(CASES[0], name="never", bound=1e-30)
    monkeypatch.setattr("vibroimpact.orchestrator.hard_cases.measuring.CASES", (case,))
    done = in_this_process("hard-cases")
    assert done.returncode == 1
    assert "0 of 1 bound met. Wrong: never." in done.stdout


def test_a_name_that_is_none_ends_with_2_and_leaves_nothing(tmp_path: Path) -> None:
    done = in_this_process("hard-cases", "--only", "chater", "-o", str(tmp_path / "cases.nc"))
    assert done.returncode == 2
    assert done.stderr.strip().endswith("Did you mean chatter?")
    assert list(tmp_path.iterdir()) == []


def test_what_was_measured_before_an_interrupt_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt() -> Found:
        raise KeyboardInterrupt

    cases = (CASES[1], replace(CASES[0], name="interrupted", measure=interrupt), CASES[4])
    monkeypatch.setattr("vibroimpact.orchestrator.hard_cases.measuring.CASES", cases)
    output = tmp_path / "cases.nc"
    done = in_this_process("hard-cases", "-o", str(output))
    assert done.returncode == 130
    assert "Interrupted: 1 of 3 cases were measured." in done.stderr
    with open_measured(output) as found:
        assert found.name.values.tolist() == ["grazing-from-below"]
