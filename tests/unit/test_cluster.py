"""The pool of workers: those that die are replaced, and what cannot work is said once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest
from busy_runner import die_while

from vibroimpact.fmus.errors import CampaignError
from vibroimpact.orchestrator import cluster
from vibroimpact.orchestrator.cluster import MOST_DEATHS, MOST_STARTS, open_workers

kills_itself = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")


@kills_itself
def test_a_worker_that_dies_before_the_first_chunk_is_replaced_and_the_new_one_is_asked(
    tmp_path: Path,
) -> None:
    for wish in range(2):
        (tmp_path / f"{wish}").touch()
    with open_workers(workers=2) as pool:
        answers = pool.call_everywhere(die_while, str(tmp_path))
        assert len(set(answers.values())) == 2
        assert answers.keys() == set(pool.worker_addresses())
        assert pool.lost_workers == 2


@kills_itself
def test_a_call_that_kills_every_worker_is_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "MOST_DEATHS", 1)
    for wish in range(MOST_DEATHS):
        (tmp_path / f"{wish}").touch()
    with (
        pytest.raises(CampaignError, match="got 2 that died while they loaded the components"),
        open_workers(workers=1) as pool,
    ):
        pool.call_everywhere(die_while, str(tmp_path))


class _Stillborn:
    """Stands in for a cluster of which a worker dies while it starts."""

    def __init__(self, starts: list[int], failures: int) -> None:
        self._starts, self._failures = starts, failures

    def __call__(self, **options: Any) -> str:
        self._starts.append(options["n_workers"])
        if len(self._starts) <= self._failures:
            raise RuntimeError("Nanny failed to start.")
        return "started"


def test_workers_that_die_while_they_start_are_started_again(monkeypatch: pytest.MonkeyPatch) -> None:
    starts: list[int] = []
    monkeypatch.setattr(cluster, "LocalCluster", _Stillborn(starts, MOST_STARTS - 1))
    assert cluster._started_workers(3) == "started"
    assert starts == [3] * MOST_STARTS


def test_workers_that_never_start_are_one_clear_error(monkeypatch: pytest.MonkeyPatch) -> None:
    starts: list[int] = []
    monkeypatch.setattr(cluster, "LocalCluster", _Stillborn(starts, 100))
    with pytest.raises(CampaignError, match="expected 3 workers that start, got a failure 5 times"):
        cluster._started_workers(3)
    assert len(starts) == MOST_STARTS
