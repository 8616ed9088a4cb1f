"""Rigid impacts of bodies of other tools, which take only forces: an impulse is a force over one very short step.

References: momentum and restitution of the closed form (equations.md 3.5), thrown balls, statics.
"""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.compliant_parts import yielding_stop
from support.coupled_parts import EXCHANGES, VERSIONS, events_of, part, values
from support.held_parts import foreign_contact, held
from support.pair_parts import hit

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import BodyPoint, ComponentSpec, PairSpec

GRID, CLIPPED = 3, 4
"""Schemes of the mass: steps on a grid of its own; a force of at most 1e6 N."""


def point(name: str, mass: float = 1.0, **more: str) -> BodyPoint:
    return BodyPoint(
        **{"component": name, "displacement": "x", "velocity": "v", "force": "f", **more}, mass=mass
    )


def run_of(
    bodies: list[ComponentSpec],
    *pairs: PairSpec,
    macro_step: float = 0.1,
    start: float = 0.0,
    exchange: str = "jacobi",
) -> Importer:
    importer = Importer(bodies, pairs=pairs, macro_step=macro_step, exchange=exchange)  # type: ignore[arg-type]
    importer.begin(start)
    return importer


@given(
    mass=st.floats(1e-3, 1e3),
    other=st.floats(1e-3, 1e3),
    speed=st.floats(1e-3, 1e3),
    restitution=st.floats(0.05, 1.0),
    ours=st.booleans(),
    version=st.sampled_from(VERSIONS),
)
@settings(max_examples=30, deadline=None)
def test_an_impact_of_a_foreign_body_is_the_closed_form(
    tmp_path_factory: pytest.TempPathFactory,
    mass: float,
    other: float,
    speed: float,
    restitution: float,
    ours: bool,
    version: str,
) -> None:
    fmu = fmu_factory.mass(tmp_path_factory.mktemp("m"), version)
    upper: tuple[ComponentSpec, tuple[str, str] | BodyPoint] = (part("b", fmu, m=other), point("b", other))
    if ours:
        upper = hit("b", version=version, mass=other, stiffness=0.0), ("b", "contact[1]")
    struck = PairSpec(point("a", mass), upper[1], 0.5, restitution=restitution)
    importer = run_of([part("a", fmu, v=speed, m=mass), upper[0]], struck, macro_step=0.3 / speed)
    events = events_of(importer)
    importer.advance(2.0 / speed)
    (va,), (vb,) = values(importer, "a", "v"), values(importer, "b", "velocity" if ours else "v")
    assert mass * va + other * vb == pytest.approx(mass * speed, rel=1e-12)
    assert vb - va == pytest.approx(restitution * speed, rel=1e-9)
    energy = 0.5 * mass * speed**2 * (1.0 - (1.0 - restitution**2) * other / (mass + other))
    assert 0.5 * (mass * va**2 + other * vb**2) == pytest.approx(energy, rel=1e-9)
    (xa,) = values(importer, "a", "x")
    assert xa == pytest.approx(0.5 + va * 1.5 / speed, abs=1e-11 * max(1.0, speed))
    assert [event.time for event in events] == pytest.approx([0.5 / speed], rel=1e-9)
    importer.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_body_of_ours_and_a_foreign_one_keep_their_energy_over_many_impacts(
    tmp_path: Path, version: str
) -> None:
    ours = hit("a", version=version, displacement_start=-1.0)
    theirs = part("b", fmu_factory.mass(tmp_path, version), m=3.0, k=3.0)
    importer = run_of([ours, theirs], PairSpec(("a", "contact[1]"), point("b", 3.0), 0.2))
    events = events_of(importer)
    importer.advance(100.0)
    v, x = values(importer, "a", "velocity", "displacement")
    w, y = values(importer, "b", "v", "x")
    assert len(events) >= 25
    assert 0.5 * (v * v + x * x + 3.0 * (w * w + y * y)) == pytest.approx(0.5, rel=1e-9)
    importer.free()


def test_a_cradle_of_foreign_balls_gives_one_for_one_from_a_start_in_contact(tmp_path: Path) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    names = "abcde"
    bodies = [part(name, fmu, k=1.0, x=-1.0 if name == "a" else 0.0) for name in names]
    importer = run_of(bodies, *(PairSpec(point(low), point(high)) for low, high in pairwise(names)))
    events = events_of(importer)
    importer.advance(10.0 * math.pi)
    assert len(events) == 40  # four impulses at each of ten instants
    motion = [value for name in names for value in values(importer, name, "x", "v")]
    assert motion == pytest.approx([-1.0, *[0.0] * 9], abs=1e-10)
    importer.free()
    thrown = [part(name, fmu, v=1.0 if name == "a" else 0.0) for name in "abc"]
    importer = run_of(thrown, *(PairSpec(point(low), point(high)) for low, high in pairwise("abc")))
    importer.advance(1.0)
    assert [values(importer, name, "v") for name in "abc"] == [[0.0], [0.0], [pytest.approx(1.0, rel=1e-14)]]
    importer.free()


@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("start", [0.0, 1e4])
def test_neither_the_exchange_nor_a_late_hour_makes_a_difference(
    tmp_path: Path, start: float, exchange: str
) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0), part("b", fmu, m=3.0)]
    importer = run_of(bodies, PairSpec(point("a"), point("b", 3.0), 1.0), start=start, exchange=exchange)
    importer.advance(start + 3.0)
    assert values(importer, "a", "v") == [pytest.approx(-0.5, rel=1e-12)]
    assert values(importer, "b", "x", "v") == pytest.approx([1.0, 0.5], rel=1e-11 + 1e-14 * start)
    importer.free()


def test_bounces_of_a_foreign_ball_end_in_rest_on_a_foreign_plate(tmp_path: Path) -> None:
    # a ball of 1 kg falls 1 m to a plate of 1000 kg: bounces end at t0 (1 + r)/(1 - r). Then both fall together
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("plate", fmu, m=1000.0), part("ball", fmu, x=1.0, load=-10.0)]
    importer = run_of(bodies, PairSpec(point("plate", 1000.0), point("ball"), restitution=0.5))
    events = events_of(importer)
    importer.advance(3.0)
    assert 8 <= len(events) <= 20
    (x, v), (y, w) = values(importer, "ball", "x", "v"), values(importer, "plate", "x", "v")
    assert events[-1].time < 3.0 * math.sqrt(0.2)
    assert x - y == pytest.approx(0.0, abs=1e-10)
    assert v == pytest.approx(w, abs=1e-9)
    assert v + 1000.0 * w == pytest.approx(-30.0, rel=1e-9)
    importer.free()


def test_a_foreign_mass_between_a_rigid_impact_and_a_stop_that_yields_keeps_the_energy(
    tmp_path: Path,
) -> None:
    # it starts in contact with the other mass, which throws it at a Hertz stop again and again
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0, k=1.0, m=2.0), part("b", fmu, k=1.0)]
    stop = yielding_stop("s", "hertz", {"stiffness": 1e6}, 0.3)
    importer = Importer(
        [*bodies, stop],
        contacts=[foreign_contact()],
        pairs=[PairSpec(point("a", 2.0), point("b"))],
        macro_step=0.1,
    )
    importer.begin()
    events = events_of(importer)
    importer.advance(20.0)
    (x, v), (y, w) = values(importer, "a", "x", "v"), values(importer, "b", "x", "v")
    assert {event.component for event in events} == {"a", "b"}
    pressed = 0.4e6 * max(0.0, y - 0.3) ** 2.5
    assert 0.5 * (2.0 * v * v + w * w + x * x + y * y) + pressed == pytest.approx(1.0, rel=1e-8)
    importer.free()


def test_a_run_that_is_sampled_is_the_run_bit_for_bit_and_begins_anew(tmp_path: Path) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0, k=1.0), part("b", fmu, k=2.0)]
    pair = PairSpec(point("a"), point("b"), 0.1, restitution=0.9)
    ends = []
    for rate in (None, 7.0, 1000.0):
        importer = run_of(bodies, pair)
        sampler = None if rate is None else Sampler(importer, [("a", "x"), ("b", "v")], rate)
        for _ in range(2):
            importer.begin()
            events = events_of(importer)
            if sampler is not None:
                sampler.begin(0.0, 10.0)
            importer.advance(10.0)
            ends.append((values(importer, "a", "x", "v"), [event.time for event in events]))
        importer.free()
    assert len(ends[0][1]) == 4
    assert all(end == ends[0] for end in ends)


# ---- a stop that does not move ----


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("mass", [2.0, None], ids=["given", "found"])
def test_a_foreign_mass_between_rigid_stops_bounces_as_they_say(
    tmp_path: Path, mass: float | None, version: str
) -> None:
    sides = {"s": (0.5, "upper", 0.8), "l": (-0.5, "lower", 0.5)}
    stops = [
        yielding_stop(name, "restitution", {"restitution": r}, position, side, version=version)
        for name, (position, side, r) in sides.items()
    ]
    contacts = [foreign_contact(name, mass) for name in sides]
    run = held(tmp_path, stops, {"v": 1.0, "m": 2.0}, contacts=contacts, version=version)
    displacement, velocity = run.motion(4.0)  # 0.5 s up, 1/0.8 s down, 1/0.4 s up
    assert velocity == pytest.approx(0.4, rel=1e-12)
    assert displacement == pytest.approx(-0.5 + 0.4 * (4.0 - 1.75), abs=1e-11)
    assert [(e.time, e.component) for e in run.events] == [
        (pytest.approx(t, abs=1e-11), "b") for t in (0.5, 1.75)
    ]
    assert run.residual() == 0.0
    run.importer.begin()
    run.importer.advance(4.0)
    assert values(run.importer, "b", "x", "v") == [displacement, velocity]
    run.importer.free()


def test_a_foreign_ball_comes_to_rest_on_a_rigid_floor(tmp_path: Path) -> None:
    floor = yielding_stop("s", "restitution", {"restitution": 0.5}, -1.0, "lower")
    run = held(tmp_path, [floor], {"m": 2.0, "load": -20.0}, contacts=[foreign_contact(mass=2.0)])
    displacement, velocity = run.motion(5.0)
    assert displacement == pytest.approx(-1.0, abs=1e-10)
    assert velocity == pytest.approx(0.0, abs=1e-9)
    assert run.importer.steps <= 200
    run.importer.free()


def test_a_stop_whose_restitution_falls_with_the_speed_is_asked_at_each_impact(tmp_path: Path) -> None:
    stop = yielding_stop("s", "restitution", {"restitution": 0.8, "yield_velocity": 0.1})
    run = held(tmp_path, [stop], {"v": 1.0})
    assert run.motion(3.0)[1] == pytest.approx(-0.8 * 10.0**-0.25, rel=1e-12)
    run.importer.free()


# ---- refusals, and the mass ----


@pytest.mark.parametrize(
    ("scheme", "got"),
    [
        (GRID, "got one that does not change, at time 0. A body with steps or limits of its own"),
        (CLIPPED, "got one as of 2147.48 kg, and of 1073.74 kg over twice as long"),
    ],
    ids=["grid", "clipped"],
)
def test_a_body_that_does_not_answer_an_impulse_is_found_out_at_the_start(
    tmp_path: Path, scheme: int, got: str
) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0, scheme=float(scheme), inner_step=1e-3), part("b", fmu)]
    with pytest.raises(ComponentError) as caught:
        run_of(bodies, PairSpec(point("a"), point("b"), 0.5))
    assert "a.f: expected a velocity that answers an impulse" in str(caught.value)
    assert got in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("law", ["restitution", "kelvin_voigt"])
def test_a_mass_that_is_given_wrong_is_one_error_that_names_both(tmp_path: Path, law: str) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0), part("b", fmu)]
    wrong = PairSpec(point("a", 1000.0), point("b"), 0.5, law, stiffness=1e4)  # type: ignore[arg-type]
    with pytest.raises(ComponentError) as caught:
        run_of(bodies, wrong).advance(0.1)
    assert "a.v: expected a body of the given mass, 1000 kg, got an effective mass of 1 kg" in str(
        caught.value
    )
    near = PairSpec(point("a", 1.03), point("b"), 0.5, law, stiffness=1e4)  # type: ignore[arg-type]
    importer = run_of(bodies, near)
    importer.advance(1.5)
    assert values(importer, "b", "v") == [pytest.approx(1.0, rel=1e-9)]  # by the measured mass
    importer.free()


@pytest.mark.parametrize("scheme", [0, GRID], ids=["exact", "grid"])
def test_the_mass_of_a_contact_with_a_stop_is_compared_with_a_trial_step(tmp_path: Path, scheme: int) -> None:
    stop = yielding_stop("s", "kelvin_voigt", {"stiffness": 1e2})
    own = {"v": 1.0, "scheme": float(scheme), "inner_step": 1e-3}
    run = held(tmp_path, [stop], own)
    run.motion(0.5)
    run.importer.free()
    run = held(tmp_path, [stop], own, contacts=[foreign_contact(mass=1000.0)])
    with pytest.raises(
        ComponentError, match=r"given mass, 1000 kg, got an effective mass of 1( to 1\.6)? kg in a trial"
    ):
        run.motion(0.5)
    run = held(tmp_path, [stop], {"v": 1.0}, contacts=[foreign_contact(mass=1000.0)], states=False)
    run.motion(0.5)  # the given mass is used: no step can be tried
    run.importer.free()


def test_a_body_that_no_force_brings_to_its_velocity_is_an_error_that_says_where(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    importer = run_of([part("a", fmu, v=1.0), part("b", fmu)], PairSpec(point("a"), point("b"), 0.5))
    monkeypatch.setattr("vibroimpact.orchestrator.importer.stop_contacts.pulse.MISFIT", -1.0)
    with pytest.raises(
        ComponentError, match=r"[ab]\.f: expected a change of the velocity by .* after 8 tries at time 0\.5"
    ):
        importer.advance(1.0)
    importer.free()
