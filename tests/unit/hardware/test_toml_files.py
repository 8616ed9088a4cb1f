"""TOML files that a user writes beside measurements: a file that is too large is refused, never read in part."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.sweep.settings import read_sweep
from vibroimpact.hardware.recordings.settings import read_settings
from vibroimpact.hardware.rig.calibration import read_calibrations
from vibroimpact.hardware.toml_files import MOST_BYTES, text_of
from vibroimpact.hardware.virtual_rig.settings import read_rig

KINDS: dict[str, Callable[[Path], object]] = {
    "a settings file": read_settings,
    "a calibration": lambda path: read_calibrations([path], []),
    "the file of a rig": read_rig,
    "the file of a sweep": read_sweep,
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_that_is_too_large_is_refused_by_its_size(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "long.toml"
    path.write_text("#\n" * 2**18, encoding="utf-8")
    with pytest.raises(
        UsageError, match=rf"long\.toml: expected {kind} \(TOML\), got one of more than \d+ bytes"
    ):
        KINDS[kind](path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_file_of_other_bytes_is_refused(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "other.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(UsageError, match=rf"expected {kind} \(TOML\), got none: it is no UTF-8 text"):
        KINDS[kind](path)


def test_a_character_that_the_limit_cuts_is_no_other_fault(tmp_path: Path) -> None:
    path = tmp_path / "long.toml"
    path.write_text("é" * MOST_BYTES, encoding="utf-8")
    with pytest.raises(UsageError, match="got one of more than"):
        text_of(path, "a calibration")
    path.write_text("#" * MOST_BYTES, encoding="utf-8")
    assert len(text_of(path, "a calibration")) == MOST_BYTES
