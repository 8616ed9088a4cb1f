"""Errors that vibroimpact raises on purpose; each is one clear message for a person.

Only misuse and broken components raise. Effects of the physics (chatter, sticking, no contact) are an outcome in the
dataset, never an exception.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

from vibroimpact.fmus.messages import joined, message, typed


class VibroimpactError(Exception):
    """Base of all errors of this package; the command line returns its `exit_code`.

    The text names arguments in Python's spelling; `typed` is the text with options of the command line.
    """

    exit_code = 1

    @property
    def message(self) -> str:
        """The text, with both spellings where it names arguments."""
        found = self.args[0] if self.args else ""
        return found if isinstance(found, str) else str(found)

    @property
    def typed(self) -> str:
        """The text with options in place of arguments."""
        return typed(self.message)

    def named(self, name: object) -> Self:
        """Return the error with the name of a file, or of another subject, before its text."""
        return type(self)(message(f"{name}: ", self.message))


class UsageError(VibroimpactError):
    """A command was given an unusable value: a folder that cannot be written, an address without a scheduler."""

    exit_code = 2


class SceneError(VibroimpactError):
    """A scene file is wrong; all of its problems are reported at once.

    Attributes
    ----------
    problems : tuple of str
        One line for each problem, `file: key: expected ..., got .... hint`.
    """

    exit_code = 2

    def __init__(self, problems: Sequence[str]) -> None:
        self.problems = tuple(problems)
        super().__init__(joined("\n", self.problems))

    def __reduce__(self) -> tuple[type[SceneError], tuple[tuple[str, ...]]]:
        """Pickle the problems, not the message made from them: errors travel between processes."""
        return type(self), (self.problems,)


class ComponentError(VibroimpactError):
    """A component (an FMU) failed while it ran.

    Attributes
    ----------
    instance, function : str
        The instance and the FMI function that failed; empty if there was none.
    time : float or None
        Simulation time of the failing call, s.
    log : tuple of str
        The last lines that the component logged.
    """

    def __init__(
        self,
        message: str,
        *,
        instance: str = "",
        function: str = "",
        time: float | None = None,
        log: Sequence[str] = (),
    ) -> None:
        self.instance = instance
        self.function = function
        self.time = time
        self.log = tuple(log)
        super().__init__(message)


class ComponentFileError(ComponentError):
    """An FMU file itself is bad: corrupt, unsafe, or without a binary for this platform."""

    exit_code = 2


class LostComponentError(ComponentError):
    """The process or the machine of a component is gone; another run may go well."""


class LateComponentError(LostComponentError):
    """A component elsewhere has not answered in time."""


class RigError(VibroimpactError):
    """A rig refused a call, or failed, while a program used it."""


class DatasetError(VibroimpactError):
    """A dataset does not follow the schema of `vibroimpact.analysis.dataset`, or cannot be read."""

    exit_code = 2


class CampaignError(VibroimpactError):
    """A campaign could not finish; its complete parts stay, and the same command resumes it."""


class WorkersGoneError(CampaignError):
    """The workers of a campaign, or their scheduler, are gone; once they are back the same command resumes."""


class EstimationError(VibroimpactError):
    """An estimation has no admissible answer for its data."""
