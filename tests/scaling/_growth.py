"""The cost of reading as the number of tokens doubles, and whether it grows too fast."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from vibroimpact.fmus.errors import VibroimpactError

Made = Callable[[int], str]
"""Function from a number of tokens to a text with them."""
STEEPEST = 1.3
"""Exponent of the processor time over the number of tokens, above which a parser fails."""
FROM_SECONDS = 0.02
"""Processor time, s, below which nothing is compared: rounding of the clock, and reading of fixed parts."""
LIBRARY_SECONDS = 0.5
"""Largest processor time of a library, s, at the largest allowed size; its exponent does not matter."""
LAST_SECONDS = 2.0
"""Processor time of a reading, s, above which no larger content is tried."""
LAST_MAKING = 10.0
"""Processor time of making a content, s, above which no larger one is tried: its writer is not under test."""
LARGEST = 2**24
"""Bytes of the largest content, if the parser itself allows at least as many."""
FIRST = 32
"""Tokens of the first content."""
REPEATS = 7
"""Readings of each content that looks too expensive: the quickest counts, on a machine with other work."""


@dataclass(frozen=True)
class Tokens:
    """One kind of token of one parser.

    Attributes
    ----------
    parser, kind : str
    content : callable
        Returns the bytes of a file with a number of tokens.
    read : callable
        Reads the file at a path; a refusal of this package counts as read.
    name : str
        Name of the file.
    most : int
        Largest number of bytes that the parser allows, or `LARGEST`.
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
    """Return the costs of n, 2n, 4n, ... tokens, at most `rungs` of them, from the first comparable one.

    It ends at the allowed size, at content that grows no more, and where reading takes `LAST_SECONDS` or making
    `LAST_MAKING`.
    """
    found: list[Rung] = []
    count, size = FIRST, 0
    while len(found) < rungs:
        rung = _rung(tokens, count, folder)
        if not size < rung.size <= tokens.most:
            break
        # the first reading may have imported the reader's modules
        found = [*found, rung] if rung.seconds >= FROM_SECONDS else []
        if rung.seconds > LAST_SECONDS or rung.making > LAST_MAKING:
            break
        size = rung.size
        count *= 2 if found or rung.seconds > FROM_SECONDS / 8 else 4
    return found


def problem_of(tokens: Tokens, folder: Path, rungs: int, library: str = "") -> str | None:
    """Return the doubling that costs too much; None without one.

    `library` names the work of a library, which may cost `LIBRARY_SECONDS`, for any growth.
    """
    found = ladder(tokens, folder, rungs)
    if library:
        expensive = [rung for rung in found if rung.seconds > LIBRARY_SECONDS]
        return f"{library}: {_said(expensive[:1])}, which is above {LIBRARY_SECONDS} s" if expensive else None
    for three in zip(found, found[1:], found[2:], strict=False):
        if _is_steep(three):
            again = _quickest(tokens, three, folder)
            if _is_steep(again):
                return f"{_said(again)}: steeper than n^{STEEPEST}"
    return None


def _is_steep(rungs: Sequence[Rung]) -> bool:
    """Whether each of two doublings costs too much: a table that no longer fits a cache slows one of them.

    If content grows faster than its tokens, as widening rows do, its bytes count.
    """
    return all(
        after.seconds > before.seconds * max(after.count / before.count, after.size / before.size) ** STEEPEST
        for before, after in pairwise(rungs)
    )


def _quickest(tokens: Tokens, rungs: Sequence[Rung], folder: Path) -> list[Rung]:
    """Return the quickest of several readings of each content, in turn: a busy moment meets all of them.

    It ends with the first readings that are not steep: a real fault is steep each time.
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
    making_began = time.process_time()
    content = tokens.content(count)
    path = folder / tokens.name
    path.write_bytes(content)
    began = time.process_time()
    with suppress(VibroimpactError):
        tokens.read(path)
    return Rung(count, len(content), time.process_time() - began, began - making_began)


def each(line: str, before: str = "", after: str = "") -> Made:
    """Return the maker of a text of numbered lines: `{at}` is the number of a line."""
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
