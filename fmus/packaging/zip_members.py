"""Opening of untrusted zip archives: unsafe content is reported before a byte is unpacked.

FMUs and SSPs are such archives. A member may neither lead out of the archive nor hide another one, and the unpacked
size is bounded. Everything here raises `ComponentFileError`.
"""

from __future__ import annotations

import lzma
import os
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path, PurePosixPath

from vibroimpact.fmus.errors import ComponentFileError

#: Largest unpacked size of an archive, bytes: far above any real one.
EXPANSION_LIMIT = 1 << 30
MEMBER_LIMIT = 10_000
#: Largest number of nested folders of a member.
DEEPEST = 50
LONGEST_NAME = 100
#: Number of characters of a library's reason in a message.
LONGEST_REASON = 200
#: Exceptions of the libraries that unpack members, for damaged members and for unknown kinds.
DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, EOFError, NotImplementedError),
    *(ValueError, RuntimeError, MemoryError),
)


def opened(path: Path, kind: str = "FMU") -> BufferedReader:
    """Open the file of an archive; `kind` is the archive's name in messages."""
    try:
        # opening a pipe would wait for a process that writes into it
        if not stat.S_ISREG(path.stat().st_mode):
            raise ComponentFileError(f"{path}: expected an {kind} file, got a folder or a device.")
        return path.open("rb")
    except OSError as error:
        raise ComponentFileError(f"{path}: expected an {kind} file, got: {error.strerror}.") from error
    except ValueError as error:  # a zero byte
        raise ComponentFileError(
            f"{str(path)!r}: expected the path of an {kind} file, got: {error}."
        ) from error


def zip_in(path: Path, file: BufferedReader, kind: str = "FMU") -> zipfile.ZipFile:
    """Read the directory of an archive."""
    try:
        return zipfile.ZipFile(file)
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError) as error:
        raise ComponentFileError(
            f"{path}: expected an {kind} (a zip archive), got a file with: {error}."
        ) from error


def checked_members(
    path: Path,
    archive: zipfile.ZipFile,
    limit: int = EXPANSION_LIMIT,
    *,
    needed: str = "modelDescription.xml",
    kind: str = "FMU",
) -> list[zipfile.ZipInfo]:
    """Return the members of an archive; raise ComponentFileError unless all are safe.

    Parameters
    ----------
    path : Path
        File of the archive, for messages.
    archive : zipfile.ZipFile
    limit : int
        Largest allowed unpacked size, bytes.
    needed, kind : str
        Member that the archive must have; name of the archive in messages.

    Raises
    ------
    ComponentFileError
        An archive is unsafe; the message has the first five of its problems.
    """
    members = archive.infolist()
    problems = [f"member {_shown(m)} {problem}" for m in members for problem in _problems(m)]
    if len(members) > MEMBER_LIMIT:
        problems.append(f"{len(members)} members, limit {MEMBER_LIMIT}")
    size = sum(member.file_size for member in members)
    if size > limit:
        problems.append(f"{size} bytes when unpacked, limit {limit}")
    if not any(place_of(member) == (needed,) for member in members if not is_folder(member)):
        problems.append(f"no {needed}")
    # comparing names makes sense only if they are short and few
    problems = problems or list(_clashes(members))
    if problems:
        raise ComponentFileError(
            f"{path}: expected a safe {kind}, got: {'; '.join(problems[:5])}. It was not unpacked."
        )
    return members


def is_folder(member: zipfile.ZipInfo) -> bool:
    """Return whether a member is a folder."""
    return member.filename.endswith("/")


def place_of(member: zipfile.ZipInfo) -> tuple[str, ...]:
    """Return the place of a member, equal for `a/b`, `./a/b` and `a//b`; with names compared as by the file system."""
    return PurePosixPath(os.path.normcase(member.filename).replace(os.sep, "/")).parts


def damaged(path: Path, error: Exception, kind: str = "FMU") -> ComponentFileError:
    """Return the error for an archive that a library finds damaged; its reason may quote names of any length."""
    reason = shortened(str(error), LONGEST_REASON)
    return ComponentFileError(f"{path}: expected an intact {kind}, got a damaged one: {reason}.")


def cut(text: object) -> str:
    """Return a value from a file as messages show it."""
    return shortened(repr(text), LONGEST_NAME)


def shortened(text: str, longest: int) -> str:
    """Return a text, shortened if it is long."""
    return text if len(text) <= longest else text[:longest] + "..."


def _clashes(members: list[zipfile.ZipInfo]) -> Iterator[str]:
    """Yield members that would overwrite others: members at the same place, and files where others need a folder."""
    places = [place_of(member) for member in members]
    contents: dict[tuple[str, ...], tuple[bool, int, int]] = {}
    for member, place in zip(members, places, strict=True):
        # builds that list a folder twice write a member twice; its bytes are compared once unpacked
        content = (is_folder(member), member.file_size, member.CRC)
        if contents.setdefault(place, content) != content:
            yield f"two members have the same name, {cut('/'.join(place))}"
            break
    folders = {place[:end] for place in places for end in range(len(place))}
    blocking = [m for m, place in zip(members, places, strict=True) if place in folders and not is_folder(m)]
    if blocking:
        yield f"member {_shown(blocking[0])} is a file and a folder"


def _shown(member: zipfile.ZipInfo) -> str:
    return cut(member.orig_filename)


def _problems(member: zipfile.ZipInfo) -> Iterator[str]:
    # orig_filename: zipfile replaces backslashes on Windows and cuts names at a zero byte
    name = member.orig_filename
    if not name:
        yield "has no name"
    if "\\" in name or "\0" in name:
        yield "has a backslash or a zero byte in its name"
    if name.startswith("/") or ":" in name.split("/")[0]:
        yield "has an absolute path"
    if ".." in PurePosixPath(name).parts:
        yield "leads out of the archive"
    if len(PurePosixPath(name).parts) > DEEPEST:
        yield f"lies deeper than {DEEPEST} folders"
    kind = stat.S_IFMT(member.external_attr >> 16)
    if member.create_system == 3 and kind not in {0, stat.S_IFREG, stat.S_IFDIR}:
        yield "is a link or a device, not a file"
    if member.flag_bits & 0x1:
        yield "is encrypted"
