"""A separate process reads the descriptions of foreign FMUs, once for each content."""

import re
import shutil
import zipfile
from pathlib import Path
from unittest.mock import Mock

import pytest

from vibroimpact.fmus import safe_xml
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging import archive
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.reader_process import Answer, Order
from vibroimpact.fmus.safe_xml import LARGEST_XML
from vibroimpact.fmus.shipped import fmu_path

DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{t}">
  <CoSimulation modelIdentifier="M"/>
  <ModelVariables><Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
  </ModelVariables><ModelStructure/>
</fmiModelDescription>
"""


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(folder))
    return folder


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return a foreign FMU."""
    path = tmp_path / "M.fmu"
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("modelDescription.xml", DESCRIPTION)
    return path


def test_a_parser_gets_a_description_whole() -> None:
    """In pieces a token of 16 MiB takes fifteen times as long."""
    given: list[int] = []

    class Parser:
        def Parse(self, content: bytes, last: bool) -> None:
            given.append(len(content))
            assert last

    content = b"<a>" + b" " * 1_000_000 + b"</a>"
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(safe_xml.expat, "ParserCreate", lambda **_: Parser())
        patched.setattr(safe_xml, "TreeBuilder", Mock)
        safe_xml.root_of(content, "a.xml")
    assert given == [len(content)]
    with pytest.raises(ComponentFileError, match=r"a\.xml: expected XML of at most"):
        safe_xml.root_of(bytes(LARGEST_XML + 1), "a.xml")


@pytest.fixture
def readers(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list of readers that the other process is asked for from now on."""
    readers = []
    original = archive.read_apart

    def read_apart(order: Order) -> Answer:
        readers.append(order.reader)
        return original(order)

    monkeypatch.setattr(archive, "read_apart", read_apart)
    return readers


def test_a_foreign_description_is_read_by_a_process_of_its_own_once(
    path: Path, tmp_path: Path, readers: list[str]
) -> None:
    for _ in range(2):
        unpack(path)
        read_description(path)
    assert readers == ["vibroimpact.fmus.packaging.description_check:read"]
    unpack(path.rename(tmp_path / "renamed.fmu"))
    assert len(readers) == 1


def test_components_of_the_package_are_known_by_their_content(tmp_path: Path, readers: list[str]) -> None:
    copy = tmp_path / "renamed.fmu"
    shutil.copy(fmu_path("Oscillator"), copy)
    unpack(copy)
    assert readers == []
    with zipfile.ZipFile(copy, "a") as file:
        file.writestr("more.txt", "changed")
    unpack(copy)
    assert len(readers) == 1


@pytest.mark.parametrize(
    ("answer", "expected"),
    [
        (Answer("late"), "expected XML that can be read, got one that the library had not read after 10 s"),
        (Answer("died", error="11"), r"got one that crashes the library which reads it \(SIGSEGV\)"),
        (Answer("raised", error="MemoryError"), "got MemoryError"),
    ],
)
def test_a_description_that_its_reader_does_not_survive_is_refused_and_not_kept(
    path: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, answer: Answer, expected: str
) -> None:
    monkeypatch.setattr(archive, "read_apart", lambda order: answer)
    with pytest.raises(ComponentFileError) as refused:
        unpack(path)
    message = str(refused.value)
    assert message.startswith(f"{path}: modelDescription.xml: ")
    assert re.search(expected, message)
    assert [folder for folder in (cache / "fmus").iterdir() if folder.is_dir()] == []
