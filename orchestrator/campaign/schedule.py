"""How the runs of a campaign are cut into chunks while they are computed.

A chunk should take about `CHUNK_SECONDS`: long enough that scheduling and writing do not count, short enough
that little is lost when a process dies. How long a point takes is measured as the campaign goes; a chunk that
turns out much longer than planned ends early, and what is left of it is handed out again.

Runs are cut in whole *units*: a single independent run, or a whole branch of a continuation sweep. Towards
the end the chunks get shorter, so that all workers finish together (guided self-scheduling). A branch that
takes longer than a chunk becomes a *strand*: its next chunk exists only when the one before has ended,
and strands run side by side. Branches that run side by side in one chunk, in lanes, are handed out together however
long they take: one alone would take as long as all of them.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from vibroimpact.orchestrator.campaign.chunks import Chunk, ChunkResult
from vibroimpact.orchestrator.campaign.parts import StoredPart
from vibroimpact.orchestrator.run.points import State
from vibroimpact.orchestrator.scene.sweep import Branch

CHUNK_SECONDS = 1.0
"""Work in one chunk, s."""

SHORTEST_SECONDS = 0.1
"""Work in the last chunks of a sweep, s."""

FIRST_POINTS = 64
"""Points in a chunk while nothing is known of how long they take; it ends early when they take long."""

PATIENCE = 2.0
"""A chunk ends early when it takes this many times as long as was planned: points differ."""

MOST_POINTS = 20_000
"""Points in one chunk, however quick they are: a part must fit in memory."""

LOST_PIECES = 16
"""Into how many pieces a chunk is cut when it killed its worker, to find the point that does it."""

BRANCHES_IN_LANES, FEWEST_IN_LANES = 32, 8
"""Branches that a chunk should have at least where they run in lanes, so that few lanes wait for the longest branch;
and at least where not many are left for each worker, lest lanes are empty."""

QUEUED_PER_WORKER = 3
"""Chunks handed out for each worker: one that runs, the rest so that it never waits for the next."""


@dataclass(slots=True)
class Gap:
    """Runs `first` to `stop - 1` to compute; the first starts from `start`, a chunk has at most `most`."""

    first: int
    stop: int
    start: State | None = None
    most: int = MOST_POINTS

    def take(self, count: int) -> Gap:
        """Cut the first runs off."""
        taken = Gap(self.first, min(self.first + count, self.stop), self.start, self.most)
        self.first = taken.stop
        return taken


@dataclass(slots=True)
class _Strand:
    """What is left of one branch that is computed piece by piece, in order."""

    branch: int
    gaps: deque[Gap]
    pace: float | None = None


class ChunkSchedule:
    """Cuts what is left of a campaign into chunks for a number of workers; branches and parts are in run order.

    `in_lanes`: branches of one chunk run side by side.
    """

    def __init__(
        self, branches: Sequence[Branch], parts: Sequence[StoredPart], workers: int, *, in_lanes: bool = False
    ) -> None:
        self._workers, self._in_lanes = workers, in_lanes
        self._first_runs = [branch.points.first_index for branch in branches]
        self._chained = branches[0].direction != "independent"
        self._unit = len(branches[0].points) if self._chained else 1
        self._pace: float | None = None
        self._units: deque[Gap] = deque()
        self._strands: deque[_Strand] = deque()
        self._begun: dict[int, _Strand] = {}
        runs = self._first_runs[-1] + len(branches[-1].points)
        for gap in gaps_between(parts, runs):
            self._queue(gap)
        self.left = runs - sum(part.chunk.count for part in parts)

    @property
    def most_in_flight(self) -> int:
        """How many chunks are worth handing out at a time."""
        return QUEUED_PER_WORKER * self._workers

    @property
    def seconds_left(self) -> float:
        """Return how long the runs that are not handed out take at the pace so far, s; 0 before it is known."""
        return self.left * (self._pace or 0.0)

    def next_chunk(self) -> Chunk | None:
        """Hand out a chunk; None when nothing can be computed before another chunk has ended."""
        if self._units and len(self._begun) < self.most_in_flight:
            return self._cut_units()
        if self._strands:
            return self._cut_strand(self._strands.popleft())
        return None

    def finished(self, asked: Chunk, result: ChunkResult) -> None:
        """Take note of a chunk that is done, with what it left open and how long it took."""
        done = result.chunk
        if result.compute_seconds > 0.0:
            latest = result.compute_seconds / done.count
            self._pace = latest if self._pace is None else 0.5 * (self._pace + latest)
        strand = self._begun.get(asked.branch)
        if done.stop < asked.stop:
            self._take_back(strand, Gap(done.stop, asked.stop, result.carried))
        if strand is None:
            return
        if result.compute_seconds > 0.0:
            strand.pace = result.compute_seconds / done.count
        if strand.gaps and strand.gaps[0].first == done.stop:
            strand.gaps[0].start = result.carried
        self._go_on(strand)

    def lost(self, chunk: Chunk) -> None:
        """Take back a chunk that killed its worker, to be handed out again in small pieces."""
        strand = self._begun.get(chunk.branch)
        if strand is None and self._chained and chunk.count <= self._unit:
            strand = self._begun[chunk.branch] = _Strand(chunk.branch, deque())
        self._take_back(strand, Gap(chunk.first, chunk.stop, chunk.start, max(1, chunk.count // LOST_PIECES)))
        if strand is not None:
            self._go_on(strand)

    def _take_back(self, strand: _Strand | None, gap: Gap) -> None:
        self.left += gap.stop - gap.first
        if strand is not None:
            strand.gaps.appendleft(gap)
        else:
            self._queue(gap)

    def _go_on(self, strand: _Strand) -> None:
        if strand.gaps:
            self._strands.append(strand)
        else:
            del self._begun[strand.branch]

    def _queue(self, gap: Gap) -> None:
        """Sort the runs of a gap into whole units and strands."""
        for piece in self._at_branch_ends(gap):
            branch = self._branch_of(piece.first)
            if (piece.stop - piece.first) % self._unit == 0:
                self._units.append(piece)
            elif branch in self._begun:
                self._begun[branch].gaps.append(piece)
            else:
                strand = self._begun[branch] = _Strand(branch, deque([piece]))
                self._strands.append(strand)

    def _at_branch_ends(self, gap: Gap) -> Iterator[Gap]:
        """Split a gap into the rest of a branch, whole branches, and the beginning of a branch."""
        offset = gap.first % self._unit
        if offset:
            yield gap.take(self._unit - offset)
        # From here on branches begin, at the scene's own start state.
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
        points = max(min(_points_in(seconds, self._pace), gap.most), self._points_beside(gap))
        taken = gap.take(max(points // self._unit, 1) * self._unit)
        if gap.first == gap.stop:
            self._units.popleft()
        branch = self._branch_of(taken.first)
        if points < self._unit:
            strand = self._begun[branch] = _Strand(branch, deque([taken]), self._pace)
            return self._cut_strand(strand)
        return self._hand_out(branch, taken, seconds)

    def _points_beside(self, gap: Gap) -> int:
        """Return how many points a chunk has at least for its branches to run side by side; 0 where they do not."""
        if not (self._chained and self._in_lanes) or gap.most < MOST_POINTS:
            return 0
        share = -(-(gap.stop - gap.first) // (self._unit * self._workers))
        beside = min(BRANCHES_IN_LANES, max(share, FEWEST_IN_LANES))
        return min(beside, MOST_POINTS // self._unit) * self._unit

    def _fair_seconds(self) -> float:
        """Return how long the next chunk of units should take: half of a worker's share of the rest."""
        share = self.left * (self._pace or 0.0) / (2 * self._workers)
        return min(CHUNK_SECONDS, max(share, SHORTEST_SECONDS))

    def _cut_strand(self, strand: _Strand) -> Chunk:
        gap = strand.gaps[0]
        pace = strand.pace or self._pace
        seconds = SHORTEST_SECONDS if pace is None else CHUNK_SECONDS
        count = _points_in(seconds, pace)
        if gap.stop - gap.first < 1.5 * count:
            # A short rest is not worth a chunk of its own.
            count = gap.stop - gap.first
        taken = gap.take(min(count, gap.most))
        if gap.first == gap.stop:
            strand.gaps.popleft()
        return self._hand_out(strand.branch, taken, seconds)

    def _hand_out(self, branch: int, taken: Gap, seconds: float) -> Chunk:
        self.left -= taken.stop - taken.first
        return Chunk(branch, taken.first, taken.stop, taken.start, PATIENCE * seconds)


def _points_in(seconds: float, pace: float | None) -> int:
    """Return how many points make a chunk of this length."""
    if pace is None:
        return FIRST_POINTS
    return max(1, min(int(seconds / max(pace, 1e-9)), MOST_POINTS))


def gaps_between(parts: Sequence[StoredPart], runs: int) -> Iterator[Gap]:
    """Yield the gaps between parts in run order, each with the state that the part before it hands on."""
    reached, carried = 0, None
    for part in parts:
        if part.chunk.first > reached:
            yield Gap(reached, part.chunk.first, carried)
        reached, carried = part.chunk.stop, part.carried
    if reached < runs:
        yield Gap(reached, runs, carried)
