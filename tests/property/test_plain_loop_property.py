"""Random scenes of bodies, stops and springs, by plain steps in C and step by step in Python: equal bits."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from support.coupled_parts import VERSIONS, body, contact, external, link, stop
from support.plain_runs import both

from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

motions = st.fixed_dictionaries(
    {
        "damping": st.sampled_from([0.0, 0.05, 0.2]),
        "stiffness": st.sampled_from([0.0, 0.5, 1.0]),
        "forcing.amplitude": st.floats(-1.0, 1.0),
        "forcing.angular_frequency": st.floats(0.2, 3.0),
        "velocity_start": st.sampled_from([0.0, 1.0]),
    }
)
stops = st.lists(st.sampled_from([0.0, 0.3, 0.7, 1.0]), max_size=2)
bodies = st.lists(st.tuples(motions, stops, *[st.sampled_from(VERSIONS)] * 2), min_size=1, max_size=3)


def scene(drawn: list[Any], spring: float) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return bodies between up to two stops each, and a spring between the first two."""
    parts, links = [], []
    for i, (motion, restitutions, version, other) in enumerate(drawn):
        name, parameters = f"b{i}", dict[str, Value](motion)
        for k, restitution in enumerate(restitutions, start=1):
            parameters |= external(0.5, "upper", k=k) if k == 1 else external(-0.2, "lower", k=k)
            parts.append(stop(f"{name}s{k}", restitution, other))
            links += contact(name, f"{name}s{k}", k)
        parts.append(body(name, parameters, version))
    if len(drawn) > 1 and spring:
        links.append(link("b0.displacement", "b1.force", spring))
    return parts, links


@given(
    bodies,
    st.sampled_from([0.0, 0.1, -0.4]),
    st.sampled_from([math.inf, 0.1, 0.37, 3.0]),
    st.sampled_from(["gauss_seidel", "jacobi"]),
    st.sampled_from([0, 1, 5, 1000]),
    st.lists(st.floats(0.1, 15.0), min_size=2, max_size=2),
)
@settings(max_examples=25)
def test_random_scenes_move_as_step_by_step(
    drawn: list[Any], spring: float, macro_step: float, exchange: str, room: int, ends: list[float]
) -> None:
    parts, links = scene(drawn, spring)
    options = {"macro_step": macro_step, "exchange": exchange}
    run = both(parts, links, *sorted(ends), room=lambda seen: room, **options)
    assert run.failure or run.importer.time == max(ends)
