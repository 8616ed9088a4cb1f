"""Hostile FMU archives through `fmu check` and the importer: accepted, or one refusal; nothing is written outside."""

from __future__ import annotations

import functools
import io
import random
import stat
import warnings
import zipfile
from pathlib import Path
from unittest.mock import patch

from support.command_line import in_this_process

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import binary_path, unpack
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.platform_names import binary_folder, library_suffix

SAMPLE = 40
SECONDS = 20.0
LONGEST_MESSAGE = 5000
BINARY = f"binaries/{binary_folder('3.0')}/Hostile{library_suffix()}"
NAMES = (
    *(
        "../outside",
        "resources/../../outside",
        "/outside",
        "C:/outside",
        "..\\outside",
        "a//b",
        "./a/b",
        "a/b",
        "a",
        "a/",
    ),
    *(
        ".",
        "..",
        "",
        "./",
        "//",
        "a/./b",
        "A/B",
        "resources/\u202ename",
        "resources/\x1b[31m",
        "resources/na\x00me",
    ),
    *(
        "r\xe9sum\xe9",
        "CON",
        "x" * 300,
        "d/" * 60 + "x",
        "x" * 5000,
        "modelDescription.xml/x",
        "modelDescription.xml/",
    ),
    *(
        "./modelDescription.xml",
        "modelDescription.xml",
        "binaries",
        "resources",
        "sources/buildDescription.xml",
        "~/x",
    ),
    *(
        "terminalsAndIcons/terminalsAndIcons.xml",
        BINARY,
        BINARY + "/x",
        "resources/x",
        "-o",
        "$HOME/x",
        "\ud83d\ude00",
    ),
)
HEAD = '<?xml version="1.0" encoding="{encoding}"?>\n'
BODY = (
    '<fmiModelDescription fmiVersion="{version}" modelName="Hostile" {token}="{value}">'
    '<CoSimulation modelIdentifier="{identifier}"{more}/>{middle}'
    "<ModelVariables>{variables}</ModelVariables><ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
)
VARIABLE = (
    '<Float64 name="{name}" valueReference="{reference}" causality="{cause}" variability="{change}"{more}/>'
)


@functools.cache
def whole() -> bytes:
    """Return an FMU of the package."""
    return fmu_path("Oscillator").read_bytes()


def description(draw: random.Random) -> bytes:
    """Return a model description with something odd in it."""
    pick = draw.choice
    variables = "".join(
        VARIABLE.format(
            name=pick(["time", "a", "a", "b[1]", "", "x" * 3000, "&#x202e;", "der(a)"]),
            reference=pick(["0", "1", "1", "-1", "4294967296", "x", ""]),
            cause=pick(["independent", "parameter", "output", "input", "local", "cause"]),
            change=pick(["continuous", "discrete", "fixed", "tunable", "change"]),
            more=pick(
                [
                    "",
                    ' start="1"',
                    ' start="x"',
                    ' start=""',
                    ' derivative="9"',
                    ' min="2" max="1"',
                    ' unit="none"',
                ]
            ),
        )
        for _ in range(draw.randrange(6))
    )
    text = BODY.format(
        version=pick(["3.0", "3.0", "3.0", "2.0", "1.0", "3.1", "", "3.0-beta.1", "4.0"]),
        token=pick(["instantiationToken", "instantiationToken", "guid", "Token"]),
        value=pick(["{t}", "", "x" * 5000, "&#10;"]),
        identifier=pick(["Hostile", "Hostile", "../Hostile", "a/b", "", "x" * 400, "..", ".", "&#x202e;x"]),
        more=pick(
            [
                "",
                "",
                ' canHandle="maybe"',
                ' hasEventMode="true"',
                ' a:b="c"',
                ' fixedInternalStepSize="NaN"',
                ' fixedInternalStepSize="-1" canHandleVariableCommunicationStepSize="true"',
                ' canBeInstantiatedOnlyOncePerProcess="1" needsExecutionTool="true"',
            ]
        ),
        middle=pick(
            ["", "", "<UnitDefinitions/>", "<a>" * 3000 + "</a>" * 3000, "<!-- " + "-" * 10 + " -->"]
        ),
        variables=variables,
        structure=pick(
            ["", "", '<Output valueReference="1"/>', '<Output valueReference="99"/>', "<Output/>"]
        ),
    )
    encoding = pick(["utf-8", "utf-8", "utf-8", "utf-16", "latin-1", "cp037", "rot13"])
    try:
        content = (HEAD.format(encoding=encoding) + text).encode(encoding)
    except (LookupError, UnicodeError):
        content = text.encode("utf-8", "replace")
    kind = draw.randrange(12)
    if kind == 0:
        content = content.replace(b"\n", b"\n<!DOCTYPE f [<!ENTITY a 'b'>]>", 1)
    elif kind == 1:
        content = content[: draw.randrange(len(content))]
    elif kind == 2:
        place = draw.randrange(len(content))
        content = content[:place] + bytes([draw.randrange(256)]) + content[place + 1 :]
    return content


def member(draw: random.Random) -> zipfile.ZipInfo:
    """Return the entry of a member whose name, kind or packing is odd."""
    info = zipfile.ZipInfo("x")
    info.filename = info.orig_filename = (
        draw.choice(NAMES).encode("utf-8", "surrogatepass").decode("utf-8", "replace")
    )
    info.compress_type = draw.choice(
        [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]
    )
    if draw.random() < 0.2:
        info.create_system = 3
        kind = draw.choice(
            [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK, stat.S_IFDIR, stat.S_IFREG]
        )
        info.external_attr = (kind | draw.choice([0o4777, 0o000, 0o644])) << 16
    return info


def archive(draw: random.Random) -> bytes:
    """Return a zip archive with members of every odd kind, and often a plausible description."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", draw.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])) as file:
        if draw.random() < 0.9:
            file.writestr("modelDescription.xml", description(draw))
        if draw.random() < 0.5:
            file.writestr(BINARY, draw.choice([b"", b"\x7fELF" + bytes(60), b"no library"]))
        for _ in range(draw.choice([0, 0, 1, 2, 4])):
            # two members of one name are intended
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                file.writestr(
                    member(draw), draw.choice([b"", b"x", bytes(2_000_000), b"../../outside", b"<a/>"])
                )
        if draw.random() < 0.01:
            for number in range(10_001):
                file.writestr(f"r/{number}", b"")
        if draw.random() < 0.1:
            file.comment = b"c" * draw.choice([1, 65535])
    return content.getvalue()


def damaged(content: bytes, draw: random.Random) -> bytes:
    """Return an archive with bits flipped, wrong sizes and offsets, or missing parts."""
    spoilt = bytearray(content)
    for _ in range(draw.choice([1, 1, 3, 10])):
        # the directory at the end is where wrong entries matter most
        place = (
            draw.randrange(len(spoilt))
            if draw.random() < 0.5
            else max(0, len(spoilt) - 1 - draw.randrange(600))
        )
        kind = draw.randrange(5)
        if kind <= 1:
            spoilt[place] ^= 1 << draw.randrange(8)
        elif kind == 2:
            number = draw.choice([0, 1, 2**31 - 1, 2**32 - 1, 10])
            spoilt[place : place + 4] = number.to_bytes(4, "little")
        elif kind == 3:
            spoilt[place:place] = draw.choice([b"PK\x05\x06", b"PK\x06\x07", bytes(30), b"\xff"])
        elif draw.random() < 0.4:
            del spoilt[max(1, place) :]
    return bytes(spoilt)


def check(seed: int) -> str | None:
    """Pass one archive to the entry points for untrusted files."""
    draw = random.Random(seed)
    kind = draw.random()
    content = damaged(whole(), draw) if kind < 0.3 else archive(draw)
    if 0.3 <= kind < 0.5:
        content = damaged(content, draw)
    home = Path.cwd() / "home"
    home.mkdir()
    path = home / "model.fmu"
    path.write_bytes(content)
    with patch.dict("os.environ", {"VIBROIMPACT_CACHE": str(home / "cache")}):
        problem = _unpacked(path) or _described(path)
        if problem is None and draw.random() < 0.05:
            done = in_this_process("fmu", "check", path)
            if done.returncode not in (0, 1, 2) or "Unexpected" in done.stderr:
                problem = f"fmu check: exit code {done.returncode}: {done.stderr[:500]}"
    outside = {entry.name for entry in Path.cwd().iterdir()} - {"home"}
    outside |= {entry.name for entry in home.iterdir()} - {"cache", path.name}
    if outside or Path("/outside").exists():
        return f"written outside: {sorted(outside)}"
    return problem


def _unpacked(path: Path) -> str | None:
    """Unpack an archive twice; return the problem of the copy or of the refusal."""
    try:
        first = unpack(path)
        kept = {entry: entry.stat().st_ino for entry in first.folder.rglob("*")}
        if unpack(path) != first or kept != {entry: entry.stat().st_ino for entry in first.folder.rglob("*")}:
            return "unpacked again"
        if any(entry.is_symlink() or not (entry.is_file() or entry.is_dir()) for entry in kept):
            return "something else than files and folders was unpacked"
        binary_path(first)
    except ComponentFileError as refusal:
        return _badly_said(str(refusal), path)
    return None


def _described(path: Path) -> str | None:
    try:
        read_description(path)
    except ComponentFileError as refusal:
        return _badly_said(str(refusal), path)
    return None


def _badly_said(message: str, path: Path) -> str | None:
    if str(path) not in message or len(message) > LONGEST_MESSAGE:
        return f"{len(message)} characters of refusal: {message[:300]}"
    return None
