"""A sample of each kind of `make soak`, through the same runner."""

from __future__ import annotations

from pathlib import Path

import pytest

from soak._journal import Journal
from soak._kinds import kind, names
from soak._runner import run

BASE_SEED = 11
# a case of these takes seconds of processor time; tests/unit has shorter tests of each, `test_grammars` of grammars
SLOW = {"attractors", "drives", "rig_recordings", "service_kills", "service_requests", "service_strangers"}

SLOW |= {name for name in names() if name.startswith("grammar_")}


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.long] * (n in SLOW)) for n in names()])
def test_a_sample_of_each_kind_finds_no_problem(name: str, tmp_path: Path) -> None:
    one, journal = kind(name), Journal(tmp_path / "journal.jsonl")
    try:
        done = run([one], {name: one.sample}, BASE_SEED, journal, seconds=300.0, processes=1)
    finally:
        journal.close()
    problems = [f"{entry.seed}: {entry.problem}" for entry in journal.of(name) if entry.problem is not None]
    assert not problems, "\n".join(problems)
    assert done
    assert len(journal.of(name)) == one.sample
