"""The pool of workers: dead workers are replaced, and a fatal problem is reported once."""

from __future__ import annotations

import asyncio
import gc
import os
import ssl
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from distributed.comm import connect
from distributed.security import Security
from support.busy_runner import die_while, freeze_once, keep_the_interpreter, same

from vibroimpact.fmus.errors import CampaignError, UsageError
from vibroimpact.orchestrator.campaign.workers import cluster
from vibroimpact.orchestrator.campaign.workers import pool as pool_module
from vibroimpact.orchestrator.campaign.workers.cluster import MOST_STARTS, open_workers
from vibroimpact.orchestrator.campaign.workers.pool import MOST_DEATHS
from vibroimpact.orchestrator.run.progress import Progress

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


@pytest.mark.long
@kills_itself
def test_a_call_that_kills_every_worker_is_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pool_module, "MOST_DEATHS", 1)
    for wish in range(MOST_DEATHS):
        (tmp_path / f"{wish}").touch()
    with (
        pytest.raises(CampaignError, match="got 2 that died while they loaded the components"),
        open_workers(workers=1) as pool,
    ):
        pool.call_everywhere(die_while, str(tmp_path))


def test_work_whose_message_waits_for_a_clock_that_was_set_back_is_sent_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pool_module, "STALL_SECONDS", 1.0)
    noted = Notes()
    with open_workers(workers=1, progress=noted) as pool:
        pool.submit(same, 1)
        assert pool.next_finished().result == 1
        # the state of Dask's sender when the clock goes back 20 minutes just after a message
        pool._client.scheduler_comm.next_deadline = time.time() + 1200.0
        ticket = pool.submit(same, 2)
        finished = pool.next_finished()
        assert (finished.ticket, finished.result) == (ticket, 2)
    assert len(noted.notes) == 1
    assert "clock that was set back" in noted.notes[0]


def test_a_long_point_is_no_stall(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pool_module, "STALL_SECONDS", 0.1)
    monkeypatch.setattr(pool_module, "LOOK_SECONDS", 0.1)
    noted = Notes()
    with open_workers(workers=1, progress=noted) as pool:
        pool.submit(time.sleep, 2.0)
        assert pool.next_finished().error is None
    assert not noted.notes


@pytest.mark.skipif(sys.platform == "win32", reason="sleep of the C library")
def test_a_worker_that_loads_for_long_and_is_done_when_it_answers_is_no_stall(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # with 15 processes on 2 cores, a campaign ended with the error of a clock that was set back
    monkeypatch.setattr(pool_module, "STALL_SECONDS", 0.5)
    monkeypatch.setattr(pool_module, "LOOK_SECONDS", 0.2)
    noted = Notes()
    with open_workers(workers=1, progress=noted) as pool:
        assert list(pool.call_everywhere(keep_the_interpreter, 3).values()) == [3]
    assert not noted.notes


def test_an_answer_to_another_call_of_dask_is_not_taken_for_workers_that_are_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Dask's own call asks for no workers; under load its answer came between, and two living workers counted as lost
    monkeypatch.setitem(cluster.QUIET, "distributed.client.scheduler-info-interval", "1ms")
    with open_workers(workers=1) as pool:
        looks = {pool.worker_addresses() for _ in range(200)}
        assert len(looks) == 1
        assert pool.lost_workers == 0


def test_the_time_in_which_a_campaign_was_suspended_is_not_waited_for_workers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # after minutes of Ctrl-Z Dask considers the workers dead, and starts them again
    monkeypatch.setattr(pool_module, "WORKERLESS_SECONDS", 1.0)
    with open_workers(workers=1) as pool:
        (worker,) = pool.worker_addresses()
        awake = time.monotonic() + 400.0
        with monkeypatch.context() as asleep:
            asleep.setattr(pool, "_workers_there", frozenset)
            asleep.setattr(pool_module, "time", SimpleNamespace(monotonic=lambda: awake))
            assert pool.worker_addresses() == ()
            asleep.setattr(pool_module, "time", SimpleNamespace(monotonic=lambda: awake + 2.0))
            with pytest.raises(CampaignError, match="got none for 1 s"):
                pool.worker_addresses()
        assert pool.worker_addresses() == (worker,)


@pytest.mark.long
@kills_itself
def test_a_worker_that_does_not_answer_any_more_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, seconds in (("STALL_SECONDS", 0.5), ("LOOK_SECONDS", 0.2), ("RESULT_SECONDS", 1.0)):
        monkeypatch.setattr(pool_module, name, seconds)
    noted = Notes()
    (tmp_path / "wish").touch()
    with open_workers(workers=1, progress=noted) as pool:
        pool.submit(freeze_once, str(tmp_path / "wish"))
        assert pool.next_finished().result == "thawed"
    assert len(noted.notes) == 1


def test_a_call_of_dask_that_ctrl_c_ended_before_it_began_says_nothing(
    recwarn: pytest.WarningsRecorder,
) -> None:
    async def never_awaited() -> None:
        raise AssertionError

    with open_workers(workers=1):
        left = never_awaited()
        del left
        gc.collect()
    assert not [one for one in recwarn if "never awaited" in str(one.message)]


class Notes(Progress):
    """Keeps its notes."""

    def __init__(self) -> None:
        super().__init__()
        self.notes: list[str] = []

    def note(self, text: str) -> None:
        self.notes.append(text)


def _strangers() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the ways in which a stranger without the key may try to connect."""
    yield "tcp", {}
    yield "tls", Security.temporary().get_connection_args("client")
    trusting = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    trusting.check_hostname, trusting.verify_mode = False, ssl.CERT_NONE
    yield "tls", {"ssl_context": trusting}


def _answers(address: str, options: dict[str, Any]) -> bool:
    """Return whether the Dask server at an address executes a call."""

    async def ask() -> bool:
        comm = await connect(address, timeout=2.0, **options)
        await comm.write({"op": "identity", "reply": True})
        answer = await comm.read()
        await comm.close()
        return "id" in answer

    try:
        return asyncio.run(ask())
    except OSError:
        return False


def test_nobody_without_the_key_of_a_campaign_reaches_its_processes() -> None:
    with open_workers(workers=1) as pool:
        client = pool._client
        (worker,) = client.scheduler_info()["workers"].values()
        own = client.security.get_connection_args("client")
        for address in (client.scheduler.address, *pool.worker_addresses(), worker["nanny"]):
            assert _answers(address, own)
            for protocol, options in _strangers():
                assert not _answers(f"{protocol}://{address.partition('://')[2]}", options)


def test_the_key_of_a_campaign_lies_where_only_its_user_reads_and_the_next_command_sweeps() -> None:
    # Dask would write a key in memory to a new folder for each connection, which stays after kill -9
    with open_workers(workers=1) as pool:
        security = pool._client.security
        for role in ("client", "scheduler", "worker"):
            folder = Path(getattr(security, f"tls_{role}_key")).parent
            assert folder.name.startswith("vibroimpact-scratch-workers-")
            assert os.name == "nt" or folder.stat().st_mode & 0o077 == 0
    assert not folder.exists()


def test_a_machine_without_cryptography_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cryptography", None)
    with pytest.raises(UsageError, match="pip install cryptography"), open_workers(workers=1):
        pass


class _Stillborn:
    """Stands in for a cluster with a worker that dies during its start."""

    def __init__(self, starts: list[int], failures: int) -> None:
        self._starts, self._failures = starts, failures

    def __call__(self, **options: Any) -> str:
        self._starts.append(options["n_workers"])
        if len(self._starts) <= self._failures:
            raise RuntimeError("Nanny failed to start.")
        return "started"


def test_workers_that_die_while_they_start_are_started_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[int] = []
    monkeypatch.setattr(cluster, "LocalCluster", _Stillborn(starts, MOST_STARTS - 1))
    assert cluster._started_workers(3, tmp_path) == "started"
    assert starts == [3] * MOST_STARTS


def test_workers_that_never_start_are_one_clear_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    starts: list[int] = []
    monkeypatch.setattr(cluster, "LocalCluster", _Stillborn(starts, 100))
    with pytest.raises(CampaignError, match="expected 3 workers that start, got a failure 5 times"):
        cluster._started_workers(3, tmp_path)
    assert len(starts) == MOST_STARTS


def test_a_scheduler_that_says_two_things_at_once_is_connected_to_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tries = []

    class Busy:
        def __init__(self, address: str, **_: object) -> None:
            tries.append(address)
            assert len(tries) == 3, "as Dask's client does of its first message"

    monkeypatch.setattr(cluster, "Client", Busy)
    assert isinstance(cluster._connected("tcp://127.0.0.1:8786", Security()), Busy)
    assert len(tries) == 3
    tries.clear()
    monkeypatch.setattr(cluster, "MOST_STARTS", 2)
    with pytest.raises(AssertionError):
        cluster._connected("tcp://127.0.0.1:8786", Security())
