"""Operations as commands of typer: its arguments and options are built from the declared ones."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterator, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from vibroimpact.fmus.operations import Operation, Positional
from vibroimpact.fmus.operations.declaring import ROOT, Field
from vibroimpact.orchestrator.commands.table import COMMANDS, GROUPS, PANELS, first_lines

_PANEL_OF = {name: panel for panel, names in PANELS.items() for name in names}
_ORDER = [name for names in PANELS.values() for name in names]


def add_commands(app: typer.Typer, words: Sequence[str] | None = None) -> None:
    """Add the commands of the package to an app.

    Parameters
    ----------
    app : typer.Typer
    words : sequence of str, optional
        What was typed, options left out. The command that it names is added alone: typer builds one in 2 ms. Where it
        names none, commands have their names and first lines alone. Without it all are added whole.
    """
    called = words[0] if words else ""
    for name in [called] if called in _ORDER else _ORDER:
        if name in GROUPS:
            _add_group(app, name, None if words is None else words[1:])
        else:
            whole = words is None or name == called
            _add(app, name, COMMANDS[name] if whole else "", _PANEL_OF[name])


def _add_group(app: typer.Typer, name: str, words: Sequence[str] | None) -> None:
    group = GROUPS[name]
    form: type[TyperGroup] | None = _found(group.form) if group.form else None
    inner = typer.Typer(no_args_is_help=True, help=group.words, cls=form)
    # a group of its own form looks at all of its commands
    called = words[0] if words and form is None else ""
    whole = words is None or form is not None
    for word in [called] if called in group.commands else group.commands:
        place = group.commands[word] if whole or word == called else ""
        _add(inner, word, place, None, f"{name} {word}")
    app.add_typer(inner, name=name, rich_help_panel=_PANEL_OF[name])


def _add(app: typer.Typer, name: str, place: str, panel: str | None, words: str = "") -> None:
    if place:
        app.command(name, rich_help_panel=panel)(as_function(_found(place)))
    else:
        app.command(name, help=first_lines()[words or name], rich_help_panel=panel)(_not_called)


def _not_called() -> None:
    """Stand for a command that is not called."""


def _found(place: str) -> Any:
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(f"{ROOT}.{module}"), name)


def as_function(declared: type[Operation]) -> Callable[..., None]:
    """Return a function that carries an operation out, with the signature that typer reads."""

    def command(**given: Any) -> None:
        declared(**given).carry_out()

    parameters = list(_parameters(declared))
    command.__doc__ = inspect.getdoc(declared)
    command.__annotations__ = {one.name: one.annotation for one in parameters}
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return command


def _parameters(declared: type[Operation]) -> Iterator[inspect.Parameter]:
    annotated: Any = Annotated
    for field in declared.fields():
        kind = annotated[field.type, _words(field)]
        default = inspect.Parameter.empty if field.is_required else field.default
        yield inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=kind)


def _words(field: Field) -> Any:
    words = field.words
    form = typer.Argument if isinstance(words, Positional) else typer.Option
    return form(*words.names, help=words.help, metavar=words.metavar, min=words.min, max=words.max)
