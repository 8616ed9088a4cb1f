"""Contacts of bodies in model exchange: impacts of a ball and of a pendulum in 40 digits, hostile cases, and refusals.

Each FMU refuses every call in a wrong mode (`tests/support/fmus/exchange*.c`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import VERSIONS, values
from support.exchanged_parts import (
    ALONG,
    GRAVITY,
    TIP,
    ContactRun,
    ball_impacts,
    contact,
    exchanged,
    largest_errors,
    pendulum_impacts,
    rigid_stop,
    run_of,
)
from support.pair_parts import hit

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import (
    BodyPoint,
    ComponentSpec,
    EventSpec,
    PairSpec,
)

VELOCITY = ("m", "v")
fmi_versions = pytest.mark.parametrize("fmi", VERSIONS)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("exchanged")


def ball(
    folder: Path, fmi: str = "3.0", restitution: float = 0.9, force: str | None = "u", **more: Any
) -> ContactRun:
    """Return a ball of 2 kg that falls from 1 m on the ground."""
    parts = [exchanged(folder, fmi, "falling", **{"at": 2.0, **more}), rigid_stop(restitution)]
    return run_of(parts, [contact(force)], VELOCITY)


# ---- 20 impacts in 40 digits ----


@pytest.mark.parametrize("force", [None, "u"])
@fmi_versions
def test_twenty_bounces_of_a_ball_are_those_of_the_closed_form(
    folder: Path, fmi: str, force: str | None
) -> None:
    exact = ball_impacts(20, 0.9)
    run = ball(folder, fmi, force=force).at(exact[-1][0] + 0.05)
    assert max(largest_errors(run.impacts, exact)) <= 1e-8
    assert all(
        after[0] == pytest.approx(-0.9 * before[0], rel=1e-12)
        for before, after in zip(run.before, run.after, strict=True)
    )
    impulse = run.importer.contacts.held[0].impacts.all[0].impulse
    assert (
        math.isnan(impulse) if force is None else impulse == pytest.approx(2.0 * 1.9 * exact[0][1], rel=1e-8)
    )
    run.importer.free()


@fmi_versions
def test_twenty_impacts_of_a_pendulum_are_exact_to_its_tolerance(folder: Path, fmi: str) -> None:
    exact = pendulum_impacts(20, 0.9, -1.0, 0.5)
    errors = []
    for tolerance in (1e-6, 1e-8, 1e-10):
        parts = [exchanged(folder, fmi, "pendulum", tolerance, x=-1.0), rigid_stop(0.9, 0.5, "upper")]
        run = run_of(parts, [contact(point=TIP)], ("m", "tip_rate")).at(exact[-1][0] + 0.05)
        errors.append(max(largest_errors(run.impacts, exact)))
        for before, after in zip(run.before, run.after, strict=True):
            assert after[0] == pytest.approx(-0.9 * before[0], rel=1e-12)
        # the tip of 1 kg moves as 1 / cos^2 of its angle
        struck = run.importer.contacts.held[0].impacts.all[0]
        assert struck.impulse == pytest.approx(1.9 * struck.closing / (1.0 - 0.5**2), rel=1e-9)
        run.importer.free()
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] <= 8e-9  # s and m/s, after 33 s


@given(
    restitution=st.floats(0.3, 1.0),
    height=st.floats(1e-3, 1e3),
    mass=st.sampled_from([1e-300, 1e-6, 3.0, 1e300]),
)
@settings(max_examples=15, deadline=None)
def test_any_ball_bounces_by_the_closed_form(
    folder: Path, restitution: float, height: float, mass: float
) -> None:
    exact = ball_impacts(3, restitution, height)
    run = ball(folder, "3.0", restitution, at=mass, x=height)
    run.at(exact[-1][0] + 0.1 * exact[0][0] * restitution**3)
    assert max(largest_errors(run.impacts, exact)) <= 1e-8 * max(1.0, exact[0][1])
    assert all(
        after[0] == pytest.approx(-restitution * before[0], rel=1e-12)
        for before, after in zip(run.before, run.after, strict=True)
    )
    run.importer.free()


# ---- pairs ----


@pytest.mark.parametrize(
    ("kind", "start", "mass"),
    [
        ("spring", {"x": 0.0, "v": 1.0}, 1.0),
        ("falling", {"x": 0.0, "v": 5.0, "at": 2.0}, 2.0),
        ("pendulum", {"x": -0.5}, None),
    ],
)
@fmi_versions
def test_a_body_of_ours_and_one_in_model_exchange_keep_their_momentum(
    folder: Path, fmi: str, kind: str, start: dict[str, float], mass: float | None
) -> None:
    point = TIP if kind == "pendulum" else ("x", "v")
    pair = PairSpec(BodyPoint("m", *point, "u", mass), ("o", "contact[1]"), 0.3, restitution=0.7)
    parts = [exchanged(folder, fmi, kind, **start), hit("o", version=fmi, mass=1.5, stiffness=0.0)]
    run = run_of(parts, [], ("m", point[1]), ("o", "velocity"), pairs=[pair]).at(1.0)
    effective = run.importer.contacts.pairs.specified[0].lower.mass
    assert len(run.times) >= 1
    for before, after in zip(run.before, run.after, strict=True):
        given_to = 1.5 * (after[1] - before[1])
        assert effective * (before[0] - after[0]) == pytest.approx(given_to, rel=1e-12)
        assert after[1] - after[0] == pytest.approx(0.7 * (before[0] - before[1]), rel=1e-12)
    assert effective == pytest.approx(mass or 1.0 / (1.0 - 0.3**2), rel=1e-9)
    run.importer.free()


@pytest.mark.parametrize(("law", "stiffness"), [("kelvin_voigt", 1e4), ("hertz", 1e6)])
@fmi_versions
def test_two_bodies_in_model_exchange_keep_the_energy_of_an_elastic_contact_to_the_tolerance(
    folder: Path, fmi: str, law: Any, stiffness: float
) -> None:
    points = [BodyPoint(name, *ALONG, "u", 1.0) for name in ("m", "o")]
    errors = []
    for tolerance in (1e-6, 1e-10):
        mass = exchanged(folder, fmi, "spring", tolerance, x=0.0, v=2.0)
        parts = [mass, replace(mass, name="o", parameters={**mass.parameters, "v": 0.0})]
        run = run_of(parts, [], pairs=[PairSpec(points[0], points[1], 0.1, law, stiffness=stiffness)]).at(0.3)
        states = [*run.motion(), *values(run.importer, "o", *ALONG)]
        errors.append(abs(0.25 * sum(value**2 for value in states) - 1.0))
        assert run.importer.contacts.pairs.specified[0].impacts.all[0].restitution == pytest.approx(
            1.0, rel=1e-4
        )
        run.importer.free()
    assert errors[0] <= 1e-5
    assert errors[1] <= 1e-9


# ---- memory that cannot be given back ----


@pytest.mark.parametrize("force", [None, "u"])
@fmi_versions
def test_a_body_whose_state_cannot_be_saved_bounces_alike(folder: Path, fmi: str, force: str | None) -> None:
    ends = []
    for states in (True, False):
        run = ball(folder, fmi, force=force, states=states).at(4.0)
        assert len(run.times) == 6
        ends.append(run.motion())
        run.importer.free()
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("force", "states", "lacks"), [(None, True, "a force input"), ("u", False, "canGetAndSetFMUState")]
)
@fmi_versions
def test_bounces_without_end_of_a_body_that_cannot_be_held_name_their_limit(
    folder: Path, fmi: str, force: str | None, states: bool, lacks: str
) -> None:
    run = ball(folder, fmi, 0.5, force, states=states)
    with pytest.raises(ComponentError, match=rf"rest near time 1\.35.*Zeno's limit.*without {lacks}"):
        run.at(2.0)
    run.importer.free()


@pytest.mark.parametrize("restitution", [0.0, 0.5])
@pytest.mark.parametrize("height", [0.0, 1.0])
@fmi_versions
def test_a_ball_comes_to_rest_on_its_stop(folder: Path, fmi: str, restitution: float, height: float) -> None:
    run = ball(folder, fmi, restitution, x=height).at(2.0)
    assert run.motion() == pytest.approx([0.0, 0.0], abs=1e-9)
    run.importer.free()


# ---- grazes, and several things at one instant ----


@pytest.mark.parametrize(("over", "count"), [(1e-7, 0), (-1e-7, 1), (-1e-9, 1)])
@fmi_versions
def test_a_graze_within_one_step_of_the_solver_is_found(
    folder: Path, fmi: str, over: float, count: int
) -> None:
    parts = [exchanged(folder, fmi, "spring"), rigid_stop(0.5, -1.0 - over)]
    run = run_of(parts, [contact()], macro_step=1.0).at(5.0)
    assert len(run.impacts) == count
    if count:
        assert run.impacts[0][1] == pytest.approx(math.sqrt(-2.0 * over), rel=0.2)
    run.importer.free()


@given(
    place=st.floats(3.0, 100.0),
    position=st.floats(0.1, 0.999),
    speed=st.floats(0.1, 100.0),
    step=st.floats(0.1, 1000.0),
    power=st.integers(2, 10),
)
@settings(max_examples=25, deadline=None)
def test_a_lift_that_turns_twice_within_one_step_of_the_solver_meets_its_stop(
    folder: Path, place: float, position: float, speed: float, step: float, power: int
) -> None:
    cam = exchanged(folder, "3.0", "cam", 10.0**-power, at=place, x=0.0, v=speed)
    parts = [cam, rigid_stop(0.9, position, "upper")]
    run = run_of(parts, [contact(point=TIP)], macro_step=step).at((2.0 * place + 50.0) / speed)
    met = (place + (1.0 - math.sqrt(1.0 - position**2)) / position) / speed
    assert run.impacts[0][0] == pytest.approx(met, rel=1e-6)
    run.importer.free()


@fmi_versions
def test_two_stops_within_one_step_of_the_solver_are_both_met(folder: Path, fmi: str) -> None:
    parts = [exchanged(folder, fmi, "spring", 1e-2, x=0.0, v=1000.0), rigid_stop(1.0, -1.0)]
    stops = [contact(), contact(stop="t")]
    run = run_of([*parts, rigid_stop(1.0, 1.0, "upper", "t")], stops, macro_step=1.0).at(0.0996)
    lower, upper = (bond.impacts.all for bond in run.importer.contacts.held)
    assert [len(lower), len(upper)] == [25, 25]
    assert [one.time for one in upper] == pytest.approx([0.001 + 0.004 * k for k in range(25)], rel=1e-3)
    run.importer.free()


@pytest.mark.parametrize("force", [None, "u"])
@fmi_versions
def test_a_body_that_touches_and_closes_at_the_start_has_its_impact_there(
    folder: Path, fmi: str, force: str | None
) -> None:
    run = ball(folder, fmi, 0.5, force, x=0.0, v=-1.0).at(0.05)
    assert run.impacts == [(0.0, 1.0)]
    assert run.motion("v") == pytest.approx([0.5 - 0.05 * GRAVITY], abs=1e-9)
    run.importer.free()


@fmi_versions
def test_an_event_of_the_fmu_at_the_instant_of_an_impact_comes_first(folder: Path, fmi: str) -> None:
    run = run_of([exchanged(folder, fmi, "ball"), rigid_stop(0.9)], [contact(None)]).at(0.6)
    assert run.motion("count") == [1.0]
    assert run.impacts == []  # the ball has bounced by itself
    run.importer.free()


@fmi_versions
def test_an_fmu_may_end_the_run_in_the_event_mode_after_its_impact(folder: Path, fmi: str) -> None:
    run = run_of([exchanged(folder, fmi, "last_fall", at=1.0), rigid_stop(0.9)], [contact()]).at(2.0)
    assert run.importer.wants_to_end
    assert run.importer.time == pytest.approx(math.sqrt(2.0 / GRAVITY), abs=1e-8)
    run.importer.free()


@pytest.mark.parametrize("kind", ["short_rates", "short_states", "nan_rates", "short_indicators"])
@fmi_versions
def test_an_fmu_that_discards_points_meets_its_stop(folder: Path, fmi: str, kind: str) -> None:
    parts = [exchanged(folder, fmi, kind, at=2e-3), rigid_stop(0.9, -0.5)]
    run = run_of(parts, [contact()]).at(2.2)
    assert run.impacts == [pytest.approx((math.acos(-0.5), math.sin(math.acos(-0.5))), abs=1e-8)]
    run.importer.free()


# ---- directional derivatives ----


@pytest.mark.parametrize("kind", ["falling", "short_rates"])
@fmi_versions
def test_a_directional_derivative_is_used_where_it_agrees(folder: Path, fmi: str, kind: str) -> None:
    flag = "providesDirectionalDerivative" + ("" if fmi == "2.0" else "s")
    plain = exchanged(folder, fmi, kind, at=2.0)
    fmu = fmu_factory.redescribed(
        plain.fmu,
        folder / f"directional{fmi[0]}.fmu",
        ('modelIdentifier="Exchanged"', f'modelIdentifier="Exchanged" {flag}="true"'),
    )
    parts = [ComponentSpec("m", fmu, plain.parameters, 1e-10), rigid_stop(0.9)]
    run = run_of(parts, [contact()], VELOCITY).at(2.0)
    pulse = run.importer.contacts.pairs.pairs[0].lower, run.importer.contacts.pairs.pairs[0].upper
    (mass,) = {end.mass for end in pulse if math.isfinite(end.mass)}
    assert mass == pytest.approx(2.0 if kind == "falling" else 1.0, rel=1e-12)
    assert run.after[0][0] == pytest.approx(-0.9 * run.before[0][0], rel=1e-12)
    run.importer.free()


# ---- refusals ----


@pytest.mark.parametrize(
    ("kind", "point", "force", "message"),
    [
        (
            "weak",
            ("x", "v"),
            "u",
            "m.v: expected derivatives that are linear in u, got slopes 1 and .* at 1.1e.12 times",
        ),
        ("stairs", ("x", "v"), "u", "m.v: expected derivatives that follow u, got some that do not change"),
        (
            "spring",
            TIP,
            None,
            "m.tip_rate: expected a force input, or a velocity that is a continuous state, got neither",
        ),
        (
            "spring",
            ("x", "x"),
            "u",
            "m.x: expected a velocity that is linear in an impulse, got changes by 0 and 0 m/s",
        ),
    ],
)
@fmi_versions
def test_a_body_that_takes_no_impulse_is_refused_by_its_reason(
    folder: Path, fmi: str, kind: str, point: tuple[str, str], force: str | None, message: str
) -> None:
    with pytest.raises(ComponentError, match=message):
        run_of([exchanged(folder, fmi, kind), rigid_stop(0.9, -0.5)], [contact(force, point)])


@fmi_versions
def test_a_force_input_that_changes_at_events_alone_is_refused(folder: Path, fmi: str) -> None:
    given = exchanged(folder, fmi, "spring")
    changed = 'variability="continuous" {}description="Force"'.format("" if fmi == "2.0" else 'start="0" ')
    discrete = folder / f"discrete{fmi[0]}.fmu"
    fmu_factory.redescribed(given.fmu, discrete, (changed, changed.replace("continuous", "discrete")))
    with pytest.raises(
        ComponentError, match=r"m.v: expected a continuous force input, got u, which is discrete"
    ):
        run_of([ComponentSpec("m", discrete, given.parameters), rigid_stop(0.9, -0.5)], [contact()])


def test_a_given_mass_is_compared_with_the_states(folder: Path) -> None:
    with pytest.raises(
        ComponentError, match="expected a body of the given mass, 1 kg, got an effective mass of 2 kg"
    ):
        run_of([exchanged(folder, "3.0", "falling", at=2.0), rigid_stop(0.9)], [contact(mass=1.0)])


@pytest.mark.parametrize(
    ("force", "states", "stop", "lacks"),
    [(None, True, "ImpactStop", "a force input"), ("u", False, "Buffer", "canGetAndSetFMUState")],
)
def test_a_stop_that_yields_needs_a_force_and_another_tool_s_stop_states(
    folder: Path, force: str | None, states: bool, stop: str, lacks: str
) -> None:
    ours = rigid_stop(0.9, law="kelvin_voigt", stiffness=1e4)
    theirs = ComponentSpec("s", fmu_factory.buffer(folder), {"k": 1e4, "gap": 0.5})
    names = (
        {} if stop == "ImpactStop" else {"stop_displacement": "d", "stop_velocity": "u", "stop_force": "push"}
    )
    met = replace(contact(force), side=None if stop == "ImpactStop" else "upper", **names)  # type: ignore[arg-type]
    parts = [exchanged(folder, "3.0", "spring", states=states), ours if stop == "ImpactStop" else theirs]
    with pytest.raises(
        ComponentError, match=f"s: expected a rigid stop .* without {lacks}, got a stop that yields"
    ):
        run_of(parts, [met])


# ---- stops that yield ----


def yielding(
    law: str, position: float = 0.0, side: str = "lower", name: str = "s", **more: float
) -> ComponentSpec:
    return rigid_stop(1.0, position, side, name, law=law, **more)


@pytest.mark.parametrize(("law", "stiffness"), [("kelvin_voigt", 1e4), ("hertz", 1e6)])
@pytest.mark.parametrize("states", [True, False])
@fmi_versions
def test_an_elastic_contact_keeps_the_energy_to_the_tolerance(
    folder: Path, fmi: str, states: bool, law: str, stiffness: float
) -> None:
    errors = []
    for tolerance in (1e-6, 1e-10):
        body = exchanged(folder, fmi, "pendulum", tolerance, states=states, x=0.0, v=2.0)
        run = run_of([body, yielding(law, 0.1, "upper", stiffness=stiffness)], [contact(point=TIP)])
        energy = InterfaceEnergy(run.importer, [])
        energy.begin([])
        run.at(0.3)
        angle, rate = run.motion()
        errors.append(abs(0.5 * rate**2 + GRAVITY * (1.0 - math.cos(angle)) - 2.0) / 2.0)
        assert list(energy.residuals()) == [0.0]
        assert run.importer.steps <= 12  # none is short for the contact
        run.importer.free()
    assert errors[0] <= 1e-5
    assert errors[1] <= 2e-9


@pytest.mark.parametrize("ratio", [0.1, 0.5])
@fmi_versions
def test_a_dashpot_has_the_restitution_impulse_and_duration_of_the_closed_form(
    folder: Path, fmi: str, ratio: float
) -> None:
    """equations.md 6.9: a mass of 1 kg whose other forces are small beside the contact's."""
    stiffness = 1e10
    stop = yielding(
        "kelvin_voigt", 0.1, "upper", stiffness=stiffness, damping=2.0 * ratio * math.sqrt(stiffness)
    )
    run = run_of([exchanged(folder, fmi, "spring", x=0.0, v=2.0), stop], [contact()]).at(0.2)
    (impact,) = run.importer.contacts.held[0].impacts.all
    damped = math.sqrt(1.0 - ratio**2)
    exact = math.exp(-2.0 * ratio * math.acos(ratio) / damped)
    assert impact.restitution == pytest.approx(exact, rel=1e-6)
    assert impact.duration == pytest.approx(
        2.0 * math.acos(ratio) / (math.sqrt(stiffness) * damped), rel=1e-5
    )
    assert impact.impulse == pytest.approx((1.0 + impact.restitution) * impact.closing, rel=1e-6)
    run.importer.free()


@pytest.mark.parametrize(
    ("law", "numbers", "depth"),
    [
        ("kelvin_voigt", {"stiffness": 1e4, "damping": 100.0}, GRAVITY / 1e4),
        ("hunt_crossley", {"stiffness": 1e6, "damping": 50.0, "exponent": 2.0}, math.sqrt(GRAVITY / 1e6)),
    ],
)
@pytest.mark.parametrize("height", [0.0, 0.1])
@fmi_versions
def test_a_mass_lies_in_a_stop_that_yields_by_the_law_s_depth(
    folder: Path, fmi: str, height: float, law: str, numbers: dict[str, float], depth: float
) -> None:
    run = run_of(
        [exchanged(folder, fmi, "falling", at=1.0, x=height), yielding(law, **numbers)], [contact()]
    ).at(20.0)
    assert run.motion() == pytest.approx([-depth, 0.0], abs=1e-8)
    assert run.importer.repeated_steps == 0
    run.importer.free()


@fmi_versions
def test_two_stops_press_one_force_input_and_samples_show_their_forces(folder: Path, fmi: str) -> None:
    stops = [
        yielding("hertz", -0.1, stiffness=1e6),
        yielding("kelvin_voigt", 0.1, "upper", "t", stiffness=1e4),
    ]
    ends = []
    for sampled in (False, True):
        run = run_of([exchanged(folder, fmi, "spring", x=0.0, v=2.0), *stops], [contact(), contact(stop="t")])
        names = ("m", "x"), ("m", "u"), ("s", "applied_force"), ("t", "applied_force")
        sampler = Sampler(run.importer, names, 5000.0) if sampled else None
        if sampler is not None:
            sampler.begin(0.0, 1.0)
        run.at(1.0)
        ends.append(run.motion())
        if sampler is not None:
            _, place, pushed, lower, upper = sampler.rows.T
            np.testing.assert_allclose(pushed, lower - upper, rtol=1e-12, atol=1e-9)
            np.testing.assert_allclose(
                lower, 1e6 * np.maximum(0.0, -0.1 - place) ** 1.5, rtol=1e-9, atol=1e-9
            )
            np.testing.assert_allclose(upper, 1e4 * np.maximum(0.0, place - 0.1), rtol=1e-9, atol=1e-9)
            assert (lower > 0.0).sum() > 20
            assert (upper > 0.0).sum() > 100
        run.importer.free()
    assert ends[0] == ends[1]


@pytest.mark.parametrize("law", ["restitution", "hunt_crossley"])
@fmi_versions
def test_our_oscillator_at_a_stop_moves_as_with_its_own_contact(fmi: str, law: str) -> None:
    body = {"mass": 2.0, "stiffness": 800.0, "damping": 0.4, "forcing.amplitude": 10.0}
    body["forcing.angular_frequency"] = 18.0
    stop = {"law": law, "position": 0.02, "restitution": 0.8, "stiffness": 1e7, "damping": 0.3}
    own = {**body, **{f"contact[1].{name}": value for name, value in stop.items()}}
    fused = Importer([ComponentSpec("o", fmu_path("Oscillator", fmi), own)], macro_step=0.1)
    fused.begin()
    fused.advance(5.0)
    exact = values(fused, "o", "displacement", "velocity")
    fused.free()
    parts = [
        ComponentSpec("m", fmu_path("Oscillator", fmi), body, 1e-10, "model_exchange"),
        ComponentSpec("s", fmu_path("ImpactStop", fmi), stop),
    ]
    run = run_of(parts, [contact("force", ("displacement", "velocity"))]).at(5.0)
    assert run.motion("displacement", "velocity") == pytest.approx(exact, rel=0.0, abs=1e-8)
    assert len(run.impacts) > 5
    run.importer.free()


@fmi_versions
def test_a_rigid_stop_and_one_that_yields_share_a_force_input(folder: Path, fmi: str) -> None:
    parts = [exchanged(folder, fmi, "spring", x=0.0, v=2.0), rigid_stop(1.0, -0.1)]
    upper = yielding("kelvin_voigt", 0.1, "upper", "t", stiffness=1e4)
    run = run_of([*parts, upper], [contact(), contact(stop="t")]).at(2.0)
    place, speed = run.motion()
    assert len(run.impacts) > 5
    assert 0.5 * (place**2 + speed**2) == pytest.approx(2.0, rel=1e-6)
    run.importer.free()


@given(
    law=st.sampled_from(["kelvin_voigt", "hertz"]),
    power=st.floats(2.0, 12.0),
    height=st.floats(1e-3, 1e2),
    step=st.floats(0.01, 3.0),
)
@settings(max_examples=15, deadline=None)
def test_any_elastic_stop_throws_a_ball_back_as_fast(
    folder: Path, law: str, power: float, height: float, step: float
) -> None:
    fall = math.sqrt(2.0 * height / GRAVITY)
    stop = yielding(law, stiffness=10.0**power)
    run = run_of(
        [exchanged(folder, "3.0", "last_fall", at=1.0, x=height), stop], [contact()], macro_step=step
    )
    run.at(2.5 * fall + 1.0)
    impacts = run.importer.contacts.held[0].impacts.all
    assert impacts[0].time == pytest.approx(fall, rel=1e-8)
    assert impacts[0].closing == pytest.approx(GRAVITY * fall, rel=1e-8)
    if not math.isnan(impacts[0].duration):
        assert impacts[0].restitution == pytest.approx(1.0, rel=1e-6)
    run.importer.free()


# ---- samples and watched variables ----


@pytest.mark.parametrize("states", [True, False])
@fmi_versions
def test_samples_between_steps_change_no_bit_and_repeat_nothing(folder: Path, fmi: str, states: bool) -> None:
    ends, repeated = [], []
    for sampled in (False, True):
        run = run_of([exchanged(folder, fmi, "spring", states=states), rigid_stop(0.9, -0.5)], [contact()])
        sampler = Sampler(run.importer, [("m", "x"), ("m", "v")], 77.0) if sampled else None
        if sampler is not None:
            sampler.begin(0.0, 4.0)
        run.at(4.0)
        ends.append(run.motion())
        repeated.append(run.importer.repeated_steps)
        if sampler is not None:
            time, place, speed = sampler.rows[sampler.rows[:, 0] < math.acos(-0.5)].T
            assert len(sampler.rows) == 309
            np.testing.assert_allclose(place, np.cos(time), rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(speed, -np.sin(time), rtol=0.0, atol=1e-9)
        run.importer.free()
    assert ends[0] == ends[1]
    assert repeated[0] == repeated[1] <= len(run.times)


@pytest.mark.parametrize("states", [True, False])
@pytest.mark.parametrize(
    ("direction", "first"), [("falling", math.acos(0.25)), ("rising", 2.0 * math.pi - math.acos(0.25))]
)
@fmi_versions
def test_a_watched_variable_is_a_root_of_the_integration(
    folder: Path, fmi: str, direction: Any, first: float, states: bool
) -> None:
    watched = EventSpec("m", "x", direction, 0.25)
    run = run_of([exchanged(folder, fmi, "spring", states=states)], [], events=[watched], macro_step=3.0).at(
        13.0
    )
    assert run.times == pytest.approx([first, first + 2.0 * math.pi], abs=1e-7)
    assert values(run.importer, "m", "x") == pytest.approx([math.cos(13.0)], abs=1e-7)
    run.importer.free()


def test_a_run_with_contacts_begins_again_as_the_first_time(folder: Path) -> None:
    run = ball(folder).at(2.0)
    first = run.motion()
    run.importer.begin()
    assert run.at(2.0).motion() == first
    run.importer.free()
