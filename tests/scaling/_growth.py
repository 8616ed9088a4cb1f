"""The cost of reading as the number of tokens doubles, and whether it grows faster than it may."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vibroimpact.fmus.errors import VibroimpactError

Made = Callable[[int], str]
"""Returns the text that has so many tokens."""
STEEPEST = 1.3
"""Exponent of the processor time over the number of tokens, above which a parser fails."""
FROM_SECONDS = 0.02
"""Processor time, s, below which nothing is compared: rounding of the clock, and what is read once."""
LIBRARY_SECONDS = 0.5
"""Processor time, s, that a library may take whatever its exponent, at the largest size that is allowed."""
LAST_SECONDS = 2.0
"""Processor time of a reading, s, above which no larger content is tried."""
LAST_MAKING = 10.0
"""Processor time of making a content, s, above which no larger one is tried: its writer is none of ours."""
LARGEST = 2**24
"""Bytes of the largest content that is tried, where the parser itself allows as many or more."""
FIRST = 32
"""Tokens of the first content."""
REPEATS = 7
"""Readings of each content where one looks too dear: the quickest counts, on a machine that does other things too."""


@dataclass(frozen=True)
class Tokens:
    """One kind of token of one parser.

    Attributes
    ----------
    parser, kind : str
    content : callable
        Returns the bytes of a file with so many tokens.
    read : callable
        Reads the file at a path; a refusal of this package counts as read.
    name : str
        Of the file.
    most : int
        Bytes that the parser allows, or `LARGEST`.
    """

    parser: str
    kind: str
    content: Callable[[int], bytes]
    read: Callable[[Path], object]
    name: str = "tokens"
    most: int = LARGEST

    def __str__(self) -> str:
        return f"{self.parser}: {self.kind}"


@dataclass(frozen=True)
class Rung:
    """Tokens of a content, its bytes, and the processor times of reading and of making it, s."""

    count: int
    size: int
    seconds: float
    making: float


def ladder(tokens: Tokens, folder: Path, rungs: int) -> list[Rung]:
    """Return the costs of n, 2n, 4n, ... tokens, at most so many, from the first that is worth comparing.

    It ends at the size that is allowed, where content grows no more, and where reading takes `LAST_SECONDS` or making
    it `LAST_MAKING`.
    """
    found: list[Rung] = []
    count, size = FIRST, 0
    while len(found) < rungs:
        rung = _rung(tokens, count, folder)
        if not size < rung.size <= tokens.most:
            break
        # the first reading may have imported what reads
        found = [*found, rung] if rung.seconds >= FROM_SECONDS else []
        if rung.seconds > LAST_SECONDS or rung.making > LAST_MAKING:
            break
        size = rung.size
        count *= 2 if found or rung.seconds > FROM_SECONDS / 8 else 4
    return found


def problem_of(tokens: Tokens, folder: Path, rungs: int, library: str = "") -> str | None:
    """Return which doubling costs too much; None where none does.

    `library` names what a library does: it may cost `LIBRARY_SECONDS`, however that grows.
    """
    found = ladder(tokens, folder, rungs)
    if library:
        dear = [rung for rung in found if rung.seconds > LIBRARY_SECONDS]
        return f"{library}: {_said(dear[:1])}, which is above {LIBRARY_SECONDS} s" if dear else None
    for three in zip(found, found[1:], found[2:], strict=False):
        if _is_steep(three):
            again = _quickest(tokens, three, folder)
            if _is_steep(again):
                return f"{_said(again)}: steeper than n^{STEEPEST}"
    return None


def _is_steep(rungs: Sequence[Rung]) -> bool:
    """Whether each of two doublings costs too much: a table that no longer fits a cache makes one of them dear.

    Where content grows faster than its tokens, as rows do that widen, its bytes count.
    """
    return all(
        after.seconds > before.seconds * max(after.count / before.count, after.size / before.size) ** STEEPEST
        for before, after in pairwise(rungs)
    )


def _quickest(tokens: Tokens, rungs: Sequence[Rung], folder: Path) -> list[Rung]:
    """Return the quickest of several readings of each content, in turn: a busy moment meets all of them.

    It ends with the first that are not steep: what costs too much is steep each time.
    """
    found = list(rungs)
    for _ in range(REPEATS):
        again = [_rung(tokens, rung.count, folder) for rung in rungs]
        found = [min(both, key=lambda one: one.seconds) for both in zip(found, again, strict=True)]
        if not _is_steep(found):
            break
    return found


def _said(rungs: Sequence[Rung]) -> str:
    return ", ".join(f"{rung.count} tokens ({rung.size} bytes) {rung.seconds:.3f} s" for rung in rungs)


def _rung(tokens: Tokens, count: int, folder: Path) -> Rung:
    begun = time.process_time()
    content = tokens.content(count)
    path = folder / tokens.name
    path.write_bytes(content)
    began = time.process_time()
    with suppress(VibroimpactError):
        tokens.read(path)
    return Rung(count, len(content), time.process_time() - began, began - begun)


def each(line: str, before: str = "", after: str = "") -> Made:
    """Return the maker of a text of numbered lines: `{at}` is the number of each."""
    return lambda n: before + "".join(line.replace("{at}", str(at)) for at in range(n)) + after


def run(unit: str, before: str = "", after: str = "") -> Made:
    """Return the maker of a text that repeats a unit."""
    return lambda n: before + unit * n + after


def texts(
    parser: str, made: Mapping[str, Made], read: Callable[[Path], object], name: str, most: int = LARGEST
) -> list[Tokens]:
    """Return the kinds of tokens of a parser of texts."""

    def encoded(make: Made) -> Callable[[int], bytes]:
        return lambda n: make(n).encode()

    return [Tokens(parser, kind, encoded(make), read, name, most) for kind, make in made.items()]
