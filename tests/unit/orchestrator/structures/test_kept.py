"""Modes that are kept by content: read again, made anew where damaged, and only the newest."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from vibroimpact.fmus.private_folder import CACHE_VARIABLE
from vibroimpact.orchestrator.structures import kept
from vibroimpact.orchestrator.structures.kept import kept_modes
from vibroimpact.orchestrator.structures.modes import Modes

MODES = Modes(
    natural=np.array([0.0, 0.1 + 0.2]),
    damping_ratios=np.array([0.0, 1e-300]),
    damping=np.array([[0.3, 0.0], [0.0, 0.0]]),
    shapes={"tip": np.array([1.0 / 3.0, -2.0])},
    residual_vectors=1,
    error=float("inf"),
    remarks=("one",),
)


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Modes]:
    """Return the list of modes that were made, with an empty cache."""
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    return []


def modes_of(key: str, made: list[Modes]) -> Modes:
    def make() -> Modes:
        made.append(MODES)
        return MODES

    return kept_modes(key, make)


def test_kept_modes_have_the_bits_of_those_that_were_made(made: list[Modes]) -> None:
    modes_of("a", made)
    found = modes_of("a", made)
    assert len(made) == 1
    assert found is not MODES
    assert found.table() == MODES.table()
    assert (found.remarks, found.residual_vectors, found.error) == (("one",), 1, float("inf"))
    assert found.participation is None
    modes_of("b", made)
    assert len(made) == 2


@pytest.mark.parametrize("damage", [b"", b"{}", b"0" * 64 + b"\n{}"])
def test_damaged_results_are_made_anew(made: list[Modes], tmp_path: Path, damage: bytes) -> None:
    modes_of("a", made)
    (path,) = (tmp_path / "structures").glob("*.json")
    whole = path.read_bytes()
    path.write_bytes(damage)
    modes_of("a", made)
    assert len(made) == 2
    assert path.read_bytes() == whole


def test_only_the_newest_results_are_kept(
    made: list[Modes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(kept, "MOST_KEPT", 2)
    for number in range(3):
        modes_of(str(number), made)
        newest = max((tmp_path / "structures").glob("*.json"), key=lambda path: path.stat().st_mtime_ns)
        os.utime(newest, (number, number))
    assert len(list((tmp_path / "structures").glob("*.json"))) == 2
    modes_of("2", made)
    assert len(made) == 3
    modes_of("0", made)
    assert len(made) == 4


def test_without_a_cache_folder_nothing_is_kept(made: list[Modes], tmp_path: Path) -> None:
    (tmp_path / "structures").write_text("a file in its place")
    modes_of("a", made)
    modes_of("a", made)
    assert len(made) == 2
