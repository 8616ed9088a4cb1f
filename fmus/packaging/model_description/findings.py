"""What is wrong with an FMU, in three grades."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from enum import StrEnum

#: Names that one finding lists, and characters of each.
MOST_NAMED, LONGEST_NAME = 5, 60


class Grade(StrEnum):
    """What a finding means for a run."""

    refused = "will not run"
    doubt = "may run wrong"
    remark = "remark"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong with an FMU."""

    grade: Grade
    """A remark changes no number; a doubt says what is assumed; a refusal has no way round."""
    text: str
    """One line: where, what was expected, what is there, what is made of it."""

    def line(self) -> str:
        """Return the line that says it, with its grade where it is no refusal."""
        return self.text if self.grade is Grade.refused else f"{self.grade}: {self.text}"


class Findings:
    """Findings as they are met: variables of which the same is said share a line."""

    def __init__(self) -> None:
        self._variables: dict[tuple[Grade, str], list[str]] = {}

    def add(self, grade: Grade, text: str, variable: str | None = None) -> None:
        """Add a finding, of a variable or of the whole."""
        names = self._variables.setdefault((grade, text), [])
        if variable is not None:
            names.append(variable)

    def taken(self) -> tuple[Finding, ...]:
        """Return the findings in the order in which they were met."""
        return tuple(
            Finding(grade, f"{_subject(names)}{text}") for (grade, text), names in self._variables.items()
        )


def _subject(names: Collection[str]) -> str:
    return f"variable{'s' if len(names) > 1 else ''} {listed(names)}: " if names else ""


def listed(names: Iterable[str]) -> str:
    """Return names as a line lists them: a few of them, each cut to a bounded length."""
    every = [name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..." for name in names]
    more = f" and {len(every) - MOST_NAMED} more" if len(every) > MOST_NAMED else ""
    return f"{', '.join(every[:MOST_NAMED])}{more}"
