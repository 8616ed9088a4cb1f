"""An SSP archive, opened safely: its XML, and the members that a system names."""

from __future__ import annotations

import re
import shutil
import zipfile
from contextlib import ExitStack
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Self
from urllib.parse import SplitResult, parse_qs, unquote, urlsplit
from xml.etree.ElementTree import Element

from vibroimpact.fmus.packaging.zip_members import (
    DAMAGE,
    checked_members,
    damaged,
    is_folder,
    opened,
    place_of,
    zip_in,
)
from vibroimpact.fmus.safe_xml import refuse_large
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.names import SSD_FILE
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.xml_names import ssp_root

_BLOCK = 1 << 20
_INSIDE = "Pack the file into its resources folder."
_DRIVE = re.compile(r"[A-Za-z]:")
_PROXY = "proxyfmu"
_THIS_MACHINE = ("localhost", "127.0.0.1")


def undeclared_prefixes(file: str, prefixes: tuple[str, ...]) -> list[str]:
    """Return the remark on prefixes that a file does not declare; empty without such prefixes."""
    named = ", ".join(prefixes)
    return [f"{file}: prefixes without a declaration have the namespaces of SSP: {named}"] if named else []


class SspArchive:
    """An archive with members that are safe to read.

    ComponentFileError: the file is missing, no zip, unsafe, or without `SystemStructure.ssd`.
    """

    def __init__(self, path: Path, shown: Path | None = None) -> None:
        self.path = shown or path
        self.remarks: list[str] = []
        """Faults of its files that other tools accept, and what was taken."""
        self._inner: dict[str, SspArchive] = {}
        with ExitStack() as stack:
            file = stack.enter_context(opened(path, "SSP"))
            self._zip = stack.enter_context(zip_in(self.path, file, "SSP"))
            members = checked_members(self.path, self._zip, needed=SSD_FILE, kind="SSP")
            self._members = {"/".join(place_of(m)): m for m in members if not is_folder(m)}
            self._stack = stack.pop_all()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def xml(self, member: str) -> Element:
        """Return the root of an XML member; undeclared prefixes of SSP are added to the remarks.

        ComponentFileError: the member is too large, damaged, not well-formed, or declares entities.
        """
        info = self._members[member]
        refuse_large(info.file_size, f"{self.path}: {member}")
        root, undeclared = ssp_root(self._content(info), f"{self.path}: {member}")
        self.remarks += undeclared_prefixes(member, undeclared)
        return root

    def inner(self, member: str) -> SspArchive:
        """Return an archive that is a member; its own members are `MEMBER/NAME` for `copy`.

        ComponentFileError: as for this class.
        """
        if member not in self._inner:
            folder = self._stack.enter_context(TemporaryDirectory(prefix="vibroimpact-ssp-"))
            file = Path(folder) / "inner.ssp"
            self.copy(member, file)
            inner = SspArchive(file, Path(f"{self.path}: {member}"))
            self._inner[member] = self._stack.enter_context(inner)
        return self._inner[member]

    def member(self, uri: str, where: str, folder: str = "") -> str:
        """Return the member that a `source` in a file of a folder names.

        RefusalError: it is outside the archive, or missing.
        """
        try:
            parts = urlsplit(uri)
        except ValueError:  # brackets of no address
            raise RefusalError(where, "a file of the archive", quoted(uri), _INSIDE) from None
        name = unquote(parts.path)
        path = PurePosixPath(name)
        if parts.scheme == _PROXY:
            return self._proxied(uri, parts, where, folder)
        leaves = parts.scheme or parts.netloc or path.is_absolute() or ".." in path.parts or "\\" in name
        if leaves or _DRIVE.match(name):
            raise RefusalError(where, "a file of the archive", quoted(uri), _INSIDE)
        if parts.fragment or parts.query or uri.startswith("#"):
            hint = "References into a file are not available in this version: write the part out."
            raise RefusalError(where, "a whole file of the archive", quoted(uri), hint)
        member = str(PurePosixPath(folder) / path)
        if member not in self._members:
            hint = "Pack it, or correct the source in SystemStructure.ssd."
            raise RefusalError(where, "a file of the archive", f"{quoted(uri)}, which it does not have", hint)
        return member

    def _proxied(self, uri: str, parts: SplitResult, where: str, folder: str) -> str:
        """Return the member behind libcosim's address of an FMU in another process of this machine."""
        files = parse_qs(parts.query, max_num_fields=10).get("file", [])
        host = parts.netloc.rpartition("@")[2].partition(":")[0]
        if host not in _THIS_MACHINE or len(files) != 1 or urlsplit(files[0]).scheme == _PROXY:
            hint = "FMUs on other machines are not available in this version: pack the file."
            raise RefusalError(where, f"{_PROXY}://localhost?file=NAME", quoted(uri), hint)
        self.remarks.append(f"{where}: {quoted(uri)} is taken from the archive, as any other FMU")
        return self.member(files[0], where, folder)

    def copy(self, member: str, target: Path) -> None:
        """Write a member to a file; a damaged member raises ComponentFileError, an unwritable file OSError."""
        for name, inner in self._inner.items():
            if member.startswith(f"{name}/"):
                inner.copy(member.removeprefix(f"{name}/"), target)
                return
        with target.open("xb") as file:
            try:
                with self._zip.open(self._members[member]) as source:
                    shutil.copyfileobj(source, file, _BLOCK)
            except OSError as error:
                if error.errno is None:  # bz2 reports damaged data without an errno
                    raise damaged(self.path, error, "SSP") from error
                raise
            except DAMAGE as error:
                raise damaged(self.path, error, "SSP") from error

    def _content(self, info: zipfile.ZipInfo) -> bytes:
        try:
            return self._zip.read(info)
        except (OSError, *DAMAGE) as error:
            raise damaged(self.path, error, "SSP") from error
