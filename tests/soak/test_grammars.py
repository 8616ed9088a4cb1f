"""A few files by each grammar, in this process: `test_sample` tries more, in separate processes."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from soak import grammar_requests
from soak._case import attempt
from soak._kinds import names

BASE_SEED, SEEDS = 11_000_000, 4


@pytest.fixture(autouse=True)
def _closed_service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Give files that outlive a case a folder, and close the service that answers requests."""
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))
    yield
    if grammar_requests.service.cache_info().currsize:
        grammar_requests.service()[2].close()
        grammar_requests.service.cache_clear()


@pytest.mark.parametrize("name", [name for name in names() if name.startswith("grammar_")])
def test_files_of_a_grammar_are_read_equal_or_refused_in_a_line(name: str) -> None:
    tried = [(seed, attempt(name, "soak", seed)[1]) for seed in range(BASE_SEED, BASE_SEED + SEEDS)]
    problems = [f"{name} {seed}: {problem}" for seed, problem in tried if problem is not None]
    assert not problems, "\n".join(problems)
