"""Messages that name arguments: as keywords in Python, as options on the command line.

The code that makes a message does not know its reader. So a message has both spellings, and its display picks one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple, Self

_OPTIONS = {"baseline_window": "baseline", "start": "from", "stop": "to"}
"""Options whose name differs from the argument's."""


def option_of(argument: str) -> str:
    """Return the option of an argument.

    >>> option_of("start"), option_of("time_column")
    ('--from', '--time-column')
    """
    return f"--{_OPTIONS.get(argument, argument).replace('_', '-')}"


class Either(NamedTuple):
    """Words that differ between Python and the command line, without naming an argument."""

    called: str
    typed: str


CALL = Either("call", "command")
"""The noun for the request: `The same call resumes.`"""
WITH_OUTPUT = Either("", " with -o")
"""The hint for the choice of another file or folder."""


class Argument(NamedTuple):
    """An argument of an operation, or a value for it, as a message names it.

    >>> Argument("start").called, Argument("method", "threshold").called, Argument("events", False).called
    ('start', "method='threshold'", 'events=False')
    >>> Argument("start").typed, Argument("method", "threshold").typed, Argument("events", False).typed
    ('--from', '--method threshold', '--no-events')
    """

    name: str
    value: str | int | bool = ""

    @property
    def called(self) -> str:
        """The spelling in Python."""
        return self.name if self.value == "" else f"{self.name}={self.value!r}"

    @property
    def typed(self) -> str:
        """The spelling on the command line."""
        option = option_of(self.name)
        return f"--no-{option[2:]}" if self.value is False else f"{option} {self.value}".rstrip()


class Message(str):
    """A text that names arguments as Python writes them, together with the command line's spelling.

    Attributes
    ----------
    typed : str
        The same text with options.
    """

    __slots__ = ("typed",)
    typed: str

    def __new__(cls, called: str, typed: str) -> Self:
        """Return a message of both spellings; `message` makes one from parts."""
        made = super().__new__(cls, called)
        made.typed = typed
        return made

    def __reduce__(self) -> tuple[type[Message], tuple[str, str]]:
        """Pickle both spellings: errors travel between processes."""
        return type(self), (str(self), self.typed)


Part = str | Argument | Either
Spelling = Callable[[str], str]
"""Function from a message to the displayed text: `typed`, or `str` for Python's spelling."""


def message(*parts: Part) -> Message:
    """Return the parts as one message; parts that are messages keep both spellings.

    >>> made = message("Choose another", Either("", " with -o"), ", or widen ", Argument("start"), ".")
    >>> made, made.typed
    ('Choose another, or widen start.', 'Choose another with -o, or widen --from.')
    """
    return Message("".join(map(_called, parts)), "".join(map(typed, parts)))


def joined(separator: str, texts: Iterable[str]) -> Message:
    """Return texts as one, as `str.join` does."""
    several = list(texts)
    return Message(separator.join(several), separator.join(map(typed, several)))


def reworded(text: str, change: Callable[[str], str]) -> str:
    """Return a changed text, changed in both spellings if it is a message.

    >>> reworded(message("Give ", Argument("rate"), "."), str.upper).typed
    'GIVE --RATE.'
    """
    return Message(change(text), change(text.typed)) if isinstance(text, Message) else change(text)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text.

    >>> [line.typed for line in lines_of(message("Give ", Argument("rate"), ".\\nOr not."))]
    ['Give --rate.', 'Or not.']
    """
    if not isinstance(text, Message):
        return text.splitlines()
    return [Message(*line) for line in zip(text.split("\n"), text.typed.split("\n"), strict=True)]


def spelled(attributes: Mapping[str, Any], spelling: Spelling) -> dict[str, Any]:
    """Return attributes as a file stores them: messages in one spelling, by `typed` or `str`."""
    return {
        name: spelling(value) if isinstance(value, Message) else value for name, value in attributes.items()
    }


def typed(text: Part) -> str:
    """Return a text as the command line spells it.

    >>> typed(message("Give ", Argument("time_column"), ".")), typed("a.toml: expected a file, got none.")
    ('Give --time-column.', 'a.toml: expected a file, got none.')
    """
    return text if isinstance(text, str) and not isinstance(text, Message) else text.typed


def _called(part: Part) -> str:
    return part if isinstance(part, str) else part.called


def counted(count: int, what: str) -> str:
    """Return a number with its noun.

    >>> counted(1, "run"), counted(3, "run")
    ('1 run', '3 runs')
    """
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


_DURATIONS = (
    (1e-3, "us", 1e6),
    (1.0, "ms", 1e3),
    (120.0, "s", 1.0),
    (7200.0, "min", 1 / 60),
    (172800.0, "h", 1 / 3600),
)
"""Upper limits of wall time for each unit, s; the unit's name, and its number per second."""


def duration(seconds: float) -> str:
    """Return a wall time for a reader, with two digits.

    >>> duration(2.34e-3), duration(59.6), duration(5000.0), duration(4e6)
    ('2.3 ms', '60 s', '83 min', '46 days')
    """
    for below, unit, factor in _DURATIONS:
        if seconds < below:
            return f"{_two_digits(seconds * factor)} {unit}"
    return f"{_two_digits(seconds / 86400)} days"


def _two_digits(number: float) -> str:
    return f"{number:.0f}" if number >= 9.95 else f"{number:.2g}"
