"""A crossing is located to rounding by guesses and bisection, whatever the values beyond it are."""

import math
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vibroimpact.orchestrator.importer.revision import MOST_EVALUATIONS, Bracket, refine

PRECISION = 2e-13


class Counted:
    """A function that counts its calls; beyond its root its values may be meaningless."""

    def __init__(
        self, function: Callable[[float], float], root: float, beyond: Callable[[float], float]
    ) -> None:
        self._function, self._root, self._beyond = function, root, beyond
        self.calls = 0

    def __call__(self, u: float) -> float:
        self.calls += 1
        return self._function(u) if u < self._root else self._beyond(u)


FUNCTIONS: dict[str, Callable[[float], float]] = {
    "line": lambda u: 1.0 - u,
    "fall": lambda u: 1.0 - u * u,
    "late and steep": lambda u: 1.0 - u**40,
    "flat root": lambda u: (1.0 - u) ** 3,
    "very flat root": lambda u: (1.0 - u) ** 9,
    "root of infinite slope": lambda u: math.sqrt(max(0.0, 1.0 - u)),
    "exponential": lambda u: math.exp(-u) - math.exp(-1.0),
    "huge": lambda u: 1e200 * (1.0 - u),
    "tiny": lambda u: 1e-200 * (1.0 - u),
    "jump": lambda u: 1.0,
    "wave": lambda u: math.cos(0.5 * math.pi * u) * (1.5 + math.sin(20.0 * u)),
    "first up": lambda u: 4.0 * u * (1.0 - u) + 1e-3 * (1.0 - u),
}
BEYOND: dict[str, Callable[[float], float]] = {
    "reset to 0": lambda u: 0.0,
    "goes on": lambda u: -(u - 1.0),
    "huge": lambda u: -1e300,
    "tiny": lambda u: -5e-324,
    "not a number": lambda u: math.nan,
}


@pytest.mark.parametrize("beyond", BEYOND)
@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("end", [1.0 + 1e-9, 1.5, 2.0, 1e3])
def test_a_root_is_located_whatever_lies_beyond_it(name: str, beyond: str, end: float) -> None:
    value = Counted(FUNCTIONS[name], 1.0, BEYOND[beyond])
    found = refine(Bracket(0.0, FUNCTIONS[name](0.0), end), value, PRECISION)
    # the far end: at or just past the root, never before it by more than the rounding of its values
    slack = 1e-15 if name != "very flat root" else 1e-11  # (1 - u)^9 is flat near its root
    assert 1.0 - slack <= found <= 1.0 + PRECISION + 1e-15
    assert value.calls <= MOST_EVALUATIONS


def test_a_falling_ball_takes_few_evaluations() -> None:
    value = Counted(lambda u: 1.0 - 4.905 * u * u, math.sqrt(1.0 / 4.905), lambda u: 0.0)
    refine(Bracket(0.0, 1.0, 10.0), value, PRECISION)
    assert value.calls <= 20


def test_bisection_bounds_the_evaluations() -> None:
    value = Counted(lambda u: 1.0, 0.123456789, lambda u: -1.0)
    refine(Bracket(0.0, 1.0, 1e6), value, PRECISION)
    assert value.calls <= 4 * math.log2(1e6 / PRECISION) / 3 + 60


@given(
    root=st.floats(1e-6, 1e3),
    share=st.floats(1e-9, 1.0),
    slope=st.floats(1e-6, 1e6),
    bend=st.floats(0.0, 1e6),
    power=st.sampled_from([1.0, 2.0, 3.0, 0.5]),
)
@settings(max_examples=300)
def test_any_falling_function_is_followed_to_its_root(
    root: float, share: float, slope: float, bend: float, power: float
) -> None:
    def value(u: float) -> float:
        distance = root - u
        return (slope * distance + bend * distance * distance) ** power if u < root else 0.0

    precision = PRECISION * (1.0 + root)
    found = refine(Bracket(0.0, value(0.0), root / share), value, precision)
    assert root <= found <= root + precision * (1.0 + 1e-9)


@given(start=st.floats(1e-3, 1e3), speed=st.floats(-1e2, 1e2), gravity=st.floats(1e-2, 1e2))
@settings(max_examples=200)
def test_a_thrown_ball_lands_when_the_formula_says(start: float, speed: float, gravity: float) -> None:
    def height(u: float) -> float:
        h = start + u * (speed - 0.5 * gravity * u)
        return h if h > 0.0 else 0.0

    root = (speed + math.sqrt(speed * speed + 2.0 * gravity * start)) / gravity
    if speed < 0.0:
        root = 2.0 * start / (-speed + math.sqrt(speed * speed + 2.0 * gravity * start))
    found = refine(Bracket(0.0, start, 3.0 * root), height, PRECISION * (1.0 + root))
    # the height itself is rounded at the size of its terms
    noise = 4e-16 * (start + abs(speed) * root + gravity * root * root) / abs(speed - gravity * root)
    assert abs(found - root) <= PRECISION * (1.0 + root) + noise
