"""Components that locate their own events and cannot go back: others go back to their events, and they stay."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import fmu_factory
from support.coupled_parts import link, part, values
from support.fmu_factory import redescribed

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, Exchange

STATES = ('canGetAndSetFMUState="true"', 'canGetAndSetFMUState="false"')
GRAVITY = -9.81


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stateless")
    redescribed(fmu_factory.stepped_ball(folder), folder / "Ball.fmu", STATES)
    redescribed(fmu_factory.exchanged(folder), folder / "Exchanged.fmu", STATES)
    fmu_factory.faulty(folder)
    fmu_factory.mass(folder, "2.0", states=False)
    return folder


def motion(importer: Importer, *names: str) -> tuple[list[list[float]], list[float]]:
    """Return h and v, or x and v, of components at 1.5 s, and the times of all events."""
    events: list[float] = []
    importer.on_event = lambda event: events.append(event.time)
    importer.begin()
    importer.advance(1.5)
    found = [values(importer, name, *(("h", "v") if name == "ball" else ("x", "v"))) for name in names]
    importer.free()
    return found, events


def others(folder: Path, which: str) -> list[ComponentSpec]:
    ours = part("body", fmu_path("Oscillator"), velocity_start=1.0)
    return {
        "alone": [],
        "ours": [ours],
        "events": [part("y", folder / "Faulty.fmi3.fmu")],
        "stateless": [part("m", folder / "StatelessMass.fmi2.fmu", v=1.0, k=4.0)],
    }[which]


@pytest.mark.parametrize("exchange", ["jacobi", "gauss_seidel", "iterated"])
@pytest.mark.parametrize("which", ["alone", "ours", "events", "stateless"])
def test_it_moves_as_one_that_can_go_back(folder: Path, which: str, exchange: Exchange) -> None:
    parts = others(folder, which)
    found = [
        motion(Importer([part("ball", folder / fmu), *parts], exchange=exchange, macro_step=0.01), "ball")
        for fmu in ("SteppedBall.fmi3.fmu", "Ball.fmu")
    ]
    assert len(found[0][1]) >= 2
    assert found[0] == found[1]  # it refuses a step from another time than its own


def test_a_ball_in_model_exchange_moves_so_too(folder: Path) -> None:
    found = [
        motion(Importer([part("m", folder / fmu, kind=1.0), *others(folder, "ours")], macro_step=0.1), "m")
        for fmu in ("Exchanged.fmi3.fmu", "Exchanged.fmu")
    ]
    (first, events), (second, others_events) = found
    assert second[0] == pytest.approx(first[0], abs=1e-6)
    assert others_events == pytest.approx(events, abs=1e-6)


def test_two_of_them_cannot_wait_for_each_other(folder: Path) -> None:
    # the second one bounces earlier, when the first has made its step
    balls = [part("first", folder / "Ball.fmu"), part("second", folder / "Ball.fmu", g=2.0 * GRAVITY)]
    importer = Importer(balls, macro_step=0.25)
    importer.begin()
    expected = r"first: expected a component that goes back to time .*\(canGetAndSetFMUState = false\)"
    with pytest.raises(ComponentError, match=expected):
        importer.advance(1.0)
    importer.free()


def test_its_events_reach_the_inputs_of_others_at_their_instant(folder: Path) -> None:
    # a free mass pushed by the velocity of the ball: it stops where the ball bounces
    mass = part("m", folder / "StatelessMass.fmi2.fmu", k=0.0)
    ends = []
    for fmu in ("SteppedBall.fmi3.fmu", "Ball.fmu"):
        importer = Importer([part("ball", folder / fmu), mass], [link("ball.v", "m.f")], macro_step=0.01)
        ends.append(motion(importer, "m"))
    assert ends[0] == ends[1]
