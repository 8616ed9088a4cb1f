"""Faults of an FMU, in three grades."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum

#: Number of names in one finding, and characters of each.
MOST_NAMED, LONGEST_NAME = 5, 60


class Grade(StrEnum):
    """Consequence of a finding for a run."""

    refused = "will not run"
    doubt = "may run wrong"
    remark = "remark"


@dataclass(frozen=True, slots=True)
class Finding:
    """A fault of an FMU."""

    grade: Grade
    """A remark changes no number; a doubt states an assumption; a refusal is beyond repair."""
    text: str
    """One line: place, expectation, actual content, and its interpretation."""

    def line(self) -> str:
        """Return the finding as a line, with its grade unless it is a refusal."""
        return self.text if self.grade is Grade.refused else f"{self.grade}: {self.text}"


class Findings:
    """Findings in the order of their discovery: variables with the same finding share a line."""

    def __init__(self) -> None:
        self._variables: dict[tuple[Grade, str], list[str]] = {}

    def add(self, grade: Grade, text: str, variable: str | None = None) -> None:
        """Add a finding about a variable, or about the whole description."""
        names = self._variables.setdefault((grade, text), [])
        if variable is not None:
            names.append(variable)

    def taken(self) -> tuple[Finding, ...]:
        """Return the findings in the order of their discovery."""
        return tuple(
            Finding(grade, f"{_subject(names)}{text}") for (grade, text), names in self._variables.items()
        )


def _subject(names: Collection[str]) -> str:
    return f"variable{'s' if len(names) > 1 else ''} {listed(names)}: " if names else ""


def listed(names: Iterable[str]) -> str:
    """Return names for a message: a few of them, each cut to a bounded length."""
    every = [name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..." for name in names]
    more = f" and {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
    return f"{', '.join(every[:MOST_NAMED])}{more}"
