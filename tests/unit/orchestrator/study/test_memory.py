"""Memory of ways: FMUs count as Python does, and no way profits from the memory of another way."""

from __future__ import annotations

from typing import Any

import pytest
from support.memory_of_c import memories_of_c

from vibroimpact.fmus.processes.call import call_alone
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.memory import IS_MEASURED, memory_of_ways
from vibroimpact.orchestrator.study.ways.all_ways import ways_of

pytestmark = pytest.mark.skipif(not IS_MEASURED, reason="this system does not tell it")

MEGABYTE = 10**6
OWN_PAGES = 5 * MEGABYTE
"""Bytes of Python's own pages that come back into any fork: 0.5 MB with Python 3.11, 2.4 to 3.4 MB with 3.13."""
SAMPLED: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"law": "restitution", "position": 1.0, "restitution": 0.7}],
    "record": {"recorded_periods": 20},
}


def test_memory_of_c_counts_though_it_is_free_again() -> None:
    # in forks of a process without other memory, as the ways of a study
    *of_c, nothing = call_alone(memories_of_c, [50 * MEGABYTE, 50 * MEGABYTE, 0])
    for found in of_c:  # no fork uses the memory of another fork
        assert 49.5 * MEGABYTE <= found <= 50 * MEGABYTE + OWN_PAGES
    assert nothing < OWN_PAGES


def test_a_way_that_keeps_more_samples_takes_more_memory() -> None:
    scene, given = Scene.from_dict(SAMPLED), {"rate": 60.0}
    names = [way.name for way in ways_of(scene, **given)]
    fused, rates = names.index("fused"), [k for k, name in enumerate(names) if name == "read off samples"]
    memory = memory_of_ways(scene, given, [(fused, 1.0), (rates[-1], 1.0)])
    assert list(memory) == [fused, rates[-1]]
    assert 0 < memory[fused] < memory[rates[-1]]  # 960 samples a s for 126 s


def test_memory_of_fmus_in_processes_of_their_own_is_not_told() -> None:
    guarded = SAMPLED | {"execution": {"how": "coupled", "guard": True}}
    assert memory_of_ways(Scene.from_dict(guarded), {}, [(0, 1.0)]) == {}
