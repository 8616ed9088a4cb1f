"""Scenes of every kind give the bits of version 0.2: a rebuilt part must compute the same."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import bits_of_scenes
from support.bits_of_scenes import KEPT, LANES, SCENES, dataset_of, digest, fingerprint, kept

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.core.lanes import CHOICE, Instructions, instructions
from vibroimpact.fmus.errors import UsageError


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_runs_to_its_end_and_gives_the_bits_that_it_gave(name: str) -> None:
    dataset, bits = dataset_of(name), kept()
    if name.startswith("replay"):
        assert dataset.attrs["verdict"]
    else:
        assert (dataset.outcome == Outcome.ok).all()
    if not bits:
        pytest.skip(f"it ran; {KEPT.name} has no bits of a machine like this one ({fingerprint()})")
    assert digest(dataset) == bits[name], (
        "where bits are meant to change, run PYTHONPATH=tests python -m support.bits_of_scenes"
    )


def test_every_scene_has_its_bits() -> None:
    assert not kept() or set(kept()) == set(SCENES)


def test_a_question_for_help_writes_no_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bits_of_scenes, "KEPT", tmp_path / "bits.json")
    monkeypatch.setattr(bits_of_scenes, "SCENES", {})
    monkeypatch.setattr("sys.argv", ["bits_of_scenes", "--help"])
    with pytest.raises(SystemExit, match=r"^0$"):
        bits_of_scenes.main()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", LANES)
def test_lanes_give_the_same_bits_in_each_instruction_set(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    digests = set()
    for each in Instructions:
        monkeypatch.setenv(CHOICE, each.name)
        try:
            assert instructions() is each or each is Instructions.best
        except UsageError:  # this processor lacks it
            continue
        dataset = dataset_of(name)
        assert dataset.attrs["execution"] == "lanes"
        digests.add(digest(dataset))
    assert len(digests) == 1
