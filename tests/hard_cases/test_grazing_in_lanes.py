"""No impact is lost at a graze in lanes: the ladders of one mode and of many, and ripples over a stop.

The lanes leave decisions within rounding to the scalar engine; they have to detect all other impacts themselves.
"""

import math

import numpy as np
import pytest
from support.lane_points import IMPACT, PERIOD, TURN, Columns, follow_alone, oscillators, run
from support.structure import peaking
from support.tolerance import SEQUENCE

LEVELS = [10.0**-n for n in (2, 3, 4, 5, 6, 7, 8, 9, 10)]


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("stiffness", "damping"), [(0.0, 0.0), (0.5, 0.0), (1e4, 20.0), (1e8, 2e3)])
def test_no_impact_is_lost_at_a_graze(sign: float, stiffness: float, damping: float) -> None:
    # the peak of a steady motion exceeds the stop by ever less, or stays below it, from eight phases
    zeta, w = 0.05, 0.8
    size, lag = math.hypot(1.0 - w * w, 2.0 * zeta * w), math.atan2(2.0 * zeta * w, 1.0 - w * w)
    excess, phase = (each.ravel() for each in np.meshgrid(LEVELS, TURN * np.arange(8) / 8 + 0.1))
    amplitude = 1.0 + sign * excess
    points = oscillators(
        len(excess),
        0,
        3,
        decay=zeta,
        angular_frequency=w,
        force=amplitude * size,
        phase=phase,
        start_q=np.minimum(1.0 - 1e-9, amplitude * np.cos(phase - lag)),
        start_p=-w * amplitude * np.sin(phase - lag),
        position=1.0,
        restitution=0.7,
        contact_stiffness=stiffness,
        contact_damping=damping,
    )
    points["begin"] = np.zeros(len(excess))
    found = run(points)
    impacts = np.array([np.count_nonzero(rows[:, 0] == IMPACT) for rows in found.rows])
    if sign > 0.0:
        assert np.all((impacts > 0) | ~found.has_run)  # the scalar engine decides within rounding
    else:
        assert np.all(impacts == 0)
    assert np.count_nonzero(found.has_run) >= 0.9 * len(excess)


def undamped(
    natural: np.ndarray, shape: np.ndarray, start: np.ndarray, position: list[float], end: float
) -> Columns:
    """Return bodies without losses or force, released between the far side of their modes and their own stop."""
    count, modes = len(position), len(natural)
    points = oscillators(
        count, 0, 1, angular_frequency=TURN / end, force=0.0, restitution=0.6, position=position
    )

    def column(values: np.ndarray | float) -> np.ndarray:
        return np.repeat(np.broadcast_to(values, modes)[:, None], count, axis=1)

    of_modes = {"stiffness": natural**2, "decay": 0.0, "force": 0.0, "held": 0.0, "observed": shape}
    points |= {name: column(values) for name, values in of_modes.items()}
    points |= {"start_q": column(start), "start_p": column(0.0)}
    points |= {name: column(shape)[None].copy() for name in ("shape", "impulse")}
    return points


@pytest.mark.parametrize("modes", [1, 2, 8])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_peak_of_many_modes_over_the_stop_is_an_impact_however_little_it_is(
    modes: int, sign: float
) -> None:
    natural, shape, start = peaking(modes)
    excess = np.array(LEVELS)
    found = run(undamped(natural, shape, start, (1.0 - sign * excess).tolist(), 1.5 * math.pi))
    impacts = [rows[rows[:, 0] == IMPACT] for rows in found.rows]
    assert found.has_run[excess >= 1e-9].all()
    assert [len(rows) > 0 for rows in impacts] == (found.has_run & (sign > 0.0)).tolist()
    if sign > 0.0:
        curve, bend = -shape * start @ natural**2, -shape * start @ natural**4
        for rows, over in zip(impacts[:5], LEVELS[:5], strict=True):
            allowed = bend / curve**2 * over + 4e-16 / over
            assert rows[0, 3] == pytest.approx(math.sqrt(2.0 * curve * over), rel=allowed)


@pytest.mark.parametrize("fast", [5.0, 21.0])
def test_the_first_of_three_crossings_close_to_each_other_is_the_impact(fast: float) -> None:
    # sin(t) - b sin(fast t) near t = 0, where its slope is -dip: three zeros within a cell
    for dip in np.geomspace(1e-5, 0.03, 24):
        start = np.array([-1.0, (1.0 + dip) / fast])
        points = undamped(np.array([1.0, fast]), np.array([1.0, 1.0]), start, [0.0], 2.0)
        found = run(points, impact_limit=1)
        with follow_alone(points, 0) as body:
            expected = body.impacts[0]
        if dip >= 1e-4 or found.has_run[0]:  # rounding decides the others; the lanes may leave them
            first = found.rows[0][0]
            assert first[1] < 0.5 * math.pi
            assert abs(first[1] - expected[1]) <= 2e-15 / dip
            assert first[3] == pytest.approx(expected[3], rel=1e-14 / dip**1.5)


@pytest.mark.parametrize("modes", [1, 2, 5, 8])
def test_the_largest_displacement_of_a_period_is_the_crest_to_rounding(modes: int) -> None:
    # the length of the period moves the cells of the lanes against the crest
    natural, shape, start = peaking(modes)
    for end in np.linspace(3.5, 9.0, 12):
        found = run(undamped(natural, shape, start, [2.0], float(end)))
        largest, smallest = found.rows[0][found.rows[0][:, 0] == PERIOD][0, 2:4]
        assert abs(largest - 1.0) <= 40.0 * np.finfo(float).eps
        if end >= 2.0 * math.pi:  # the start is the trough that mirrors the crest
            assert abs(smallest + 1.0) <= 40.0 * np.finfo(float).eps


@pytest.mark.parametrize(("ripple", "fast"), [(1e-2, 211.0), (1e-3, 211.0), (1e-1, 61.0), (1e-2, 61.0)])
def test_the_ripples_of_a_fast_mode_over_the_stop_are_those_that_the_scalar_engine_finds(
    ripple: float, fast: float
) -> None:
    # a slow heavy mode carries a light fast one to the stop: 100 samples per slow period show none of its ripples
    natural, shape, start = np.array([1.0, fast]), np.array([0.02, 1.0]), np.array([-50.0, ripple])
    over = np.linspace(0.1, 0.9, 8)
    points = undamped(natural, shape, start, (1.0 + over * ripple).tolist(), 4.0)
    found = run(points, extrema=False)
    seen = 0
    for place in np.flatnonzero(found.has_run):
        with follow_alone(points, int(place)) as body:
            expected = body.impacts
        impacts = found.rows[place][found.rows[place][:, 0] == IMPACT]
        assert len(impacts) == len(expected)
        difference = np.abs(impacts[:, [1, 3]] - expected[:, [1, 3]])
        assert difference.max(initial=0.0) <= 100.0 * SEQUENCE
        seen += len(impacts)
    assert seen > 0


@pytest.mark.parametrize("stiffness", [1.0, 1e4, 1e8])
def test_elastic_stops_that_yield_give_back_the_energy_of_hundreds_of_contacts(stiffness: float) -> None:
    points = oscillators(
        8, 0, 20, decay=0.0, force=0.0, angular_frequency=TURN / 100.0, position=0.5, restitution=0.0,
        contact_stiffness=stiffness, contact_damping=0.0, start_q=-np.linspace(0.7, 2.0, 8), start_p=0.0,
    )  # fmt: skip
    points["begin"] = np.zeros(8)
    found = run(points)
    assert found.has_run.all()
    for place, rows in enumerate(found.rows):
        impacts = rows[(rows[:, 0] == IMPACT) & ~np.isnan(rows[:, 4])]
        amplitude = -points["start_q"][0, place]
        assert len(impacts) > 300
        assert np.abs(impacts[:, 6] - 1.0).max() <= 1e-8  # the rounding of the stop's position over the depth
        assert np.abs(impacts[:, 3] / math.sqrt(amplitude**2 - 0.25) - 1.0).max() <= 1e-10


def test_the_speeds_of_short_returns_drift_by_the_rounding_of_a_position_alone() -> None:
    # a held force presses bodies to an elastic stop; returns found from the middle of a pair of cells drift by 1.2e-6
    count, bounces, speed = 64, 300, 1e-4
    position = np.linspace(0.3, 1.7, count)
    points = oscillators(
        count, 0, 1, decay=0.0, force=0.0, held=position + 1.0, angular_frequency=1.0, position=position,
        restitution=1.0, start_q=position - speed**2 / (math.hypot(1.0, speed) + 1.0), start_p=0.0,
    )  # fmt: skip
    points |= {"begin": np.zeros(count), "end": np.full(count, bounces * 2.0 * math.atan(speed))}
    found = run(points)
    assert found.has_run.all()
    speeds = [rows[rows[:, 0] == IMPACT, 3] for rows in found.rows]
    assert all(abs(len(each) - bounces) <= 1 for each in speeds)
    drifts = np.array([each[-1] / each[0] - 1.0 for each in speeds])
    assert math.sqrt(np.mean(drifts**2)) <= 9e-7
