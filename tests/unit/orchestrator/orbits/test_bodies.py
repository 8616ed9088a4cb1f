"""Orbits of scenes against long runs of their FMUs."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.orbits import OrbitError, closed_form
from vibroimpact.analysis.orbits.search import orbits_of
from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.orchestrator.orbits import impacting_body
from vibroimpact.orchestrator.orbits.bodies import BodiesAlong
from vibroimpact.orchestrator.scene import load_scene, parse_scene

RECORD = "[record]\ntransient_periods = 400\nrecorded_periods = 2\nimpacts = true\n"
UNFORCED = "[record]\nrecorded_time = 2\n"
STOP = "[[stop]]\nposition = 0.1\nrestitution = 0.7\n"
CHAIN = (
    '[scene]\nunits = "nondimensional"\n[body]\nkind = "chain"\nmasses = [1, 1]\nstiffnesses = [1, 1]\n'
    "dampings = [0.1, 0.1]\n[forcing]\namplitude = [0.5, 0]\nangular_frequency = 0.9\n" + STOP
)
ONE = (
    '[scene]\nunits = "nondimensional"\n[body]\nmass = 1\nstiffness = 1\ndamping_ratio = 0.05\n'
    "[forcing]\namplitude = 0.5\nangular_frequency = 1.0\nphase = 0.4\n"
    "[[stop]]\nposition = 1.0\nrestitution = 0.7\n"
)
BEAM = (
    '[body]\nkind = "beam"\nlength = 0.3\nflexural_rigidity = 0.05002\nmass_per_length = 0.1054\nmodes = 8\n'
    "damping_ratio = 0.1\n[forcing]\namplitude = 0.4\nfrequency = 3.86\nlocation = 1.0\n"
    '[[stop]]\nposition = -0.2672\nside = "lower"\nrestitution = 0.7\nlocation = 1.0\n'
)


COUPLED = CHAIN.replace("dampings = [0.1, 0.1]", "dampings = [0.0, 0.3]\nfar_damping = 0.05")


@pytest.mark.parametrize(
    "text", [ONE, CHAIN, BEAM, COUPLED], ids=["oscillator", "chain", "beam", "coupled damping"]
)
def test_a_stable_orbit_is_what_a_long_run_of_the_fmu_ends_on(text: str) -> None:
    orbit = next(
        each
        for each in closed_form(impacting_body(parse_scene(text + RECORD, "scene.toml")))
        if each.is_stable
    )
    assert orbit.is_physical
    run = vi.run(parse_scene(text + RECORD, "scene.toml"))
    np.testing.assert_allclose(run["impact_velocity"], orbit.velocities[0], rtol=1e-10)
    np.testing.assert_allclose(run["impact_phase"], orbit.phases[0], atol=1e-10)


TWO_STOPS = (
    '[scene]\nunits = "nondimensional"\n[body]\nmass = 1\nstiffness = 1\ndamping_ratio = 0.05\n'
    "[forcing]\namplitude = 1.2\nangular_frequency = 2.0\n"
    "[[stop]]\nposition = 0.3\nrestitution = 0.7\n"
    '[[stop]]\nposition = -0.35\nside = "lower"\nrestitution = 0.6\n'
)
TWICE = (
    '[scene]\nunits = "nondimensional"\n[body]\nmass = 1\nstiffness = 1\ndamping_ratio = 0.04\n'
    "[forcing]\namplitude = 0.44\nangular_frequency = 0.88\n"
    "[[stop]]\nposition = 0.8\nrestitution = 0.75\n"
)


@pytest.mark.parametrize(("text", "periods"), [(TWO_STOPS, 1), (TWICE, 2)], ids=["two stops", "P(2,2)"])
def test_a_stable_orbit_of_two_impacts_is_what_a_long_run_of_the_fmu_ends_on(text: str, periods: int) -> None:
    scene = parse_scene(text + RECORD.replace("= 400", "= 1000"), "scene.toml")
    (orbit,) = (each for each in orbits_of(impacting_body(scene), 2, periods, starts=64) if each.is_stable)
    run = vi.run(scene)
    count = 2 * 2 // periods  # two impacts in each orbit, two periods recorded
    assert run["impact_velocity"].size == count
    order = np.argsort(run["impact_velocity"].values[:2])
    known = np.argsort(orbit.velocities)
    np.testing.assert_allclose(run["impact_velocity"].values[:2][order], orbit.velocities[known], rtol=1e-10)
    np.testing.assert_allclose(
        run["impact_phase"].values[:2][order], np.mod(orbit.phases, 2.0 * np.pi)[known], atol=1e-10
    )
    assert (run["impact_contact"].values[:2][order] == orbit.contacts[known] + 1).all()


def test_the_velocity_of_the_thesis_chain_is_the_known_one() -> None:
    (orbit,) = closed_form(impacting_body(parse_scene(CHAIN + RECORD, "scene.toml")))
    assert orbit.velocities[0] == pytest.approx(0.787660852554797, abs=1e-14)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            ONE.replace("angular_frequency = 1.0", "angular_frequency = 0"),
            "forcing: expected a harmonic force",
        ),
        (ONE.split("[[stop]]")[0], "stop: expected a restitution stop, got none"),
        (
            ONE.replace("restitution = 0.7", 'law = "hertz"\nstiffness = 1e4'),
            r'stop\[1\].law: expected "restitution"',
        ),
    ],
)
def test_a_scene_whose_orbits_are_not_followed_is_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        impacting_body(parse_scene(text + (UNFORCED if "frequency = 0\n" in text else RECORD), "scene.toml"))


def test_a_contact_has_the_yield_velocity_of_its_stop() -> None:
    falling = ONE.replace("restitution = 0.7", "restitution = 0.7\nyield_velocity = 0.3")
    for text, expected in ((falling, 0.3), (ONE, 0.0)):
        (contact,) = impacting_body(parse_scene(text + RECORD, "scene.toml")).contacts
        assert (contact.restitution, contact.yield_velocity) == (0.7, expected)


def test_a_chain_of_one_mass_has_the_orbits_of_the_oscillator() -> None:
    own = 'kind = "chain"\nmasses = [1]\nstiffnesses = [1]\ndampings = [0.1]'
    chain = ONE.replace("mass = 1\nstiffness = 1\ndamping_ratio = 0.05", own)
    (one,), (same,) = (
        closed_form(impacting_body(parse_scene(each + RECORD, "scene.toml"))) for each in (ONE, chain)
    )
    assert same.velocities[0] == pytest.approx(one.velocities[0], rel=1e-14)
    np.testing.assert_allclose(same.multipliers, one.multipliers, atol=1e-13)


def test_examples_of_the_thesis_have_bodies() -> None:
    for name in ("thesis/figure_6_13", "thesis/figure_7_10", "bifurcation"):
        assert closed_form(impacting_body(load_scene(ROOT / "examples" / f"{name}.toml"))) != ()


@pytest.mark.parametrize(
    "text", [ONE, CHAIN, BEAM, COUPLED, TWO_STOPS], ids=["one", "chain", "beam", "coupled", "two"]
)
@given(share=st.floats(0.2, 3.0), sign=st.sampled_from([1.0, -1.0]), draw=st.randoms(use_true_random=False))
@settings(max_examples=12, deadline=None)
def test_a_body_along_any_number_is_that_of_the_scene(
    text: str, share: float, sign: float, draw: random.Random
) -> None:
    scene = parse_scene(text + RECORD, "scene.toml")
    key, given_value = draw.choice([each for each in scene.numbers() if not each[0].startswith("execution")])
    first = {key: given_value or 0.5}
    bodies, value = BodiesAlong(scene, first), sign * share * first[key]
    try:
        expected = impacting_body(scene.with_values({key: value}), all_kinds=True)
    except SceneError:
        return
    except UsageError as problem:
        with pytest.raises(OrbitError, match=re.escape(str(problem))):
            bodies(value)
        return
    for name, one in vars(bodies(value)).items():
        np.testing.assert_equal(_plain(one), _plain(vars(expected)[name]), err_msg=f"{key} {value}: {name}")


def _plain(value: object) -> object:
    """Return contacts as their attributes."""
    return [vars(each) for each in value] if isinstance(value, tuple) else value
