"""Places of the C for a fault: a constant, a sign, a comparison, a branch."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from vibroimpact.fmus.packaging.build import NATIVE

ROOMS = ("core/body", "core/contact", "core/lanes", "core/modes", "core/motion", "bodies")
FUNCTION_END = re.compile(r"^}$", re.MULTILINE)
"""End of a function; a header with one contains computations."""
OF_INPUT = re.compile(r"vi_check|vi_complain|complaint|message|isfinite|isnan")
"""Lines that check arguments, or write messages about them."""
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
        Path from the folder of C sources.
    start, end : int
        Range of the replaced characters.
    new : str
        Text in their place.
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
        """Return place and effect of the fault."""
        text = (NATIVE / self.file).read_text(encoding="utf-8")
        line = text.count("\n", 0, self.start) + 1
        was = " ".join(text[self.start : self.end].split())
        return f"{self.file}:{line}: {self.kind}: {was} -> {' '.join(self.new.split())}"


@cache
def places() -> tuple[Fault, ...]:
    """Return all possible faults of the kinds above, in the order of the C files."""
    files = [path for room in ROOMS for path in sorted((NATIVE / room).rglob("*.[ch]"))]
    computing = [path for path in files if FUNCTION_END.search(path.read_text(encoding="utf-8"))]
    return tuple(fault for path in computing for fault in _faults_of(path))


def drawn(seed: int) -> Iterator[Fault]:
    """Yield random faults: kind and file are drawn first, so that long files and frequent kinds do not dominate."""
    chance = random.Random(seed)
    found = places()
    while True:
        kind = chance.choice(sorted({one.kind for one in found}))
        file = chance.choice(sorted({one.file for one in found if one.kind == kind}))
        yield chance.choice([one for one in found if (one.kind, one.file) == (kind, file)])


def _faults_of(path: Path) -> Iterator[Fault]:
    text = path.read_text(encoding="utf-8")
    # blanks replace comments and texts: all positions stay
    code = COMMENT_OR_TEXT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)
    lines = code.split("\n")
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line) + 1)

    def of_motion(place: int) -> bool:
        number = code.count("\n", 0, place)
        line = lines[number]
        # a loop without its bound never ends
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
