"""Folders of the recordings made in laboratories; they are not part of the project (licences, size)."""

from __future__ import annotations

from pathlib import Path

import pytest

from support.places import ROOT

FOLDER = ROOT.parent / "shared" / "data"
TRIALS = ROOT.parent / "shared" / "trials" / "inputs"


def recording_folder(name: str) -> Path:
    """Return the folder of one real recording; skip the test if it is absent."""
    folder = FOLDER / name
    if not folder.is_dir():
        pytest.skip(f"the recordings of {name} are not beside this checkout (shared/data/{name})")
    return folder


def trial_folder(name: str) -> Path:
    """Return the folder of the inputs of one trial; skip the test if it is absent."""
    folder = TRIALS / name
    if not folder.is_dir():
        pytest.skip(
            f"the inputs of the trial {name} are not beside this checkout (shared/trials/inputs/{name})"
        )
    return folder
