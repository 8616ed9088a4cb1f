"""Places of the C where a fault can be put: a constant, a sign, a comparison, a branch."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vibroimpact.fmus.packaging.build import NATIVE

ROOMS = ("core/body", "core/contact", "core/lanes", "core/modes", "core/motion", "bodies")
HEADERS = ("rounds.h", "rounds_many.h")
"""Headers that hold what is computed."""
OF_INPUT = re.compile(r"vi_check|vi_complain|complaint|message|isfinite|isnan")
"""Lines that check what is given, or say what is wrong with it."""
COMMENT_OR_TEXT = re.compile(r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])'", re.DOTALL)
CONSTANT = re.compile(r"(?<![\w.])(?:\d+\.\d*|\d+(?=[eE]))(?:[eE][-+]?\d+)?(?![\w.])")
SIGN = re.compile(r"(?<=[\w\])] )[-+](?= [\w(])")
COMPARISON = re.compile(r"(?<= )(?:<=|>=|<|>|==)(?= )")
BRANCH = re.compile(r"(?<=\bif \()[^{};]*(?=\) \{$)", re.MULTILINE)
OTHERWISE = {"<": ">=", ">": "<=", "<=": ">", ">=": "<", "==": "!=", "+": "-", "-": "+"}


@dataclass(frozen=True)
class Fault:
    """A change of one place of one file.

    Attributes
    ----------
    file : str
        From the folder of C sources.
    start, end : int
        The characters that are replaced.
    new : str
        What stands there instead.
    kind : str
    """

    file: str
    start: int
    end: int
    new: str
    kind: str

    def patched(self, text: str) -> str:
        """Return the file with the fault."""
        return text[: self.start] + self.new + text[self.end :]

    def described(self) -> str:
        """Return where it is and what it does."""
        text = (NATIVE / self.file).read_text(encoding="utf-8")
        line = text.count("\n", 0, self.start) + 1
        was = " ".join(text[self.start : self.end].split())
        return f"{self.file}:{line}: {self.kind}: {was} -> {' '.join(self.new.split())}"


@cache
def places() -> tuple[Fault, ...]:
    """Return all faults of the kinds above that the C has room for, in the order of its files."""
    files = [path for room in ROOMS for path in sorted((NATIVE / room).rglob("*"))]
    wanted = [path for path in files if path.suffix == ".c" or path.name in HEADERS]
    return tuple(fault for path in wanted for fault in _faults_of(path))


def drawn(seed: int) -> Iterator[Fault]:
    """Yield faults by chance: first a kind and a file, so that long files and frequent kinds are not all there is."""
    chance = random.Random(seed)
    found = places()
    while True:
        kind = chance.choice(sorted({one.kind for one in found}))
        file = chance.choice(sorted({one.file for one in found if one.kind == kind}))
        yield chance.choice([one for one in found if (one.kind, one.file) == (kind, file)])


def _faults_of(path: Path) -> Iterator[Fault]:
    text = path.read_text(encoding="utf-8")
    # what is no code keeps its length
    code = COMMENT_OR_TEXT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    lines = code.split("\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)

    def of_motion(place: int) -> bool:
        number = code.count("\n", 0, place)
        line = lines[number]
        # a loop without its bound does not end
        return not (
            line.lstrip().startswith(("#", "for ", "while ")) or line.endswith("\\") or OF_INPUT.search(line)
        )

    file = path.relative_to(NATIVE).as_posix()
    for pattern, kind in ((CONSTANT, "constant off by 1e-9"), (SIGN, "sign"), (COMPARISON, "comparison")):
        for match in pattern.finditer(code):
            if of_motion(match.start()) and not (kind.startswith("constant") and float(match[0]) == 0.0):
                new = f"({match[0]} * (1.0 + 1e-9))" if kind.startswith("constant") else OTHERWISE[match[0]]
                yield Fault(file, match.start(), match.end(), new, kind)
    for match in BRANCH.finditer(code):
        if of_motion(match.start()) and match[0].count("(") == match[0].count(")"):
            yield Fault(file, match.start(), match.end(), f"0 && ({match[0]})", "branch that is skipped")
