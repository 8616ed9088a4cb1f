"""TOML files that a user writes beside measurements: settings of an import, calibrations, rigs, sweeps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.scene.problems import syntax_problem

MOST_BYTES = 2**16
"""Size of a file, above which it is refused before it is parsed: people write a few thousand bytes."""


def text_of(path: Path, kind: str, most: int = MOST_BYTES) -> str:
    """Return the text of a file; UsageError, which names its kind, if it cannot be read or is larger."""
    try:
        with path.open("rb") as file:
            content = file.read(most + 1)
        if len(content) <= most:
            return content.decode("utf-8-sig")
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or "it is no UTF-8 text"
        raise UsageError(f"{path}: expected {kind} (TOML), got none: {reason}.") from problem
    raise UsageError(f"{path}: expected {kind} (TOML), got one of more than {most} bytes.")


def document_of(text: str, source: str) -> dict[str, Any]:
    """Return the tables of a text; UsageError, which begins with its source, if it is no TOML."""
    try:
        return parse_toml(text)
    except ValueError as problem:
        raise UsageError(syntax_problem(problem, text).line(source)) from None
