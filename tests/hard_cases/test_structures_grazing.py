"""Bodies of many modes that only just reach a stop, or ripple over it: no contact is lost, none is invented.

The references are closed forms. Undamped modes of odd frequencies 1, 3, 5, .. released from rest all reach their far
side at the time pi. A sum of cosines between impacts can be searched on any grid, however fine.
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar
from support.structure import DONE, Modes, Stop, Structure, peaking
from support.tolerance import SEQUENCE

MODES = [1, 2, 8]
EXCESS = [10.0**-n for n in (2, 4, 6, 8, 10, 12)]


@pytest.mark.parametrize("modes", MODES)
@pytest.mark.parametrize("excess", EXCESS)
def test_a_peak_over_the_stop_by_ever_less_is_an_impact_with_the_root_of_its_excess(
    modes: int, excess: float
) -> None:
    natural, shape, start = peaking(modes)
    with Structure(Modes(natural), [Stop(shape, 1.0 - excess, restitution=0.6)], start) as body:
        assert body.advance(1.5 * math.pi, most_impacts=2) == DONE
        first = body.impacts[0]
    # x = 1 - A u^2 / 2 + B u^4 / 24 at the peak: V^2 = 2 A excess (1 - B excess / (3 A^2) ..)
    weights = -shape * start
    a, b = weights @ natural**2, weights @ natural**4
    noise = 4e-16 / excess  # the position of the stop is a double
    allowed = b / a**2 * excess + noise
    assert first[3] == pytest.approx(math.sqrt(2.0 * a * excess), rel=allowed)
    assert (
        abs(first[1] - math.pi + math.sqrt(2.0 * excess / a)) <= allowed * math.sqrt(2.0 * excess / a) + 1e-15
    )


@pytest.mark.parametrize("modes", MODES)
@pytest.mark.parametrize("excess", EXCESS)
def test_a_peak_short_of_the_stop_by_ever_less_is_none(modes: int, excess: float) -> None:
    natural, shape, start = peaking(modes)
    with Structure(Modes(natural), [Stop(shape, 1.0 + excess)], start) as body:
        assert body.advance(100.0 * math.pi) == DONE
        assert len(body.impacts) == 0
        assert body.energy == pytest.approx(0.5 * natural**2 @ start**2, rel=SEQUENCE)


def undamped_impacts(
    natural: np.ndarray, shape: np.ndarray, position: float, r: float, q: np.ndarray, end: float
) -> list[tuple[float, float]]:
    """Return time and velocity of impacts of undamped modes, on a grid of 200 points per fastest period."""
    p, now, found = np.zeros_like(q), 0.0, list[tuple[float, float]]()
    step = 2.0 * math.pi / natural.max() / 200.0
    grid = np.arange(0.02 * step, end, step)
    while True:

        def gap(u: float | np.ndarray, q: np.ndarray = q, p: np.ndarray = p) -> float | np.ndarray:
            turn = np.multiply.outer(u, natural)
            return np.cos(turn) @ (shape * q) + np.sin(turn) @ (shape * p / natural) - position

        x = gap(grid)
        over = np.flatnonzero(x > 0.0)
        tops = 1 + np.flatnonzero(
            (x[1:-1] > x[:-2]) & (x[1:-1] >= x[2:]) & (x[1:-1] <= 0.0) & (x[1:-1] > -1e-5)
        )
        upper = grid[over[0]] if len(over) else math.inf
        for i in tops[grid[tops] < upper]:
            top = minimize_scalar(lambda u: -gap(u), bounds=(grid[i - 1], grid[i + 1]), method="bounded")
            if top.fun < 0.0:
                upper = top.x
                break
        if now + upper > end:
            return found
        lower = max(grid[0], upper - step)
        u = brentq(gap, lower, upper, xtol=1e-15, rtol=1e-15)
        turn = natural * u
        q, p = np.cos(turn) * q + np.sin(turn) * p / natural, np.cos(turn) * p - natural * np.sin(turn) * q
        now, speed = now + u, float(shape @ p)
        p = p - (1.0 + r) * speed * shape / (shape @ shape)
        found.append((now, speed))


@pytest.mark.parametrize(("ripple", "fast"), [(1e-2, 211.0), (1e-3, 211.0), (1e-4, 2111.0), (1e-5, 2111.0)])
def test_the_ripples_of_a_fast_mode_over_the_stop_are_found_one_by_one(ripple: float, fast: float) -> None:
    # a slow heavy mode carries a light fast one to the stop: 100 samples per slow period show none of its ripples
    natural, shape = np.array([1.0, fast]), np.array([0.02, 1.0])
    q, position = np.array([-50.0, ripple]), 1.0 + 0.2 * ripple
    expected = undamped_impacts(natural, shape, position, 0.5, q, 4.0)
    with Structure(Modes(natural), [Stop(shape, position, restitution=0.5)], q) as body:
        assert body.advance(4.0) == DONE
        found = body.impacts[:, [1, 3]]
    assert len(found) == len(expected) > 1
    assert np.diff(found[:, 0]).max() < 2.0 * math.pi / 100.0
    # an error of rounding grows by the ratio of velocities at each impact: these are low here
    assert np.abs(found - np.array(expected)).max() <= 1e-11
