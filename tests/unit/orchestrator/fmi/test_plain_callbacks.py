"""An FMU runs without the core library, whose callbacks a Python of another architecture does not have."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from support import fmu_factory
from support.coupled_parts import VERSIONS, part

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi import log
from vibroimpact.orchestrator.importer.master import Importer


@pytest.fixture(autouse=True)
def no_core(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def absent() -> None:
        raise ComponentError("no core library")

    monkeypatch.setattr(log, "core_library", absent)
    log.callback.cache_clear()
    yield
    log.callback.cache_clear()


@pytest.mark.parametrize("version", VERSIONS)
def test_the_last_line_of_the_log_still_explains_a_failure(tmp_path: Path, version: str) -> None:
    importer = Importer([part("f", fmu_factory.faulty(tmp_path, version), fault="error", fault_time=0.5)])
    importer.macro_step = 0.25
    importer.begin()
    with pytest.raises(ComponentError, match=r"f: fmi.DoStep returned error at time 0.25: ") as refusal:
        importer.advance(1.0)
    assert "logged nothing" not in str(refusal.value)
    importer.free()
