"""Bodies with next to no room between stops, and events that rounding alone would repeat for ever.

Soaks of random bodies have found most of these; `bodies` gives their scenes by number.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from soak import bodies
from support.structure import DONE, Modes, Stop, Structure
from support.tolerance import ROUNDING


def test_a_body_at_rest_on_a_stop_that_is_pulled_off_does_not_meet_it_again() -> None:
    # its clearance and its speed are 0 up to the rounding of four modes
    natural, force = np.array([1.0, 6.27, 17.5, 34.4]), [0.8, 4.2, -5.6, 2.1]
    q, shape = np.array([0.09, 0.01, 0.24, -0.02]), np.array([1.21, 0.57, -1.3, 0.91])
    for ulps in range(-2, 3):
        position = float(shape @ q) - ulps * 2.0**-55
        stop = Stop(shape, position, side="lower", restitution=0.5)
        with (
            Structure(Modes(natural, 0.02, force, 0.3), [stop], q) as body,
            Structure(Modes(natural, 0.02, force, 0.3), [], q) as free,
        ):
            assert body.advance(0.05) == free.advance(0.05) == DONE
            assert len(body.impacts) == 0
            assert body.displacement == pytest.approx(free.displacement, rel=1e-13)


@pytest.mark.parametrize("speed", [0.0, 1e-18, 1e-17, 1e-14])
@pytest.mark.parametrize("position", [0.0, 0.035])
def test_a_hertz_stop_begins_to_press_at_any_speed_however_small(position: float, speed: float) -> None:
    # once a speed of rounding size gave it the force of a constant rate for a radian: .3 % error
    stop = Stop([1.0], position, law="hertz", stiffness=1e3)
    start = [position, speed]

    def rate(_time: float, x: np.ndarray) -> list[float]:
        return [x[1], 2.0 - x[0] - 0.6 * x[1] - 1e3 * max(0.0, x[0] - position) ** 1.5]

    expected = solve_ivp(rate, [0.0, 0.3], start, method="DOP853", rtol=1e-13, atol=1e-17).y[:, -1]
    with Structure(Modes(1.0, 0.3, 2.0), [stop], *start) as body:
        assert body.advance(0.3) == DONE
        assert [body.displacement[0], body.velocity[0]] == pytest.approx(expected, rel=1e-9)


def test_a_body_that_rocks_between_two_dead_stops_comes_to_rest_on_both() -> None:
    # each impact throws it against the other stop, with a share of its speed: infinitely many impacts in a finite time
    shapes, force = np.array([[1.08, 0.88], [0.31, 1.13]]), np.array([5.7, 7.2])
    stops = [Stop(shape, 0.0, restitution=0.0) for shape in shapes]
    with Structure(Modes([1.0, 6.3], 0.3, force), stops, 0.0, [-0.4, -0.7]) as body:
        assert body.advance(10.0) == DONE
        assert body.statuses == ("held", "held")
        assert np.abs(body.displacement).max() <= ROUNDING
        assert body.forces == pytest.approx(np.linalg.solve(shapes.T, force), rel=1e-12)


def test_what_loses_a_share_of_its_speed_between_two_stops_comes_to_rest_before_it_has_no_digits_left() -> (
    None
):
    # half of its speed at each impact, 3e4 times a second: 1e-308 m/s after a tenth of a second
    stops = [
        Stop([1.0], 0.0, law="kelvin_voigt", stiffness=1e10),
        Stop([1.0], 0.0, side="lower", restitution=0.5),
    ]
    with Structure(Modes(7.0), stops, 0.0, -1.3) as body:
        for _ in range(10):
            assert body.advance(0.1) == DONE
        assert body.displacement[0] == body.velocity[0] == 0.0


def test_an_impact_elsewhere_at_the_instant_of_release_keeps_a_body_on_its_stop() -> None:
    # the force of stop 1 falls through 0 when mass 2 rebounds, which pulls mass 1 back to its stop
    scene = bodies.case(1998013221)
    with scene.body() as body:
        for step in range(200):
            body.advance(scene.duration * (step + 1) / 200 - body.time)
            for stop in scene.stops:
                if stop.law == "restitution":
                    sign = 1.0 if stop.side == "upper" else -1.0
                    beyond = sign * (np.asarray(stop.shape) @ body.displacement - stop.position)
                    assert beyond <= 1e-12


@pytest.mark.parametrize(
    ("seed", "what"),
    [
        (1998005030, "a load that lifts it off with the fourth power of time, coupled"),
        (1998003621, "a load that presses it with the fifth power of time"),
        (1998006076, "a load that lifts it off with the fourth power of time, in free flight"),
        (1998008992, "held and pressed by a stop elsewhere, whose force does not reach it"),
        (1998008252, "at rest on a stop, pulled off, with a speed that is rounding"),
        (1998012273, "opposite a Hertz stop, held, with displacements of 1e-43 m"),
        (1998012340, "held beside a Hertz stop pressed in by 1e-32 m"),
        (1998007759, "a Kelvin-Voigt stop pressed in by 1e-25 m, on its way out at 1e-35 m/s"),
        (1998005222, "elastic impacts at 1e-24 m/s between five stops at 0"),
        (1998006555, "clamped between two stops at the instant at which a third one lets go"),
        (1998008486, "rocking on two stops while a third one yields"),
        (1998008454, "thousands of touches of rounding size: 3 s"),
        (1998012530, "thousands of touches of rounding size: 4 s"),
        (77003633, "elastic and dying impacts in a corner of two stops"),
        (77006017, "clamped between two stops beside a third one of nearly the same shape"),
        (77006936, "pressed by the third power of time as a power law begins to press elsewhere"),
        (77006884, "held on a rigid stop with a Hunt-Crossley stop pressed in by 1e-15 m: 20 s"),
        (88001137, "let go with a speed of 1e-42 m/s towards a Hertz stop: 30 % off in speed"),
        (88007988, "clamped by stiff stops that turn the rounding of a rate into force"),
        (99005272, "both of two opposite stops seemed to hold it, with opposite forces"),
        (99007972, "a dashpot thrown back at the instant at which another stop holds"),
        (99004727, "3000 impacts 1e-15 m within a dashpot's stop: each took energy from nowhere"),
        (66000033, "pressed by a stop that another, nearly parallel, cannot replace"),
        (66000641, "held by what the damping of other modes leaves of their speed"),
        (31005594, "rounding pushes it into a Hertz stop at 1e-149 m/s: 20 s, then an error"),
        (32000100, "1000 events at one instant: rounding of a series not carried to later coefficients"),
        (32001340, "the same"),
        (51001264, "the same, between five stops"),
        (5000528, "let go by two stops at one instant: motions of 1e-19 m"),
        (71011009, "let go by two stops at one place, 3e-12 s apart: 1000 events"),
        (71013959, "the same, between springs"),
        (91001010, "clamped, its load handed from one stop to the other: 1000 events"),
        (91003393, "the same, with a third stop at the place"),
        (32008361, "held by two stops at one place as their force goes to 0: 1000 events"),
    ],
)
def test_a_random_body_that_once_failed_does_no_more(seed: int, what: str) -> None:
    assert bodies.check(seed) is None, what


@pytest.mark.parametrize("seed", range(12))
def test_a_stop_beside_one_of_nearly_the_same_shape_changes_the_motion_by_as_little(seed: int) -> None:
    # together they are as rigid as one; the more alike they are, the less accurate is the share of each
    chance = np.random.default_rng(seed)
    modes = Modes(
        [chance.uniform(0.5, 2.0), chance.uniform(3.0, 12.0)],
        chance.uniform(0.02, 0.3),
        chance.normal(0.0, 2.0, 2),
        chance.uniform(0.3, 3.0),
    )
    shape, aside = chance.normal(size=2), chance.normal(size=2)
    with Structure(modes, [Stop(shape, 0.05, restitution=0.3)]) as body:
        assert body.advance(12.0) == DONE
        alone = body.displacement
    for part in (1e-7, 1e-9, 1e-11, 1e-13):
        stops = [Stop(shape + share * aside, 0.05, restitution=0.3) for share in (0.0, part)]
        with Structure(modes, stops) as body:
            assert body.advance(12.0) == DONE
            assert body.displacement == pytest.approx(alone, rel=0.0, abs=100.0 * part + 1e-12)
