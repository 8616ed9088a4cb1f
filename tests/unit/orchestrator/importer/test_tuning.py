"""Connected tunable parameters. References: FMPy sets them by hand, or a body has the same force."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.component_fmu import OscillatorFmu
from support.coupled_parts import EXCHANGES, VERSIONS, body, link, part, stop
from support.tolerance import ROUNDING

import vibroimpact as vi
from vibroimpact.fmus.errors import ComponentError, SceneError, UsageError
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

#: A free oscillator; its displacement is the amplitude of the force on another oscillator, whose spring is weak.
GIVING = {"displacement_start": 1.0, "stiffness": 2.0}
TAKING = {"stiffness": 0.25, "forcing.angular_frequency": 1.3, "forcing.amplitude": 9.0}
GIVEN = [link("giving.displacement", "taking.forcing.amplitude", 0.5)]


@pytest.fixture
def made() -> Iterator[list[Importer]]:
    importers: list[Importer] = []
    yield importers
    for importer in importers:
        importer.free()


def begun(
    made: list[Importer],
    specs: Sequence[ComponentSpec],
    connections: Sequence[ConnectionSpec],
    **options: object,
) -> Importer:
    made.append(Importer(specs, connections, **options))  # type: ignore[arg-type]
    made[-1].begin()
    return made[-1]


def by_hand(step: float, steps: int) -> tuple[float, float]:
    """Return the state that FMPy reaches when it sets the amplitude at each communication point."""
    with OscillatorFmu(GIVING) as giving, OscillatorFmu({**TAKING, "forcing.amplitude": 0.5}) as taking:
        for _ in range(steps):
            for oscillator in (giving, taking):
                oscillator.step(step)
            taking.set("forcing.amplitude", 0.5 * giving.get("displacement"))
        return taking.state()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("exchange", EXCHANGES)
def test_a_parameter_is_given_at_each_communication_point(
    made: list[Importer], exchange: str, version: str
) -> None:
    specs = [body("giving", GIVING), body("taking", TAKING, version)]
    importer = begun(made, specs, GIVEN, macro_step=0.125, exchange=exchange)
    importer.advance(5.0)
    taking = importer.components["taking"]
    found = taking.group("Float64", ["displacement", "velocity", "forcing.amplitude"]).get()
    assert found[:2] == pytest.approx(by_hand(0.125, 40), rel=1e-12, abs=1e-13)
    assert found[2] == pytest.approx(0.5 * math.cos(math.sqrt(2.0) * 5.0), rel=ROUNDING, abs=1e-15)


def test_a_parameter_that_its_own_component_feeds_is_given_too(made: list[Importer]) -> None:
    specs = [body("own", {**TAKING, "displacement_start": 1.0})]
    importer = begun(made, specs, [link("own.displacement", "own.forcing.amplitude", -0.3)], macro_step=0.1)
    importer.advance(2.0)
    displacement, amplitude = (
        importer.components["own"].group("Float64", ["displacement", "forcing.amplitude"]).get()
    )
    assert amplitude == pytest.approx(-0.3 * displacement, rel=ROUNDING)


def test_what_feeds_a_parameter_answers_the_event_that_has_just_been(
    made: list[Importer], tmp_path: Path
) -> None:
    # from the impact on its speed is the amplitude, through a component in between
    struck = {"displacement_start": -1.0, "contact[1].law": "external", "forcing.angular_frequency": 1.0}
    specs = [
        body("ball", struck),
        stop("stop", 0.5),
        part("gain", fmu_factory.gain(tmp_path)),
    ]
    connections = [
        link("ball.contact[1].displacement", "stop.displacement"),
        link("ball.contact[1].velocity", "stop.velocity"),
        link("stop.applied_restitution", "ball.contact[1].applied_restitution"),
        link("ball.contact[1].last_velocity", "gain.u"),
        link("gain.y", "ball.forcing.amplitude"),
    ]
    importer = begun(made, specs, connections, macro_step=0.7)
    importer.advance(math.pi / 2.0 + 1e-9)
    ball = (
        importer.components["ball"].group("Float64", ["contact[1].last_velocity", "forcing.amplitude"]).get()
    )
    assert ball[0] == pytest.approx(1.0, rel=1e-12)
    assert ball[1] == pytest.approx(ball[0] * importer.components["gain"].group("Float64", ["k"]).get()[0])


def test_a_value_that_no_body_can_take_is_told_by_the_body(made: list[Importer]) -> None:
    specs = [body("giving", GIVING), body("taking", TAKING)]
    connections = [link("giving.displacement", "taking.forcing.angular_frequency", 1.0)]
    importer = begun(made, specs, connections, macro_step=0.1)
    with pytest.raises(
        ComponentError, match=r"taking: fmi3DoStep .*forcing.angular_frequency: expected another > 0"
    ):
        importer.advance(5.0)


SCENE = """
[scene]
units = "SI"
[component.giving]
fmu = "Oscillator"
parameters = { displacement_start = 1.0, stiffness = 2.0 }
[component.taking]
fmu = "Oscillator"
parameters = { stiffness = 0.25, "forcing.angular_frequency" = 1.3 }
[[connection]]
from = "giving.displacement"
to = "taking.forcing.amplitude"
gain = 0.5
gain_unit = "N/m"
[record]
recorded_time = 5.0
variables = ["taking.displacement"]
rate = 8
[execution]
how = "coupled"
macro_step = 0.125
"""


def test_a_scene_may_connect_what_is_tunable_once(tmp_path: Path) -> None:
    found = vi.run(vi.Scene.from_text(SCENE))
    assert found["taking_displacement"].values[-1] == pytest.approx(by_hand(0.125, 40)[0], rel=1e-12)
    second = '[[connection]]\nfrom = "giving.contact[1].force"\nto = "taking.forcing.amplitude"\n'
    twice = SCENE.replace("[record]", second + "[record]")
    with pytest.raises(SceneError, match="an input of its own for each connection"):
        vi.Scene.from_text(twice)
    with pytest.raises(UsageError, match="got the tunable parameter forcing"):
        vi.export_ssp(vi.Scene.from_text(SCENE), tmp_path / "system.ssp")
    assert not list(tmp_path.iterdir())


def test_no_number_of_tuned_steps_leaves_memory_of_the_values_before(made: list[Importer]) -> None:
    importer = begun(made, [body("giving", GIVING), body("taking", TAKING)], GIVEN, macro_step=0.05)
    importer.advance(10.0)
    first = importer.components["taking"].group("Float64", ["displacement"]).get().copy()
    importer.begin()
    importer.advance(10.0)
    again = importer.components["taking"].group("Float64", ["displacement"]).get()
    assert np.array_equal(first, again), "a second run begins as the first"
