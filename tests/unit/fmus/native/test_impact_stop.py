"""An ImpactStop answers by its law; the expected values are computed here from equations.md 6.9 and 6.10."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest
from support.coupled_parts import VERSIONS
from support.tolerance import ROUNDING

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.component import Component, Value
from vibroimpact.orchestrator.importer.specification import ComponentSpec

ANSWERS = ("applied_restitution", "applied_force", "applied_stiffness", "applied_damping")
Answers = Callable[..., dict[str, float]]


@pytest.fixture(params=VERSIONS)
def make(request: pytest.FixtureRequest) -> Iterator[Callable[[dict[str, Value]], Answers]]:
    """Return a function that makes a stop and returns a function to ask it."""
    stops: list[Component] = []

    def build(parameters: dict[str, Value]) -> Answers:
        stop = Component(ComponentSpec("stop", fmu_path("ImpactStop", request.param), parameters))
        stops.append(stop)
        stop.begin({}, 0.0, first=True)
        stop.instance.exit_initialization()
        motion, answers = stop.group("Float64", ["displacement", "velocity"]), stop.group("Float64", ANSWERS)
        steps = iter(range(1000))

        def ask(displacement: float, velocity: float) -> dict[str, float]:
            motion.values[:] = displacement, velocity
            motion.set()
            stop.instance.step(float(next(steps)), 1.0)
            return dict(zip(ANSWERS, map(float, answers.get()), strict=True))

        return ask

    yield build
    for stop in stops:
        stop.free()


def test_restitution_is_constant_without_a_yield_velocity(make: Callable[..., Answers]) -> None:
    ask = make({"restitution": 0.7})
    assert [ask(1.0, v)["applied_restitution"] for v in (0.0, 1e-9, -3.0, 1e3)] == [0.7] * 4
    assert ask(1.0, 2.0)["applied_force"] == 0.0


def test_restitution_falls_with_the_fourth_root_of_speed_above_yield(make: Callable[..., Answers]) -> None:
    ask = make({"restitution": 0.8, "yield_velocity": 0.1})
    assert ask(0.0, 0.05)["applied_restitution"] == ask(0.0, 0.1)["applied_restitution"] == 0.8
    # at sixteen times the yield velocity: half
    assert ask(0.0, -1.6)["applied_restitution"] == pytest.approx(0.4, rel=ROUNDING)


def test_a_spring_and_a_dashpot_answer_force_and_both_slopes(make: Callable[..., Answers]) -> None:
    ask = make({"law": "kelvin_voigt", "stiffness": 100.0, "damping": 3.0, "position": 1.0})
    answer = ask(1.25, 2.0)
    assert answer["applied_force"] == pytest.approx(100.0 * 0.25 + 3.0 * 2.0, rel=ROUNDING)
    assert (answer["applied_stiffness"], answer["applied_damping"]) == (100.0, 3.0)
    assert answer["applied_restitution"] == 1.0


@pytest.mark.parametrize(("side", "sign"), [("upper", 1.0), ("lower", -1.0)])
@pytest.mark.parametrize("law", ["kelvin_voigt", "hertz", "hunt_crossley"])
def test_slopes_are_the_differences_of_the_force(
    make: Callable[..., Answers], law: str, side: str, sign: float
) -> None:
    ask = make(
        {
            "law": law,
            "stiffness": 50.0,
            "damping": 0.4,
            "exponent": 1.7,
            "position": 0.3,
            "side": side,
        }
    )

    def force(depth: float, rate: float) -> float:
        return ask(0.3 + sign * depth, sign * rate)["applied_force"]

    answer, h = ask(0.3 + sign * 0.2, sign * 0.7), 1e-5
    # central differences of a smooth force: error h^2 times its third derivative, and rounding / h
    assert answer["applied_stiffness"] == pytest.approx(
        (force(0.2 + h, 0.7) - force(0.2 - h, 0.7)) / (2 * h), rel=1e-8
    )
    assert answer["applied_damping"] == pytest.approx(
        (force(0.2, 0.7 + h) - force(0.2, 0.7 - h)) / (2 * h), rel=1e-8, abs=1e-9
    )


def test_hertz_and_hunt_crossley_are_what_the_sheet_says(make: Callable[..., Answers]) -> None:
    hertz = make({"law": "hertz", "stiffness": 8.0, "position": -1.0})
    assert hertz(-0.75, 5.0)["applied_force"] == pytest.approx(8.0 * 0.125, rel=ROUNDING)
    other = make({"law": "hunt_crossley", "stiffness": 8.0, "damping": 0.5, "exponent": 2.0})
    assert other(0.25, 1.0)["applied_force"] == pytest.approx(8.0 * 0.0625 * 1.5, rel=ROUNDING)


@pytest.mark.parametrize("law", ["kelvin_voigt", "hunt_crossley"])
def test_a_stop_never_pulls(make: Callable[..., Answers], law: str) -> None:
    ask = make({"law": law, "stiffness": 10.0, "damping": 2.0})
    # inside the stop, but leaving so fast that the dashpot would pull
    assert ask(0.01, -50.0) == {**dict.fromkeys(ANSWERS, 0.0), "applied_restitution": 1.0}
    assert ask(-0.01, 50.0)["applied_force"] == 0.0


@pytest.mark.parametrize("position", [0.0, 1.0, -3e5])
def test_at_its_surface_a_stop_answers_what_it_will_be_a_moment_later(
    make: Callable[..., Answers], position: float
) -> None:
    ask = make({"law": "kelvin_voigt", "stiffness": 1e3, "damping": 2.0, "position": position})
    # on the stop, and where rounding puts the body a little before it
    for displacement in (position, position - math.ulp(1.0) * abs(position)):
        answer = ask(displacement, 0.5)
        assert answer["applied_force"] == pytest.approx(1.0, rel=1e-6)
        assert (answer["applied_stiffness"], answer["applied_damping"]) == (1e3, 2.0)
    assert ask(position, -0.5)["applied_force"] == 0.0
    at_rest = ask(position, 0.0)
    assert at_rest["applied_force"] == pytest.approx(0.0, abs=1e-300)
    assert at_rest["applied_stiffness"] == 1e3


def test_all_problems_of_the_parameters_are_named_at_once(make: Callable[..., Answers]) -> None:
    with pytest.raises(ComponentError) as error:
        make({"law": "hunt_crossley", "damping": -1.0, "exponent": 0.5, "position": math.inf, "side": 3})
    for words in (
        "stiffness: expected a finite number > 0, got 0",
        "damping: expected a finite number >= 0, got -1",
        "exponent: expected a finite number >= 1, got 0.5",
        "side: expected 1 (upper) or 2 (lower), got 3",
        "position: expected a finite number, got inf",
    ):
        assert words in str(error.value)


def test_a_law_that_does_not_exist_is_refused_with_those_that_do(make: Callable[..., Answers]) -> None:
    with pytest.raises(ComponentError, match=r"law: expected 1 \(restitution\), 2 \(kelvin_voigt\).*got 5"):
        make({"law": 5})


def test_numbers_of_other_laws_are_not_looked_at(make: Callable[..., Answers]) -> None:
    assert make({"restitution": 0.5, "stiffness": -1.0})(0.0, 1.0)["applied_restitution"] == 0.5
    assert make({"law": "hertz", "stiffness": 1.0, "restitution": 7.0})(1.0, 0.0)["applied_force"] == 1.0
