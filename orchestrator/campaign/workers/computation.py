"""Keeps workers busy with the chunks of a schedule until every run is on the disk.

A chunk whose worker died twice is cut into smaller chunks. A lost single run is tried once more while no other chunk
is under way, to find the point that kills its process. Workers may also be taken away faster than a point lasts.
Before its row gets the outcome of a crash, a point therefore runs in its own process, which is no worker.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.processes.call import ProcessDied, call_alone
from vibroimpact.orchestrator.campaign.destination import ShardParts
from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.stores.grown import seal_parts
from vibroimpact.orchestrator.campaign.stores.seals import Seal
from vibroimpact.orchestrator.campaign.workers.chunks import (
    Chunk,
    ChunkResult,
    Work,
    run_chunk,
    write_crashed,
)
from vibroimpact.orchestrator.campaign.workers.pool import Finished, WorkerPool

CRASH_MESSAGE = "this point kills the process that runs it"


class Computation:
    """One pass over a schedule; `done` gets the result of each chunk whose part is on the disk.

    `done` returns the shards that are complete by the chunk; workers write them, and `sealed` gets their seals. A shard
    whose writer fails stays in its parts.
    """

    def __init__(
        self,
        pool: WorkerPool,
        work: Work,
        schedule: ChunkSchedule,
        done: Callable[[ChunkResult], Sequence[ShardParts]],
        sealed: Callable[[Seal], None],
    ) -> None:
        self._pool = pool
        self._work = work
        self._schedule = schedule
        self._done = done
        self._sealed = sealed
        self._writing: set[int] = set()
        self._in_flight: dict[int, Chunk] = {}
        self._suspects: list[Chunk] = []
        self._alone: Chunk | None = None

    def run(self) -> None:
        """Compute all chunks that are left; raise VibroimpactError unless each can be computed and written."""
        while self._hand_out():
            ended = self._pool.next_finished()
            if ended.ticket in self._writing:
                self._written(ended)
                continue
            planned = self._in_flight.pop(ended.ticket)
            if ended.worker_lost:
                self._lost(planned)
            elif ended.error is not None:
                raise ended.error
            else:
                self._ended(planned, ended.result)

    def _hand_out(self) -> bool:
        """Hand out enough chunks to the workers; return whether any chunk is under way."""
        while len(self._in_flight) < self._schedule.most_in_flight and (chunk := self._schedule.next_chunk()):
            self._submit(chunk)
        if not self._in_flight and self._suspects:
            self._alone = self._suspects.pop()
            self._submit(self._alone)
        return bool(self._in_flight or self._writing)

    def _written(self, ended: Finished) -> None:
        """Take note of a shard that a worker has written; damaged parts and lost workers are met again at the end."""
        self._writing.remove(ended.ticket)
        if ended.error is None:
            self._sealed(ended.result)
        elif not ended.worker_lost and not isinstance(ended.error, DatasetError):
            raise ended.error

    def _submit(self, chunk: Chunk) -> None:
        self._in_flight[self._pool.submit(run_chunk, self._work, chunk)] = chunk

    def _ended(self, planned: Chunk, result: ChunkResult) -> None:
        self._schedule.finished(planned, result)
        for complete in self._done(result):
            self._writing.add(self._pool.submit(seal_parts, self._work, complete))

    def _lost(self, planned: Chunk) -> None:
        if planned is self._alone:
            self._ended(planned, self._tried_alone(planned))
        elif planned.count == 1:
            self._suspects.append(planned)
        else:
            self._schedule.lost(planned)

    def _tried_alone(self, chunk: Chunk) -> ChunkResult:
        """Run a point in its own process after its workers died; write it as crashed if that process dies, too."""
        if not self._pool.is_local:
            # This machine may differ from the machines of the workers.
            return write_crashed(
                self._work, chunk, f"{CRASH_MESSAGE}, or its workers were taken away each time"
            )
        try:
            result: ChunkResult = call_alone(run_chunk, self._work, chunk)
        except ProcessDied as died:
            return write_crashed(self._work, chunk, f"{CRASH_MESSAGE}: run alone, {died}")
        return result
