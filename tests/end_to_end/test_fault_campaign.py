"""A small version of the fault campaigns of `make soak`, without the rounds that take longer than seconds."""

from __future__ import annotations

import random
import signal
from pathlib import Path

import pytest
from soak import faults
from soak._homes import KINDS

POINTS = 150
ROUNDS = ["workers killed and stopped", "a full disk", "damaged parts"]


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="processes cannot be stopped here")
def test_a_disturbed_campaign_of_misbehaving_fmus_loses_and_blames_no_innocent_point(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert faults.disturbed(random.Random(15), POINTS, ROUNDS, kind) is None
