"""The group of commands `vibroimpact estimate`, and its form of version 0.1."""

from __future__ import annotations

import os
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from typer.core import TyperGroup

from vibroimpact.fmus.errors import DatasetError, UsageError

# Kinds of estimation that version 0.1 did not have: its form never names them.
_NEW_KINDS = ("bounces",)


class EstimateGroup(TyperGroup):
    """The command `estimate`; for its form of version 0.1, `estimate FILE --kind KIND`, it names the new command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words after `estimate`; the old form raises UsageError with the command to write instead."""
        if args and args[0] not in (*self.commands, "--help") and _has_old_form(args[0]):
            kind, words = _without_kind(args)
            names = [kind] if kind in self.commands else self._kinds(words)
            commands = [shlex.join(["vibroimpact", "estimate", name, *words]) for name in names]
            raise UsageError(
                f"estimate: expected one of {', '.join(self.commands)}, then the data, got {args[0][:200]} first. "
                f"Write: {', or '.join(commands)}"
            )
        return super().parse_args(ctx, args)

    def _kinds(self, words: Sequence[str]) -> list[str]:
        """Return the kinds of estimation that have all these options; of several, the kind that fits the data."""
        options = {
            name: _options(command) for name, command in self.commands.items() if name not in _NEW_KINDS
        }
        given = {word.partition("=")[0] for word in words if word.startswith("-")}
        fitting = [name for name, known in options.items() if given <= known.keys()] or list(options)
        lengths = {option: count for known in options.values() for option, count in known.items()}
        data = next(_arguments(words, lengths), None)
        if len(fitting) == 1 or data is None:
            return fitting
        from vibroimpact.analysis.commands.estimate_scene import kind_of

        try:
            kind = kind_of(Path(data), one_run="--run" in given)
        except DatasetError:
            return fitting
        return [kind] if kind in fitting else fitting


def _has_old_form(first: str) -> bool:
    """Tell whether the first word is an option or a file; a kind of estimation that is misspelt is neither."""
    return first.startswith("-") or bool(Path(first).suffix) or os.path.exists(first)


def _without_kind(args: Sequence[str]) -> tuple[str, list[str]]:
    """Return the value of `--kind` (empty if absent) and the other words."""
    kind, words, rest = "", [], iter(args)
    for word in rest:
        name, _, value = word.partition("=")
        if name == "--kind":
            kind = value or next(rest, "")
        else:
            words.append(word)
    return kind, words


def _options(command: Any) -> dict[str, int]:
    """Return the options of a command, each with the number of words that follow it."""
    options = [parameter for parameter in command.params if parameter.param_type_name == "option"]
    return {name: 0 if option.is_flag else option.nargs for option in options for name in option.opts}


def _arguments(words: Sequence[str], lengths: Mapping[str, int]) -> Iterator[str]:
    """Yield the words that are neither options nor their values."""
    rest = iter(words)
    for word in rest:
        if not word.startswith("-"):
            yield word
        for _ in range(lengths.get(word, 0)):
            next(rest, None)
