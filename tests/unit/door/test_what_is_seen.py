"""Completion, `help()`, `inspect.signature` and `--help` show unchanged texts, kept in two files."""

from __future__ import annotations

from support import public_names
from support.public_names import COMMANDS, NAMES


def test_names_have_the_signatures_and_descriptions_of_the_list():
    assert public_names.names() == NAMES.read_text(encoding="utf-8"), (
        "run python -P tests/support/public_names.py"
    )


def test_commands_have_the_options_and_help_of_the_list():
    assert public_names.commands() == COMMANDS.read_text(encoding="utf-8"), (
        "run python -P tests/support/public_names.py"
    )
