"""Bodies of other tools that hit each other, or a body of this package, by compliant laws: momentum and energy."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import VERSIONS, events_of, part, values
from support.pair_parts import hit

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import BodyPoint, ComponentSpec, PairSpec

ELASTIC = {"kelvin_voigt": 1e4, "hertz": 1e6}


def point(name: str, mass: float = 1.0) -> BodyPoint:
    return BodyPoint(name, "x", "v", "f", mass)


def run_of(bodies: list[ComponentSpec], *pairs: PairSpec, macro_step: float = 0.1) -> Importer:
    importer = Importer(bodies, pairs=pairs, macro_step=macro_step)
    importer.begin()
    return importer


@given(
    mass=st.floats(1e-2, 1e2),
    other=st.floats(1e-2, 1e2),
    speed=st.floats(0.1, 10.0),
    law=st.sampled_from(sorted(ELASTIC)),
    version=st.sampled_from(VERSIONS),
)
@settings(max_examples=12, deadline=None)
def test_any_two_foreign_masses_that_collide_elastically_keep_momentum_and_energy(
    tmp_path_factory: pytest.TempPathFactory, mass: float, other: float, speed: float, law: str, version: str
) -> None:
    fmu = fmu_factory.mass(tmp_path_factory.mktemp("m"), version)
    bodies = [part("a", fmu, v=speed, m=mass), part("b", fmu, m=other)]
    importer = run_of(
        bodies,
        PairSpec(point("a", mass), point("b", other), 0.5, law, stiffness=ELASTIC[law]),  # type: ignore[arg-type]
    )
    events = events_of(importer)
    importer.advance(2.0 / speed)
    (va,), (vb,) = values(importer, "a", "v"), values(importer, "b", "v")
    assert mass * va + other * vb == pytest.approx(mass * speed, rel=1e-12)
    assert va == pytest.approx(speed * (mass - other) / (mass + other), rel=1e-9, abs=1e-9 * speed)
    assert vb == pytest.approx(2.0 * speed * mass / (mass + other), rel=1e-9)
    assert [event.time for event in events] == pytest.approx([0.5 / speed], rel=1e-11)
    importer.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("first", ["ours", "theirs"])
def test_a_body_of_ours_and_one_of_another_tool_throw_each_other_back(
    tmp_path: Path, first: str, version: str
) -> None:
    fmu = fmu_factory.mass(tmp_path, version)
    ours = hit("a", version=version, displacement_start=-1.0 if first == "ours" else 1.0)
    theirs = part("b", fmu, m=3.0, k=3.0)
    ends: list[tuple[str, str] | BodyPoint] = [("a", "contact[1]"), point("b", 3.0)]
    lower, upper = ends if first == "ours" else reversed(ends)
    importer = run_of([ours, theirs], PairSpec(lower, upper, 0.2, "hertz", stiffness=1e6))
    importer.advance(30.0)
    v, x = values(importer, "a", "velocity", "displacement")
    w, y = values(importer, "b", "v", "x")
    assert abs(w) + abs(y) > 1e-2
    assert 0.5 * (v * v + x * x + 3.0 * (w * w + y * y)) == pytest.approx(0.5, rel=1e-8)
    importer.free()


def test_a_foreign_body_between_a_stop_and_another_body_has_the_sum_of_both_forces(tmp_path: Path) -> None:
    # a mass at rest stays between two springs that both press it
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part(name, fmu, m=1.0, k=100.0, x=x) for name, x in (("a", 0.1), ("b", 0.0), ("c", -0.1))]
    pairs = [
        PairSpec(point(low), point(high), 0.0, "kelvin_voigt", stiffness=1e3) for low, high in ("ab", "bc")
    ]
    importer = run_of(bodies, *pairs, macro_step=0.01)
    importer.advance(3.0)
    (xa,), (xb,), (xc,) = (values(importer, name, "x") for name in "abc")
    assert xb == pytest.approx(0.0, abs=1e-12)
    assert xa == pytest.approx(-xc, abs=1e-12)
    importer.free()


def test_a_run_begins_without_the_force_that_the_one_before_ended_with(tmp_path: Path) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    bodies = [part("a", fmu, v=1.0, m=1.0), part("b", fmu, m=1.0)]
    importer = run_of(bodies, PairSpec(point("a"), point("b"), 0.5, "kelvin_voigt", stiffness=1e4))
    importer.advance(0.5 + 0.25 * math.pi / math.sqrt(2e4))  # in the middle of the contact
    importer.begin()
    importer.advance(0.4)
    assert values(importer, "a", "x", "v") == pytest.approx([0.4, 1.0], rel=1e-12)
    importer.free()


def test_a_body_that_cannot_go_back_is_refused(tmp_path: Path) -> None:
    fmu = fmu_factory.mass(tmp_path, "3.0")
    stateless = fmu_factory.mass(tmp_path, "3.0", states=False)
    with pytest.raises(ComponentError, match="a: expected a body that can save its state"):
        Importer(
            [part("a", stateless), part("b", fmu)],
            pairs=[PairSpec(point("a"), point("b"), 0.5, "hertz", stiffness=1e6)],
        )
