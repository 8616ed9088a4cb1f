"""The FMUs and systems below a folder, each content once; a folder with a system's description is packed."""

from __future__ import annotations

import hashlib
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

SSD = "SystemStructure.ssd"
_OUTSIDE = re.compile(r'source="(?P<before>proxyfmu://[^"]*?file=)?(?P<file>(\.\./)+[^"]+)"')
_OTHERS = (".fmu", ".ssp", ".zip")
"""Endings of files that a packed system takes only where its description names them."""


def fmus(folder: Path) -> list[Path]:
    """Return the FMUs in a folder and below it, in the order of their paths."""
    return _each_once(sorted(folder.rglob("*.fmu")))


def systems(folder: Path, packed: Path) -> list[tuple[str, Path]]:
    """Return the systems in a folder and below it: their names in it, and their archives.

    A folder with a `SystemStructure.ssd` is packed into the folder `packed`, with the FMUs outside it that it names.
    """
    found = [(str(path.relative_to(folder)), path) for path in sorted(folder.rglob("*.ssp"))]
    for number, description in enumerate(sorted(folder.rglob(SSD)), start=1):
        name = str(description.parent.relative_to(folder))
        found.append((name, _packed(description, packed / f"{number}.ssp")))
    kept = set(_each_once([path for _, path in found]))
    return [(name, path) for name, path in found if path in kept]


def _each_once(paths: list[Path]) -> list[Path]:
    contents: dict[str, Path] = {}
    for path in paths:
        if path.is_file():
            contents.setdefault(hashlib.sha256(path.read_bytes()).hexdigest(), path)
    return list(contents.values())


def _packed(description: Path, target: Path) -> Path:
    """Write the archive of an unpacked system; FMUs outside its folder go into `outside`."""
    text, home = description.read_text(encoding="utf-8", errors="replace"), description.parent
    outside: dict[str, Path] = {}

    def inside(match: re.Match[str]) -> str:
        file = home / unquote(match["file"])
        if not file.is_file():
            return match[0]
        outside[f"outside/{file.name}"] = file
        return f'source="{match["before"] or ""}outside/{file.name}"'

    changed = _OUTSIDE.sub(inside, text)
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(_entry(SSD), changed)
        for member, file in [*_below(home, text), *sorted(outside.items())]:
            archive.writestr(_entry(member), file.read_bytes())
    return target


def _below(home: Path, text: str) -> Iterator[tuple[str, Path]]:
    for file in sorted(home.rglob("*")):
        member = file.relative_to(home).as_posix()
        others = file.suffix in _OTHERS and Path(member).name not in unquote(text)
        if file.is_file() and file.name != SSD and not others:
            yield member, file


def _entry(name: str) -> zipfile.ZipInfo:
    """Return a member without the time of its file, so that equal systems have equal archives."""
    return zipfile.ZipInfo(name)
