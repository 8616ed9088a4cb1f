"""A command is built from the declaration of its operation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import pytest
import typer
from support.command_line import in_this_process
from typer.testing import CliRunner

from vibroimpact.fmus.operations import Operation, Option, Positional, operation
from vibroimpact.orchestrator.commands.table import COMMANDS, GROUPS, PANELS, paths
from vibroimpact.orchestrator.commands.typer_form import as_function

asked: list[Operation] = []


def keep(given: Operation) -> None:
    asked.append(given)


@operation(f"{__name__}:keep")
class Weigh(Operation):
    """Weigh a file."""

    file: Annotated[Path, Positional(help="What is weighed.")]
    least: Annotated[float, Option("--from", help="Mass, kg.", min=0.0)] = 1.0
    names: Annotated[list[str] | None, Option("--name", help="Of it; again for more.")] = None
    wet: Annotated[bool, Option("--wet", help="Not dried.")] = False


def weigh(*words: str, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(Weigh, "carry_out", keep)
    app = typer.Typer()
    app.command()(as_function(Weigh))
    asked.clear()
    return CliRunner().invoke(app, words).exit_code


def test_options_become_the_fields_of_the_operation(monkeypatch: pytest.MonkeyPatch) -> None:
    assert weigh("a.nc", "--from", "2", "--name", "x", "--name", "y", "--wet", monkeypatch=monkeypatch) == 0
    assert asked == [Weigh(file=Path("a.nc"), least=2.0, names=["x", "y"], wet=True)]


def test_what_is_not_typed_has_its_default(monkeypatch: pytest.MonkeyPatch) -> None:
    assert weigh("a.nc", monkeypatch=monkeypatch) == 0
    assert asked == [Weigh(file=Path("a.nc"))]


@pytest.mark.parametrize(
    "words", [(), ("a.nc", "--from", "-1"), ("a.nc", "--from", "x"), ("a.nc", "--no-wet")]
)
def test_words_that_break_the_declaration_are_misuse(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert weigh(*words, monkeypatch=monkeypatch) == 2
    assert asked == []


def test_each_command_and_group_has_one_panel() -> None:
    shown = [name for names in PANELS.values() for name in names]
    assert sorted(shown) == sorted([*COMMANDS, *GROUPS])
    assert len(paths()) == len(COMMANDS) + sum(len(group.commands) for group in GROUPS.values())


@pytest.mark.parametrize("words", [("nonsense",), ("fmu", "exprt"), ("fmu", "--nonsense")])
def test_a_command_that_is_none_is_misuse(words: tuple[str, ...]) -> None:
    assert in_this_process(*words).returncode == 2


def test_a_misspelt_command_of_a_group_is_answered_with_the_nearest_one() -> None:
    assert "export" in in_this_process("fmu", "exprt").stderr
