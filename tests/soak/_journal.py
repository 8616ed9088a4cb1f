"""The cases tried so far: one file for each base seed and state of the code, one line a case."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from support.places import ROOT

SOURCES = ("fmus", "analysis", "orchestrator", "hardware", "tests/soak")
SUFFIXES = {".py", ".c", ".h", ".toml"}


@dataclass(frozen=True)
class Tried:
    """A finished case: processor time in s, and problem or None."""

    kind: str
    case: int
    seed: int
    seconds: float
    problem: str | None


def state_of_the_code(root: Path = ROOT) -> str:
    """Return a digest of all sources; a change of any of them makes a case worth trying again."""
    digest = hashlib.sha256()
    for folder in SOURCES:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SUFFIXES and path.is_file():
                digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:12]


class Journal:
    """A file to which every case is appended; a run that ended, for whatever reason, goes on from there."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tried = {(entry.kind, entry.case): entry for entry in _read(path)}
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a", encoding="utf-8")

    def add(self, entry: Tried) -> None:
        """Append a case."""
        self.tried[entry.kind, entry.case] = entry
        print(json.dumps(asdict(entry)), file=self._file, flush=True)

    def of(self, kind: str) -> list[Tried]:
        """Return the finished cases of a kind, in order."""
        return sorted(
            (entry for entry in self.tried.values() if entry.kind == kind), key=lambda entry: entry.case
        )

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def _read(path: Path) -> list[Tried]:
    if not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole = text[: text.rfind("\n") + 1]
    if whole != text:
        # a line cut off by a crash of the machine would join the next line
        path.write_text(whole, encoding="utf-8")
    return [Tried(**json.loads(line)) for line in whole.splitlines()]
