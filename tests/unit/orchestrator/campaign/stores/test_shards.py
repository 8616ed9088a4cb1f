"""Shards of a sweep: each run lies in one shard and one cell, for any axes and any size of a shard."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.campaign_scenes import axis, scene_of
from support.store_scenes import BODY

from vibroimpact.orchestrator.campaign.schedule import ChunkSchedule
from vibroimpact.orchestrator.campaign.stores.shards import Shard, SweepGrid, grid_of
from vibroimpact.orchestrator.campaign.workers.chunks import Chunk, ChunkResult, points_of
from vibroimpact.orchestrator.run.dataset import coordinate_names
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.sweep import expand, run_count

KEYS = ("forcing.amplitude", "forcing.angular_frequency", "body.stiffness")
UP_DOWN = {"up": 1, "down": 2}


@st.composite
def sweeps(draw: st.DrawFn) -> Scene:
    keys = draw(st.permutations(KEYS))[: draw(st.integers(1, 3))]
    carried = draw(st.sampled_from([None, *keys]))
    lines = []
    for key in keys:
        values = [round(0.1 + 0.07 * k, 3) for k in range(draw(st.integers(1, 7)))]
        if key == carried:
            lines.append(axis(key, values, draw(st.sampled_from(["up", "down", "up-down"]))))
        else:
            lines.append(axis(key, draw(st.one_of(st.just(values[::-1]), st.permutations(values)))))
    return scene_of(BODY + "\n".join(lines))


def on_block(grid: SweepGrid, shard: Shard, values: NDArray[Any]) -> NDArray[Any]:
    placed = np.empty_like(values)
    placed[grid.places(shard)] = values
    return placed.reshape([cells.stop - cells.start for cells in shard.block])


@settings(max_examples=40)
@given(sweeps(), st.sampled_from([1, 2, 3, 5, 8, 20, 100, 2**20]))
def test_each_run_lies_in_one_cell_with_its_values(scene: Scene, size: int) -> None:
    grid = grid_of(scene, size)
    if grid is None:
        return
    assert grid.cells.points == run_count(scene.sweep)
    covered, reached = np.zeros(grid.cells.shape, dtype=int), 0
    for shard in grid.shards:
        assert shard.first == reached
        reached = shard.stop
        covered[shard.block] += 1
        points = points_of(expand(scene), Chunk(0, shard.first, shard.stop))
        for key, name in coordinate_names(scene).items():
            place = grid.cells.dims.index(name)
            expected = np.moveaxis(on_block(grid, shard, points.values[key]), place, -1)
            assert (expected == grid.axes[name].values[shard.block[place]]).all()
        if "direction" in grid.axes:
            ways = [UP_DOWN[word] for word in grid.axes["direction"].values[shard.block[0]]]
            assert (np.moveaxis(on_block(grid, shard, points.direction), 0, -1) == ways).all()
    assert reached == grid.cells.points
    assert (covered == 1).all()
    assert sorted(shard.number for shard in grid.shards) == list(range(grid.cells.shards))


@settings(max_examples=40)
@given(sweeps(), st.sampled_from([1, 2, 3, 5, 8, 20, 100]))
def test_a_shard_is_made_of_whole_chunks_and_has_its_objects_alone(scene: Scene, size: int) -> None:
    grid = grid_of(scene, size)
    if grid is None:
        return
    cells = grid.cells
    assert all(shard % chunk == 0 for shard, chunk in zip(cells.shard, cells.chunk, strict=True))
    for shard, (place, part) in itertools.product(grid.shards, enumerate(cells.shard)):
        along = shard.block[place]
        assert along.start % part == 0
        assert along.stop == min(along.start // part * part + part, cells.shape[place])


def test_a_large_map_has_few_objects_of_a_bounded_size() -> None:
    text = "\n".join(f'"{key}" = {{ start = 0.1, stop = 0.9, points = 10000 }}' for key in KEYS[:2])
    grid = grid_of(scene_of(BODY + text))
    assert grid is not None
    assert 90 <= grid.cells.shards <= 130
    assert math.prod(grid.cells.shard) <= 2**20
    assert math.prod(grid.cells.chunk) <= 2**16


@pytest.mark.parametrize(("seconds", "count"), [(1e-9, 100), (10.0, 10)])
def test_a_quick_shard_is_one_chunk_and_a_slow_one_is_cut(seconds: float, count: int) -> None:
    scene = scene_of(BODY + axis(KEYS[0], [0.1 + 0.001 * k for k in range(1000)]))
    grid = grid_of(scene, 100)
    assert grid is not None
    schedule = ChunkSchedule(expand(scene), [], 2, shards=grid.shards)
    first = schedule.next_chunk()
    assert first is not None
    schedule.finished(first, ChunkResult(first, None, {"ok": first.count}, seconds * first.count))
    chunks = list(iter(schedule.next_chunk, None))
    inside = {(shard.first, shard.stop) for shard in grid.shards}
    for chunk in chunks:
        assert sum(first <= chunk.first and chunk.stop <= stop for first, stop in inside) == 1
    assert any((chunk.first, chunk.stop) in inside for chunk in chunks) == (count == 100)
