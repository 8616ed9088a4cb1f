"""Safe opening of FMU files; each is unpacked once per machine.

An FMU is a zip with native code. Loading it means to trust its code. But opening it must not write outside of its
folder, fill the disk, or expand entities. Everything here raises `ComponentFileError`.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import tempfile
import zipfile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path, PurePosixPath
from xml.etree.ElementTree import Element

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.file_state import FileState, file_state, is_settled
from vibroimpact.fmus.packaging import unpacked_cache
from vibroimpact.fmus.packaging.platform_names import architecture, binary_folder, library_suffix
from vibroimpact.fmus.packaging.zip_members import (
    DAMAGE,
    EXPANSION_LIMIT,
    LONGEST_REASON,
    checked_members,
    cut,
    damaged,
    is_folder,
    opened,
    place_of,
    zip_in,
)
from vibroimpact.fmus.private_folder import (
    CACHE_VARIABLE,
    UnsafeFolderError,
    private_folder,
    refuse_links,
    refuse_unsafe,
)
from vibroimpact.fmus.reader_process import Order, read_apart
from vibroimpact.fmus.safe_xml import refuse_large, root_of
from vibroimpact.fmus.shipped import is_shipped

#: Longest model identifier, bytes: with an extension it is a file name.
LONGEST_IDENTIFIER = 240
#: Age, s, above which a partly unpacked folder is removed if no process has locked it: its process was killed.
ABANDONED_AFTER = 600.0
INTERFACES = ("CoSimulation", "ModelExchange", "ScheduledExecution")
#: XML files that tools parse; all must be free of entities.
PARSED_XML = (
    "modelDescription.xml",
    "sources/buildDescription.xml",
    "terminalsAndIcons/terminalsAndIcons.xml",
)
BLOCK = 1 << 20
#: Number of misnamed libraries that a message lists.
MOST_LIBRARIES = 3
#: Limits for reading the XML of an FMU: processor time, s, plus its size over a rate, bytes/s; memory, bytes. Plain
#: descriptions are read at 2e6 bytes/s, and take 25 bytes of memory for each of their own.
XML_SECONDS, XML_RATE, XML_MEMORY = 10.0, 5e5, 2 << 30
LONGEST_SHOWN = 4096
_SHOWN = ".shown"
"""Ending of the file beside an FMU with its name in messages."""
_READER = "vibroimpact.fmus.packaging.description_check:read"


@dataclass(frozen=True, slots=True)
class UnpackedFmu:
    """An FMU that was checked, and its unpacked copy in the cache.

    Attributes
    ----------
    source : Path
        The FMU file.
    folder : Path
        Its unpacked contents; all processes of the machine share the folder, and none may write to it.
    sha256 : str
        Hash of the FMU file.
    fmi_version, token : str
        `2.0` or `3.0`; instantiationToken of FMI 3.0, or guid of FMI 2.0.
    identifiers : tuple of str
        Model identifiers, one for each interface, co-simulation first.
    """

    source: Path
    folder: Path
    sha256: str
    fmi_version: str
    token: str
    identifiers: tuple[str, ...]

    @property
    def shown(self) -> str:
        """Its name in messages."""
        return shown_name(self.source)

    @property
    def resources(self) -> Path:
        """Folder of the FMU's resources; it may be absent."""
        return self.folder / "resources"


def note_name(path: Path, name: str) -> None:
    """Let messages of all processes show a name for an FMU file, such as its place in an archive."""
    path.with_name(path.name + _SHOWN).write_text(name, encoding="utf-8")


def shown_name(path: Path) -> str:
    """Return the name of an FMU file in messages: its path, if no other name was noted."""
    try:
        with path.with_name(path.name + _SHOWN).open(encoding="utf-8", errors="replace") as note:
            return note.read(LONGEST_SHOWN)
    except OSError:  # there is no note, or no folder any more
        return str(path)


def content_hash(path: Path) -> str:
    """Return the SHA-256 of a file, as hexadecimal text."""
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def unpack(path: Path, *, limit: int = EXPANSION_LIMIT) -> UnpackedFmu:
    """Check an FMU and unpack it, unless this machine has already unpacked the same contents.

    An existing copy is compared with the archive byte by byte, once in a process, and again if a file changed since. So
    the loaded files are those that `sha256` names. Any number of processes may call at once: each unpacks into its own
    folder, and the first to rename it into place wins. Other processes do not remove the copy while this one lives.

    Raises
    ------
    ComponentFileError
        The file is missing, no zip, unsafe, or of more than `limit` bytes when unpacked. The description is too large,
        or not one of FMI 2.0 or 3.0.
    """
    path = Path(path)
    with opened(path) as file, zip_in(path, file) as archive:
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        members = checked_members(path, archive, limit)
        _refuse_large_xml(path, members)
        folder = _cache(path) / digest
        unpacked_cache.hold(folder)
        if not _is_intact(folder, archive, members):
            _unpack_into_place(path, archive, members, folder)
    return _described(path, folder, digest)


def _refuse_large_xml(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Raise ComponentFileError if a file that tools parse is too large for a parser."""
    for member in members:
        name = "/".join(place_of(member))
        if name in PARSED_XML:
            refuse_large(member.file_size, f"{path}: {name}")


def binary_path(fmu: UnpackedFmu) -> Path:
    """Return the shared library of an FMU for this machine.

    Raises
    ------
    ComponentFileError
        The FMU has none; the message names its platforms.
    """
    # FMI 2.0.4 also allows FMI 3.0's names of platforms; in an FMU for several, linux64 is not that of ARM
    own, exact = binary_folder(fmu.fmi_version), binary_folder("3.0")
    folders = dict.fromkeys((exact, own) if architecture() == "aarch64" else (own, exact))
    names = [f"{folder}/{fmu.identifiers[0]}{library_suffix()}" for folder in folders]
    for name in names:
        if (fmu.folder / "binaries" / name).is_file():
            return fmu.folder / "binaries" / name
    got, hint = ", ".join(platforms(fmu)) or "no binaries", f"Use an FMU made for {binary_folder('3.0')}."
    other = [member for folder in folders for member in _libraries(fmu, folder)]
    if other:
        got = f"{', '.join(other)}"
        hint = "Its file and the modelIdentifier of its description must have one name: ask its maker."
    raise ComponentFileError(
        f"{fmu.shown}: expected a binary for this machine (binaries/{names[0]}), got {got}. {hint}"
    )


def _libraries(fmu: UnpackedFmu, folder: str) -> list[str]:
    """Return the libraries in a folder of binaries, by any name."""
    files = sorted((fmu.folder / "binaries" / folder).glob(f"*{library_suffix()}"))
    return [cut(file.relative_to(fmu.folder).as_posix()) for file in files[:MOST_LIBRARIES]]


def platforms(fmu: UnpackedFmu) -> tuple[str, ...]:
    """Return the names of the platforms for which an FMU has files."""
    return tuple(sorted(p.name for p in fmu.folder.glob("binaries/*") if p.is_dir()))


def _cache(path: Path) -> Path:
    try:
        return private_folder("fmus")
    except UnsafeFolderError as error:
        raise ComponentFileError(f"{path}: was not unpacked: {error}") from error
    except OSError as error:
        raise ComponentFileError(
            f"{path}: was not unpacked: {error.filename}: expected a folder that can be written, got: "
            f"{error.strerror}. Set {CACHE_VARIABLE} to another one."
        ) from error


#: Folders that this process has compared with their archives, with the state of each file at that time.
_compared: dict[Path, list[FileState]] = {}


def _is_intact(folder: Path, archive: zipfile.ZipFile, members: list[zipfile.ZipInfo]) -> bool:
    """Return whether a folder holds the contents of its archive; further files that an FMU made do not count."""
    try:
        refuse_links(folder)
        refuse_unsafe(folder)
        seen = [_appearance(folder / member.filename, member) for member in members]
        if _compared.get(folder) != seen:
            if not all(is_folder(member) or _is_equal(folder, archive, member) for member in members):
                return False
            if all(is_settled(state) for state in seen if state):
                _compared[folder] = seen
    except UnsafeFolderError as error:
        raise ComponentFileError(f"{archive.filename}: was not unpacked: {error}") from error
    except (OSError, *DAMAGE):
        # systems clean caches, sometimes file by file; unpacking will report a damaged archive
        return False
    return True


def _appearance(path: Path, member: zipfile.ZipInfo) -> FileState:
    status = path.lstat()
    expected = stat.S_IFDIR if is_folder(member) else stat.S_IFREG
    if stat.S_IFMT(status.st_mode) != expected:
        raise FileNotFoundError(path)
    return () if is_folder(member) else file_state(status)


def _is_equal(folder: Path, archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bool:
    with archive.open(member) as source, (folder / member.filename).open("rb") as copy:
        while block := source.read(BLOCK):
            if copy.read(len(block)) != block:
                return False
        return not copy.read(1)


def _unpack_into_place(
    path: Path, archive: zipfile.ZipFile, members: list[zipfile.ZipInfo], folder: Path
) -> None:
    try:
        unpacked_cache.sweep(folder.parent, sum(member.file_size for member in members), ABANDONED_AFTER)
        temporary = Path(tempfile.mkdtemp(prefix=unpacked_cache.UNPACKING, dir=folder.parent))
        unpacked_cache.hold(temporary)
    except OSError as error:
        raise ComponentFileError(
            f"{folder.parent}: expected a folder that can be written, got: {error.strerror}. "
            f"Set {CACHE_VARIABLE} to another one."
        ) from error
    try:
        _extract(path, archive, members, temporary)
        _check_xml(path, folder.name, temporary)
        _rename(temporary, folder, archive, members)
        unpacked_cache.hold(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        unpacked_cache.let_go(temporary)
    if not _is_intact(folder, archive, members):
        raise ComponentFileError(
            f"{path}: expected an unpacked copy equal to the archive in {folder}, got another. Something else writes "
            f"there, or its file system takes different names for one. Set {CACHE_VARIABLE} to another folder."
        )


def _extract(path: Path, archive: zipfile.ZipFile, members: list[zipfile.ZipInfo], folder: Path) -> None:
    try:
        for member in members:
            target = folder / member.filename
            if is_folder(member):
                target.mkdir(parents=True, exist_ok=True)
                continue
            target.parent.mkdir(parents=True, exist_ok=True)
            # reading ends at the size in the directory, however far the data would expand
            with archive.open(member) as source, target.open("wb") as file:
                shutil.copyfileobj(source, file, BLOCK)
    except OSError as error:
        if error.errno is None:  # bz2 reports damaged data by an error without number
            raise damaged(path, error) from error
        raise ComponentFileError(
            f"{path}: could not be unpacked into {folder.parent}: {error.strerror}."
        ) from error
    except DAMAGE as error:
        raise damaged(path, error) from error


def _check_xml(path: Path, digest: str, folder: Path) -> None:
    """Raise ComponentFileError unless the XML of an FMU can be read; FMUs of the package are known by their content."""
    if not is_shipped(path.stat().st_size, digest):
        size = sum((folder / name).stat().st_size for name in PARSED_XML if (folder / name).is_file())
        _read_apart(path, folder, XML_SECONDS + size / XML_RATE)


def refuse_broken_description(fmu: UnpackedFmu, seconds: float) -> None:
    """Read the description of an FMU in a separate process, for callers that must not parse it themselves.

    Parameters
    ----------
    fmu : UnpackedFmu
    seconds : float
        Limit of the processor time for its XML, s.

    Raises
    ------
    ComponentFileError
        The XML takes longer, or breaks FMI's rules beyond repair.
    """
    refusal = _read_apart(fmu.source, fmu.folder, seconds)
    if refusal:
        raise ComponentFileError(refusal)


def _read_apart(path: Path, folder: Path, seconds: float) -> str:
    """Read the XML of an FMU in a separate process; return the broken rules of FMI.

    Raise ComponentFileError if the XML cannot be read within the limits.
    """
    answer = read_apart(Order(_READER, os.path.abspath(folder), {"where": str(path)}, seconds, XML_MEMORY))
    if answer.error == ComponentFileError.__name__:
        raise ComponentFileError(answer.text)
    if answer.verdict != "read":
        raise ComponentFileError(
            f"{path}: modelDescription.xml: expected XML that can be read, got {answer.why(seconds)[:LONGEST_REASON]}."
        )
    return str(answer.facts)


def _rename(temporary: Path, folder: Path, archive: zipfile.ZipFile, members: list[zipfile.ZipInfo]) -> None:
    try:
        temporary.rename(folder)
    except OSError as error:
        if _is_intact(folder, archive, members):
            return  # another process was first
        # the copy differs from the archive: remove it, then put ours in its place
        shutil.rmtree(folder, ignore_errors=True)
        try:
            temporary.rename(folder)
        except OSError:
            if not _is_intact(folder, archive, members):
                raise ComponentFileError(
                    f"{folder}: expected to replace a damaged copy, got: {error.strerror}. Delete it."
                ) from error


def _description(path: Path, folder: Path) -> Element:
    return root_of((folder / "modelDescription.xml").read_bytes(), f"{path}: modelDescription.xml")


@lru_cache(maxsize=16)
def value_references(fmu: UnpackedFmu) -> dict[str, int]:
    """Return the value reference of each variable of an FMU of this package, whose description is known to be valid."""
    return {
        one.get("name", ""): int(one.get("valueReference", ""))
        for one in _description(fmu.source, fmu.folder).iterfind("ModelVariables/*")
    }


def array_shapes(fmu: UnpackedFmu) -> dict[str, tuple[int, ...]]:
    """Return the dimensions of each array variable of an FMU of this package, for FMI 3.0."""
    variables = _description(fmu.source, fmu.folder).iterfind("ModelVariables/*")
    shapes = {
        one.get("name", ""): tuple(int(each.get("start", "")) for each in one.findall("Dimension"))
        for one in variables
    }
    return {name: shape for name, shape in shapes.items() if shape}


@lru_cache(maxsize=64)
def _described(path: Path, folder: Path, digest: str) -> UnpackedFmu:
    """Return the facts in an FMU's description; the digest is part of the cache key, so that contents are read once."""
    root = _description(path, folder)
    version = root.get("fmiVersion", "")
    token = root.get("guid") if version == "2.0" else root.get("instantiationToken")
    identifiers = tuple(e.get("modelIdentifier", "") for tag in INTERFACES for e in root.findall(tag))
    known = version == "2.0" or version.startswith("3.0")
    if version.startswith("1."):
        raise ComponentFileError(
            f"{path}: modelDescription.xml: expected FMI 2.0 or 3.0, got FMI {version[:20]}. "
            "Export it in one of these versions."
        )
    if not (known and token and identifiers and all(identifiers)):
        raise ComponentFileError(
            f"{path}: modelDescription.xml: expected FMI 2.0 or 3.0 with a token and a model identifier, "
            f"got version {cut(version)}, token {cut(token)}, identifiers {cut(identifiers)}."
        )
    if any(
        PurePosixPath(name).name != name or len(name.encode()) > LONGEST_IDENTIFIER for name in identifiers
    ):
        raise ComponentFileError(
            f"{path}: modelDescription.xml: modelIdentifier: expected a plain name of at most {LONGEST_IDENTIFIER} "
            f"bytes, got {cut(identifiers)}."
        )
    return UnpackedFmu(path, folder, digest, version, token, identifiers)
