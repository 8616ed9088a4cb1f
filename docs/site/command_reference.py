"""The directive `command-reference`: every command with its arguments and options, from the program itself."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from vibroimpact.orchestrator.commands.cli import app, load_commands

_EXAMPLE = "Example: "


def setup(sphinx: Sphinx) -> dict[str, bool]:
    """Register the directive."""
    sphinx.add_directive("command-reference", CommandReference)
    return {"parallel_read_safe": True}


class CommandReference(SphinxDirective):
    """Every command of the command line, subcommands too, with a heading each."""

    def run(self) -> list[nodes.Node]:
        """Return the sections of the commands."""
        text = "\n\n".join(_described(command, context) for command, context in commands())
        return self.parse_text_to_nodes(text, allow_section_headings=True)


def commands() -> Iterator[tuple[Any, Any]]:
    """Yield each command that does something, with the context of its whole name."""
    load_commands()
    yield from _below(typer.main.get_command(app), None, "vibroimpact")


def _below(command: Any, parent: Any, name: str) -> Iterator[tuple[Any, Any]]:
    context = command.context_class(command, info_name=name, parent=parent)
    if not hasattr(command, "list_commands"):
        yield command, context
        return
    for one in command.list_commands(context):
        yield from _below(command.get_command(context, one), context, one)


def _described(command: Any, context: Any) -> str:
    # typer adds the arguments of groups to the context's path; the groups here have none
    lines = [f"## `{context.command_path}`", ""]
    for paragraph in (command.help or "").split("\n\n"):
        if paragraph.startswith(_EXAMPLE):
            lines += ["```", paragraph.removeprefix(_EXAMPLE).strip(), "```", ""]
        else:
            lines += [_plain(paragraph), ""]
    lines += ["| argument or option | |", "|---|---|"]
    for parameter in command.get_params(context):
        record = parameter.get_help_record(context)
        if record is not None and "--help" not in parameter.opts:
            lines.append(f"| `{record[0].replace('|', ' or ')}` | {_plain(record[1])} |")
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Return text in one line, escaped so that Markdown formats nothing but code."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(
        part if part.startswith("`") else re.sub(r"([\\*_<>\[\]|#])", r"\\\1", part) for part in parts
    )
