"""Uploaded FMUs: a separate process reads their descriptions, at no cost to the service."""

from __future__ import annotations

import os
import zipfile
from pathlib import Path
from typing import Any

import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging import fmpy_door
from vibroimpact.service import fmus
from vibroimpact.service.fmus import FmuStore

START = (
    '<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{g}"><CoSimulation modelIdentifier="M"/>'
    "<ModelVariables>"
)
VARIABLE = '<ScalarVariable name="v{0}" valueReference="{0}" causality="local"><Real/></ScalarVariable>'
END = "</ModelVariables><ModelStructure/></fmiModelDescription>"


@pytest.fixture
def store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> FmuStore:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    read, here = fmpy_door.read_model_description, os.getpid()

    def read_elsewhere(*arguments: Any, **options: Any) -> Any:
        assert os.getpid() != here
        return read(*arguments, **options)

    monkeypatch.setattr(fmpy_door, "read_model_description", read_elsewhere)
    return FmuStore(tmp_path / "fmus", takes_uploads=True)


def sent(folder: Path, *variables: str) -> Path:
    path = folder / "sent"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", START + "".join(variables) + END)
    return path


def test_a_description_in_order_is_taken_and_not_read_in_the_service(tmp_path: Path, store: FmuStore) -> None:
    file = sent(tmp_path, VARIABLE.format(0))
    assert store.add(file, "own.fmu") == store.folder / "own.fmu"
    assert store.names() == ["own.fmu"]


def test_a_description_that_breaks_the_rules_is_refused_by_its_name(tmp_path: Path, store: FmuStore) -> None:
    file = sent(tmp_path, '<ScalarVariable valueReference="0"><Real/></ScalarVariable>')
    for _ in range(2):  # the second time it is already unpacked
        with pytest.raises(UsageError, match=r"^own\.fmu: modelDescription\.xml: ") as refused:
            store.add(file, "own.fmu")
    assert str(tmp_path) not in str(refused.value)
    assert store.names() == []


def test_a_description_that_takes_long_is_refused(
    tmp_path: Path, store: FmuStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A description of 4e5 variables, in an archive of 2 MB, blocked the service for 52 s."""
    monkeypatch.setattr(fmus, "DESCRIPTION_SECONDS", 0.05)
    file = sent(tmp_path, *(VARIABLE.format(k) for k in range(20_000)))
    with pytest.raises(UsageError, match=r"^own\.fmu: modelDescription\.xml: expected XML that can be read"):
        store.add(file, "own.fmu")
    assert store.names() == []
