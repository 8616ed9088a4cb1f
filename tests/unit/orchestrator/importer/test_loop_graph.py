"""The graph of algebraic loops, and how near a linear loop is to a singular one."""

import math
from collections.abc import Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.orchestrator.importer.feedthrough import between, loops_of, strong_components
from vibroimpact.orchestrator.importer.loops.slopes import scaling_of, singular_values

GRAPHS = st.integers(1, 12).flatmap(
    lambda n: st.lists(st.sets(st.integers(0, n - 1), max_size=4), min_size=n, max_size=n)
)


@given(GRAPHS)
def test_strong_components_reach_each_other_and_come_after_those_they_lead_to(rows: list[set[int]]) -> None:
    graph = dict(enumerate(rows))
    reach = np.eye(len(rows), dtype=bool)
    for i, row in graph.items():
        reach[i, list(row)] = True
    for k in range(len(rows)):
        reach |= np.outer(reach[:, k], reach[k])
    found = strong_components(graph)
    assert sorted(i for members in found for i in members) == list(range(len(rows)))
    place = {i: k for k, members in enumerate(found) for i in members}
    for i in graph:
        for j in graph:
            assert (place[i] == place[j]) == (reach[i, j] and reach[j, i])
            assert place[j] <= place[i] or not reach[i, j]


@given(GRAPHS)
def test_what_lies_between_loops_is_carried_once_and_before_the_loop_that_needs_it(
    rows: list[set[int]],
) -> None:
    graph = dict(enumerate(rows))
    loops = loops_of(graph)
    inside = {i for loop in loops for i in loop}
    carried = between(graph, loops)
    moved = [i for more in carried for i in more]
    assert len(moved) == len(set(moved))
    assert not inside & set(moved)
    ready: set[int] = set()
    for loop, more in zip(loops, carried, strict=True):
        for i in more:
            assert not graph[i] & (set(moved) | inside) - ready
            ready.add(i)
        assert not graph_needs(graph, loop) & (set(moved) | inside) - ready - set(loop)
        ready |= set(loop)


def graph_needs(graph: dict[int, set[int]], loop: Sequence[int]) -> set[int]:
    return {j for i in loop for j in graph[i]}


def test_a_chain_of_ten_thousand_connections_overflows_no_stack() -> None:
    graph = {i: {i + 1} for i in range(10_000)} | {10_000: {0}}
    assert loops_of(graph) == [tuple(range(10_001))]


@given(st.lists(st.integers(-20, 20), min_size=2, max_size=5), st.floats(-3.0, 3.0))
def test_units_of_inputs_do_not_make_a_loop_singular(exponents: list[int], gain: float) -> None:
    # a ring of gain `gain`, whose inputs have units from micrometres to meganewtons
    n = len(exponents)
    units = 10.0 ** (0.3 * np.array(exponents))
    g = np.roll(np.eye(n), 1, axis=1) * units[:, None] / units[None, :]
    g[0] *= gain
    sizes = singular_values(g)
    assert np.all(np.isfinite(scaling_of(g)))
    assert math.isclose(np.prod(sizes), abs(1.0 - gain), rel_tol=1e-9, abs_tol=1e-9)
    assert (sizes[-1] > 1e-4 * sizes[0]) or abs(1.0 - gain) < 0.01
