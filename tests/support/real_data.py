"""Where tests find the recordings made in laboratories; they are not part of the project (licences, size)."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.places import ROOT

FOLDER = ROOT.parent / "shared" / "data"


def recording_folder(name: str) -> Path:
    """Return the folder of one real recording; skip the test where it is absent."""
    folder = FOLDER / name
    if not folder.is_dir():
        pytest.skip(f"the recordings of {name} are not beside this checkout (shared/data/{name})")
    return folder
