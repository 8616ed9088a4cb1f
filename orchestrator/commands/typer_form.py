"""Operations as commands of typer: arguments and options are built from the declared ones."""

from __future__ import annotations

import gc
import inspect
import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import MISSING
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from vibroimpact.fmus.operations import Operation, Positional
from vibroimpact.fmus.operations.declaring import ROOT
from vibroimpact.orchestrator.commands.table import COMMANDS, GROUPS, PANELS, first_lines

_PANEL_OF = {name: panel for panel, names in PANELS.items() for name in names}
ORDER = [name for names in PANELS.values() for name in names]
"""Commands and groups in the order of `--help`."""


def add_commands(app: typer.Typer, words: Sequence[str] | None = None) -> None:
    """Add the commands of the package to an app.

    `words` are the typed words without options. The named command is added alone: typer builds one in 2 ms. If they
    name none, commands get only their names and first lines. Without words all commands are added whole.
    """
    called = words[0] if words else ""
    for name in [called] if called in ORDER else ORDER:
        if name in GROUPS:
            _add_group(app, name, None if words is None else words[1:])
        else:
            whole = words is None or name == called
            _add(app, name, COMMANDS[name] if whole else "", _PANEL_OF[name])


def _add_group(app: typer.Typer, name: str, words: Sequence[str] | None) -> None:
    group = GROUPS[name]
    form: type[TyperGroup] | None = pkgutil.resolve_name(f"{ROOT}.{group.form}") if group.form else None
    inner = typer.Typer(no_args_is_help=True, help=group.words, cls=form)
    # a group with its own form looks at all of its commands
    called = words[0] if words and form is None else ""
    whole = words is None or form is not None
    for word in [called] if called in group.commands else group.commands:
        place = group.commands[word] if whole or word == called else ""
        _add(inner, word, place, None, f"{name} {word}")
    app.add_typer(inner, name=name, rich_help_panel=_PANEL_OF[name])


def _add(app: typer.Typer, name: str, place: str, panel: str | None, words: str = "") -> None:
    if place:
        app.command(name, rich_help_panel=panel)(as_function(pkgutil.resolve_name(f"{ROOT}.{place}")))
    else:
        app.command(name, help=first_lines()[words or name], rich_help_panel=panel)(_not_called)


def _not_called() -> None:
    """Stands for a command that is not called."""


def as_function(declared: type[Operation]) -> Callable[..., None]:
    """Return a function that carries out an operation, with a signature for typer."""

    def command(**given: Any) -> None:
        operation = declared(**given)
        if not gc.isenabled():  # in a process of its own, see `cli.main`
            operation.function()  # imports the modules of the command
            gc.freeze()
            gc.enable()
        operation.carry_out()

    annotated: Any = Annotated
    parameters, annotations = [], {}
    for name, kind, default, words in declared.fields():
        form = typer.Argument if isinstance(words, Positional) else typer.Option
        declaration = form(*words.names, help=words.help, metavar=words.metavar, min=words.min, max=words.max)
        annotations[name] = annotated[kind, declaration]
        given_by = inspect.Parameter.empty if default is MISSING else default
        parameters.append(
            inspect.Parameter(
                name, inspect.Parameter.KEYWORD_ONLY, default=given_by, annotation=annotations[name]
            )
        )
    command.__doc__, command.__annotations__ = inspect.getdoc(declared), annotations
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return command
