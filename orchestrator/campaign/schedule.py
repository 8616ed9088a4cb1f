"""The cut of a campaign's runs into chunks while they are computed.

A chunk should take about `CHUNK_SECONDS`: long enough that scheduling and writing do not count, short enough
that little is lost when a process dies. Chunks of many workers take longer, so that one scheduler hands out all of
them. The campaign measures time and size of a point as it goes. A chunk that takes much longer than planned, or whose
results are large, ends early, and its rest is handed out again.

Runs are cut in whole *units*: a single independent run, or a whole branch of a continuation sweep. Towards
the end the chunks get shorter, so that all workers finish together (guided self-scheduling). A branch that
takes longer than a chunk is computed piece by piece: its next chunk exists only when the chunk before has ended.
Several such branches are under way side by side. Branches in lanes share a chunk, however long they take: a single
branch would take as long as all of them.

A chunk of a store ends with its shard at the latest. A shard that takes less than `SHARD_SECONDS` is one chunk.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from vibroimpact.orchestrator.campaign.parts import StoredPart
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult
from vibroimpact.orchestrator.campaign.workers.pieces import MOST_BYTES
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene.sweep import Branch, first_runs

if TYPE_CHECKING:
    from vibroimpact.orchestrator.campaign.stores.shards import Shard

CHUNK_SECONDS = 2.0
"""Planned time of one chunk, s, of up to 200 workers."""

SHORTEST_SECONDS = 0.1
"""Least planned time of a chunk, s, for the last chunks of a sweep, of up to 20 workers."""

MOST_RATE = 100.0
"""Number of chunks that all workers end in a second, 1/s, twice as many towards the end of a sweep. A chunk takes some
3 ms of a processor of client and scheduler."""

FIRST_POINTS = 64
"""Number of points in a chunk before the time of a point is known; a slow chunk ends early."""

PATIENCE = 2.0
"""Time of a chunk over its planned time, above which it ends early, since points differ."""

MOST_POINTS = 1 << 21
"""Largest number of points in one chunk, whatever they cost; the size of their results bounds it, too."""

MOST_IN_LANES = 20_000
"""Number of points up to which a chunk takes on branches so that its lanes are full."""

LOST_PIECES = 16
"""Number of pieces into which a chunk is cut that killed its worker, to find the point at fault."""

BRANCHES_IN_LANES, FEWEST_IN_LANES = 32, 8
"""Least number of branches of a chunk in lanes. The first bounds it while many branches are left for each worker, so
that few lanes wait for the longest branch. The second holds when few are left, so that no lanes stay empty."""

QUEUED_PER_WORKER = 3
"""Number of chunks handed out for each worker: one runs, and the others follow without a pause."""

SHARD_SECONDS = 60.0
"""Longest time of a shard, s, that is computed as one chunk: more would be lost with its worker. A longer shard is kept
in parts until it is complete."""

LAST_SHARD_SECONDS = 5.0
"""Longest time of one of the last shards, s, computed as one chunk: other workers may wait for it."""


@dataclass(slots=True)
class Gap:
    """Runs `first` to `stop - 1` to compute; the first starts from `start`, a chunk has at most `most` runs."""

    first: int
    stop: int
    start: State | None = None
    most: int = MOST_POINTS

    def take(self, count: int) -> Gap:
        """Cut off the first `count` runs and return them."""
        taken = Gap(self.first, min(self.first + count, self.stop), self.start, self.most)
        self.first = taken.stop
        return taken


@dataclass(slots=True)
class _BranchRest:
    """The rest of one branch that is computed piece by piece, in order."""

    branch: int
    gaps: deque[Gap]
    pace: float | None = None


class ChunkSchedule:
    """Cuts the rest of a campaign into chunks for a number of workers; branches and parts are in run order.

    `in_lanes`: whether branches of one chunk run side by side; `most_bytes`: size of the results of a chunk.
    `shards`: shards of a store, which no chunk crosses.
    """

    def __init__(
        self,
        branches: Sequence[Branch],
        parts: Sequence[StoredPart],
        workers: int,
        *,
        in_lanes: bool = False,
        most_bytes: int = MOST_BYTES,
        shards: Sequence[Shard] = (),
    ) -> None:
        self._workers, self._in_lanes = workers, in_lanes
        self._most_bytes = MOST_BYTES if shards else most_bytes
        self._shards, self._shard_stops = shards, [shard.stop for shard in shards]
        self._first_runs = first_runs(branches)
        self._chained = branches[0].direction != "independent"
        self._unit = len(branches[0].points) if self._chained else 1
        self._pace: float | None = None
        self._size = 0.0
        self._in_flight = 0
        self._units: deque[Gap] = deque()
        self._waiting: deque[_BranchRest] = deque()
        self._open_branches: dict[int, _BranchRest] = {}
        runs = self._first_runs[-1] + len(branches[-1].points)
        for gap in gaps_between(parts, runs):
            self._queue(gap)
        self.left = runs - sum(part.chunk.count for part in parts)

    @property
    def most_in_flight(self) -> int:
        """Largest number of chunks handed out at a time."""
        return QUEUED_PER_WORKER * self._workers

    @property
    def seconds_left(self) -> float:
        """Time of the runs that are not handed out, at the pace so far, s; 0 before the pace is known."""
        return self.left * (self._pace or 0.0)

    def next_chunk(self) -> Chunk | None:
        """Return the next chunk to compute; None while all remaining chunks wait for the end of another chunk.

        Before the time of a point is known, each worker gets one chunk.
        """
        if self._pace is None and self._in_flight >= self._workers:
            return None
        if self._units and len(self._open_branches) < self.most_in_flight:
            return self._cut_units()
        if self._waiting:
            return self._cut_branch(self._waiting.popleft())
        return None

    def finished(self, planned: Chunk, result: ChunkResult) -> None:
        """Record a finished chunk, with the runs that it left out and the time that it took."""
        done = result.chunk
        self._in_flight -= 1
        self._size = result.size / done.count if result.size else self._size
        if result.compute_seconds > 0.0:
            latest = result.compute_seconds / done.count
            self._pace = latest if self._pace is None else 0.5 * (self._pace + latest)
        rest = self._open_branches.get(planned.branch)
        if done.stop < planned.stop:
            self._take_back(rest, Gap(done.stop, planned.stop, result.carried))
        if rest is None:
            return
        if result.compute_seconds > 0.0:
            rest.pace = result.compute_seconds / done.count
        if rest.gaps and rest.gaps[0].first == done.stop:
            rest.gaps[0].start = result.carried
        self._go_on(rest)

    def lost(self, chunk: Chunk) -> None:
        """Take back a chunk that killed its worker, to be handed out again in small pieces."""
        self._in_flight -= 1
        rest = self._open_branches.get(chunk.branch)
        if rest is None and self._chained and chunk.count <= self._unit:
            rest = self._open_branches[chunk.branch] = _BranchRest(chunk.branch, deque())
        self._take_back(rest, Gap(chunk.first, chunk.stop, chunk.start, max(1, chunk.count // LOST_PIECES)))
        if rest is not None:
            self._go_on(rest)

    def _take_back(self, rest: _BranchRest | None, gap: Gap) -> None:
        self.left += gap.stop - gap.first
        if rest is not None:
            rest.gaps.appendleft(gap)
        else:
            self._queue(gap)

    def _go_on(self, rest: _BranchRest) -> None:
        if rest.gaps:
            self._waiting.append(rest)
        else:
            del self._open_branches[rest.branch]

    def _queue(self, gap: Gap) -> None:
        """Sort the runs of a gap into whole units and pieces of branches."""
        for piece in self._at_branch_ends(gap):
            branch = self._branch_of(piece.first)
            if (piece.stop - piece.first) % self._unit == 0:
                self._units.append(piece)
            elif branch in self._open_branches:
                self._open_branches[branch].gaps.append(piece)
            else:
                rest = self._open_branches[branch] = _BranchRest(branch, deque([piece]))
                self._waiting.append(rest)

    def _at_branch_ends(self, gap: Gap) -> Iterator[Gap]:
        """Split a gap into the rest of a branch, whole branches, and the beginning of a branch."""
        offset = gap.first % self._unit
        if offset:
            yield gap.take(self._unit - offset)
        # From here on, whole branches begin at the scene's own start state.
        gap.start = None
        whole = (gap.stop - gap.first) // self._unit * self._unit
        if whole:
            yield gap.take(whole)
        if gap.first < gap.stop:
            yield gap

    def _branch_of(self, run: int) -> int:
        return bisect_right(self._first_runs, run) - 1

    def _cut_units(self) -> Chunk:
        gap = self._units[0]
        seconds = self._fair_seconds()
        points = max(min(self._points_in(seconds, self._pace), gap.most), self._points_beside(gap))
        points = self._in_shard(gap, points)
        taken = gap.take(max(points // self._unit, 1) * self._unit)
        if gap.first == gap.stop:
            self._units.popleft()
        branch = self._branch_of(taken.first)
        if points < self._unit:
            rest = self._open_branches[branch] = _BranchRest(branch, deque([taken]), self._pace)
            return self._cut_branch(rest)
        return self._hand_out(branch, taken, seconds)

    def _points_beside(self, gap: Gap) -> int:
        """Return the least number of points of a chunk in lanes, so that lanes are full; 0 without lanes."""
        if not (self._chained and self._in_lanes) or gap.most < MOST_POINTS:
            return 0
        share = -(-(gap.stop - gap.first) // (self._unit * self._workers))
        beside = min(BRANCHES_IN_LANES, max(share, FEWEST_IN_LANES))
        return min(beside, min(MOST_IN_LANES, MOST_POINTS) // self._unit) * self._unit

    def _fair_seconds(self) -> float:
        """Return the planned time of the next chunk of units, s: half of a worker's share of the rest."""
        share = self.left * (self._pace or 0.0) / (2 * self._workers)
        shortest = max(SHORTEST_SECONDS, self._workers / (2.0 * MOST_RATE))
        return min(self._chunk_seconds, max(share, shortest))

    @property
    def _chunk_seconds(self) -> float:
        """Planned time of one chunk, s."""
        return max(CHUNK_SECONDS, self._workers / MOST_RATE)

    def _cut_branch(self, rest: _BranchRest) -> Chunk:
        gap = rest.gaps[0]
        pace = rest.pace or self._pace
        seconds = SHORTEST_SECONDS if pace is None else self._chunk_seconds
        count = self._points_in(seconds, pace)
        if gap.stop - gap.first < 1.5 * count:
            # A short rest is taken along, without a chunk of its own.
            count = gap.stop - gap.first
        taken = gap.take(self._in_shard(gap, min(count, gap.most)))
        if gap.first == gap.stop:
            rest.gaps.popleft()
        return self._hand_out(rest.branch, taken, seconds)

    def _in_shard(self, gap: Gap, count: int) -> int:
        """Return the number of runs of a gap that one chunk takes: a quick shard, or no more than its rest."""
        if not self._shards:
            return count
        shard = self._shards[bisect_right(self._shard_stops, gap.first)]
        rest = min(gap.stop, shard.stop) - gap.first
        seconds = rest * self._pace if self._pace else math.inf
        most = SHARD_SECONDS if self.left > self._workers * shard.count else LAST_SHARD_SECONDS
        is_quick = seconds <= most and rest * self._size <= self._most_bytes
        return rest if rest == shard.count and gap.most >= MOST_POINTS and is_quick else min(count, rest)

    def _hand_out(self, branch: int, taken: Gap, seconds: float) -> Chunk:
        count = taken.stop - taken.first
        self.left -= count
        self._in_flight += 1
        seconds = max(seconds, count * (self._pace or 0.0)) if self._shards else seconds
        return Chunk(branch, taken.first, taken.stop, taken.start, PATIENCE * seconds, self._most_bytes)

    def _points_in(self, seconds: float, pace: float | None) -> int:
        """Return the number of points in a chunk of `seconds`, s, at a pace, s per point."""
        if pace is None:
            return FIRST_POINTS
        fitting = self._most_bytes / self._size if self._size else math.inf
        return max(1, int(min(seconds / max(pace, 1e-9), MOST_POINTS, fitting)))


def gaps_between(parts: Sequence[StoredPart], runs: int) -> Iterator[Gap]:
    """Yield the gaps between parts in run order, each with the state handed on by the part before it."""
    reached, carried = 0, None
    for part in parts:
        if part.chunk.first > reached:
            yield Gap(reached, part.chunk.first, carried)
        reached, carried = part.chunk.stop, part.carried
    if reached < runs:
        yield Gap(reached, runs, carried)
