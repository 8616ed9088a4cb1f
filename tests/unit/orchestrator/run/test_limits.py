"""The table of limits of lanes, orbits and ways: each of its rows occurs in some scene."""

from __future__ import annotations

import pytest

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.orbits import impacting_body
from vibroimpact.orchestrator.run.limits import (
    LIMITS,
    may_go_by_lanes,
    seen,
    why_not_pushed,
    why_not_thrown_back,
)
from vibroimpact.orchestrator.scene import Scene, parse_scene

RECORD = "[record]\nrecorded_periods = 2\n"
FORCING = "[forcing]\namplitude = 1.0\nangular_frequency = 2.0\n"
MASS = "[body]\nmass = 1.0\nstiffness = 1.0\n" + FORCING
CHAIN = '[body]\nkind = "chain"\nmasses = [1, 1]\nstiffnesses = 1.0\n' + FORCING.replace("1.0", "[1, 0]", 1)
BEAM = '[body]\nkind = "beam"\nlength = 0.4\nflexural_rigidity = 2.0\nmass_per_length = 0.3\n' + FORCING
STOP = "[[stop]]\nposition = 0.5\nrestitution = 0.8\n"
YIELDING = '[[stop]]\nposition = 0.5\nlaw = "hertz"\nstiffness = 100.0\n'
EXCITER = "[exciter]\ngain = 2.0\ndistance = 1.0\n[daq]\nrate = 1000.0\nbits = 16\nrange = 10.0\n"
PLACES = "".join(STOP + f"location = {place}\n" for place in (0.5, 0.6, 0.7, 0.8, 0.9))

SEEN_IN = {
    "forcing": "[body]\nmass = 1.0\nstiffness = 1.0\n[record]\nrecorded_time = 2\n" + STOP,
    "stop": MASS + RECORD,
    "law": MASS + RECORD + YIELDING,
    "distance": MASS + RECORD + STOP + EXCITER,
    "reduced": CHAIN.replace("stiffnesses", "modes = 1\nstiffnesses") + RECORD + STOP,
    "projection": BEAM.replace("length", 'impact_projection = "collocation"\nlength', 1) + RECORD + STOP,
    "places": BEAM + RECORD + PLACES,
}
OF_THE_BODY = {
    "oscillator": MASS.replace("stiffness = 1.0", "stiffness = 0.0\ndamping = 0.1") + RECORD + STOP,
    "chain": CHAIN.replace("stiffnesses = 1.0", "stiffnesses = [0.0, 1.0]\nfar_damping = 0.1")
    + RECORD
    + STOP,
}


def scene(text: str) -> Scene:
    return parse_scene(text, "scene.toml")


@pytest.mark.parametrize("row", SEEN_IN)
def test_what_the_tables_of_a_scene_have_is_seen_and_kept_from_who_cannot_take_it(row: str) -> None:
    one = scene(SEEN_IN[row])
    assert row in [each.row for each in seen(one)]
    assert not (LIMITS[row].lanes and may_go_by_lanes(one))
    if LIMITS[row].orbits:
        with pytest.raises(UsageError, match="expected"):
            impacting_body(one)
    if LIMITS[row].thrown_back:
        assert why_not_thrown_back(one) == LIMITS[row].thrown_back


@pytest.mark.parametrize("kind", OF_THE_BODY)
def test_a_dashpot_on_a_body_that_nothing_ties_to_the_ground_is_kept_from_orbits(kind: str) -> None:
    with pytest.raises(UsageError) as error:
        impacting_body(scene(OF_THE_BODY[kind]))
    assert f"expected {LIMITS['dragged'].orbits}, got " in str(error.value)


def test_no_force_acts_at_stops_of_a_beam_that_are_apart() -> None:
    assert why_not_pushed(scene(SEEN_IN["places"])) == LIMITS["force"].pushed
    assert why_not_pushed(scene(MASS + RECORD + STOP)) == ""


def test_a_scene_of_few_modes_between_rigid_stops_is_for_all_of_them() -> None:
    for text in (MASS, CHAIN, BEAM):
        one = scene(text + RECORD + STOP)
        assert list(seen(one)) == []
        assert may_go_by_lanes(one)
        assert impacting_body(one).contacts[0].restitution == 0.8
