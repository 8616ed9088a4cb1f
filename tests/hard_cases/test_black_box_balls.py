"""Bounces of a ball whose FMU reports no events: on time, in their direction, and before any end."""

import math
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.coupled_parts import (
    EXCHANGES,
    VERSIONS,
    bounce_times,
    events_of,
    link,
    part,
    values,
)

from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import EventSpec

LANDINGS = ("zero", "kept", "above")
BOUNCE = 1e-10
"""Largest error of the bounce times of a black box, s."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def ball(folder: Path) -> Path:
    return fmu_factory.bouncing_ball(folder)


@pytest.mark.parametrize("landing", LANDINGS)
@pytest.mark.parametrize("macro_step", [0.001, 0.01, 0.1, 0.3, 1.0, 10.0])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_every_bounce_of_a_black_box_ball_is_on_time(
    folder: Path, fmi: str, macro_step: float, landing: str
) -> None:
    fmu = fmu_factory.bouncing_ball(folder, fmi)
    importer = Importer(
        [part("ball", fmu, landing=landing)], events=[EventSpec("ball", "h")], macro_step=macro_step
    )
    events = events_of(importer)
    importer.begin()
    importer.advance(2.54)
    found = np.array([event.time for event in events])
    expected = bounce_times(14)
    assert len(found) == len(expected)
    assert np.abs(found - expected).max() <= BOUNCE
    assert int(importer.components["ball"].group("Int64", ["bounces"]).get()[0]) == 14
    importer.free()


@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.9, 0.97])
def test_bounces_that_accumulate_end_the_search_and_not_the_run(ball: Path, restitution: float) -> None:
    importer = Importer([part("ball", ball, e=restitution)], events=[EventSpec("ball", "h")], macro_step=0.05)
    events = events_of(importer)
    importer.begin()
    importer.advance(60.0)
    assert importer.time == 60.0
    (watch,) = importer.watches
    assert watch.accumulated
    accumulation = bounce_times(1)[0] * (1.0 + restitution) / (1.0 - restitution)
    assert watch.last_time == pytest.approx(accumulation, rel=1e-7)
    found = np.array([event.time for event in events])
    # each bounce passes its rounding on to the next ones, and flights get short
    assert np.abs(found - bounce_times(len(found), restitution)).max() <= 1e-9 * len(found)
    importer.free()


@pytest.mark.parametrize("direction", ["falling", "rising", "either"])
def test_a_crossing_is_an_event_in_its_direction_only(ball: Path, direction: str) -> None:
    # thrown up at 5 m/s from 1 m without a bounce in reach: it passes 2 m twice
    first, second = ((5.0 + sign * math.sqrt(25.0 - 2.0 * 9.81)) / 9.81 for sign in (-1.0, 1.0))
    expected = {"rising": [first], "falling": [second], "either": [first, second]}[direction]
    for macro_step in (0.05, 0.7):
        importer = Importer(
            [part("ball", ball, v=5.0)],
            events=[EventSpec("ball", "h", direction, 2.0)],  # type: ignore[arg-type]
            macro_step=macro_step,
        )
        events = events_of(importer)
        importer.begin()
        importer.advance(1.1)
        found = [event.time for event in events]
        if macro_step < second - first:  # a watched value is seen only at the ends of steps
            assert found == pytest.approx(expected, abs=1e-12)
        importer.free()


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_a_component_without_states_follows_a_ball_it_cannot_go_back_with(
    folder: Path, ball: Path, exchange: str
) -> None:
    # the strict gain FMU refuses any step that does not begin at its own time
    importer = Importer(
        [part("gain", fmu_factory.gain(folder), k=-2.0), part("ball", ball)],
        [link("ball.h", "gain.u")],
        [EventSpec("ball", "h")],
        macro_step=0.3,
        exchange=exchange,  # type: ignore[arg-type]
    )
    events = events_of(importer)
    importer.begin()
    for k in range(1, 26):
        importer.advance(0.1 * k)
        assert values(importer, "gain", "y")[0] == -2.0 * values(importer, "ball", "h")[0]
    assert np.abs(np.array([e.time for e in events]) - bounce_times(len(events))).max() <= BOUNCE
    importer.free()


def test_the_end_that_a_component_asks_for_in_a_step_taken_back_does_not_count(
    folder: Path, ball: Path
) -> None:
    faulty = part("f", fmu_factory.faulty(folder), fault="terminate", fault_time=0.5)
    importer = Importer([faulty, part("ball", ball)], events=[EventSpec("ball", "h")], macro_step=0.8)
    importer.begin()
    importer.advance(3.0)
    # the ball bounces at .4515, before the fault; the step after it ends at .8
    assert importer.wants_to_end
    assert importer.time == 0.8
    importer.free()
