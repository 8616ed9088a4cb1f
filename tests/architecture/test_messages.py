"""Commands accept all options and arguments that messages tell a user to type."""

from __future__ import annotations

import ast
import shlex
from collections.abc import Iterator
from typing import Any

import typer
from support.places import ROOT

from vibroimpact.fmus.messages import Argument
from vibroimpact.orchestrator.commands.cli import app
from vibroimpact.orchestrator.commands.typer_form import add_commands

PACKAGES = ("analysis", "door", "fmus", "hardware", "orchestrator", "service")


def options_of(command: Any) -> Iterator[str]:
    """Yield the options of a command, or of all commands of a group."""
    for inner in getattr(command, "commands", {}).values():
        yield from options_of(inner)
    for parameter in command.params:
        yield from (*parameter.opts, *parameter.secondary_opts)


def arguments_in(text: str) -> Iterator[Argument]:
    """Yield the arguments that the messages of a module name literally."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Argument":
            words = [each.value if isinstance(each, ast.Constant) else "1" for each in node.args]
            if isinstance(node.args[0], ast.Constant):
                yield Argument(*words)


def test_every_argument_that_a_message_names_is_an_option_of_a_command() -> None:
    whole = typer.Typer()
    add_commands(whole)
    known = {*options_of(typer.main.get_command(whole)), *options_of(typer.main.get_command(app))}
    paths = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    texts = [path.read_text(encoding="utf-8") for path in paths]
    named = [one for text in texts if "fmus.messages" in text for one in arguments_in(text)]
    assert len(named) > 50
    assert {shlex.split(one.typed)[0] for one in named} <= known
