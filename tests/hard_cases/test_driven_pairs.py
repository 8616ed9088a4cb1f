"""Bodies that hit each other, driven by another component: the force over a step depends on the end of the step."""

from __future__ import annotations

import math

import pytest
from support.coupled_parts import values
from support.pair_parts import hit, pair, run_of

from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.specification import ConnectionSpec, Exchange

RATE = 4.0 * math.pi
CLEARANCE = 0.05


@pytest.mark.parametrize("exchange", ["jacobi", "gauss_seidel", "iterated"])
@pytest.mark.parametrize("macro_step", [0.2, 0.01])
def test_bodies_that_are_driven_touch_where_they_hit_each_other(
    exchange: Exchange, macro_step: float
) -> None:
    bodies = [
        hit("driver", stiffness=RATE**2, velocity_start=RATE),
        hit("a"),
        hit("b"),
    ]
    push = ConnectionSpec(("driver", "displacement"), ("a", "force"), 100.0)
    links = [pair("a", "b", clearance=CLEARANCE)]
    run = run_of(bodies, links, connections=[push], exchange=exchange, macro_step=macro_step)
    gaps: list[float] = []

    def note(event: Event) -> None:
        assert event.component == "a"
        gaps.append(CLEARANCE + run.motion("b")[0] - run.motion("a")[0])

    run.importer.on_event = note
    run.at(3.0)
    assert gaps
    # a body moves at up to 12 m/s, and an impact is located to 2e-13 s; the iteration converges to 1e-10
    assert gaps == pytest.approx([0.0] * len(gaps), abs=2e-10)
    assert values(run.importer, "driver", "displacement")[0] == pytest.approx(math.sin(3.0 * RATE), abs=1e-9)
    run.importer.free()
