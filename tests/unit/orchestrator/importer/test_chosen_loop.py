"""Chosen steps in C: the bits, the counts and the errors of the same steps in Python."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import VERSIONS, body, contact, events_of, external, link, part, stop

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec

Scene = tuple[list[ComponentSpec], list[ConnectionSpec]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def oscillator(name: str, version: str = "3.0", **parameters: float) -> ComponentSpec:
    return body(name, {"mass": 1.0, "stiffness": 1.0, **parameters}, version)


def both_ways(first: str, second: str, gain: float = 0.1) -> list[ConnectionSpec]:
    """Connect displacement and force of two components, given as `component.displacement.force`."""
    one, other = first.split("."), second.split(".")
    return [
        link(f"{one[0]}.{one[1]}", f"{other[0]}.{other[2]}", gain),
        link(f"{other[0]}.{other[1]}", f"{one[0]}.{one[2]}", gain),
    ]


def pair(folder: Path, versions: tuple[str, str] = VERSIONS) -> Scene:
    parts = [oscillator("a", versions[0], displacement_start=1.0), oscillator("b", versions[1])]
    return parts, both_ways("a.displacement.force", "b.displacement.force")


def impacts(folder: Path, version: str = "3.0") -> Scene:
    struck = {"velocity_start": 2.0, **external(0.5)}
    return [oscillator("a", version, **struck), stop("s", 0.7, version), oscillator("b", version)], [
        *contact("a", "s"),
        *both_ways("a.displacement.force", "b.displacement.force"),
    ]


def impacts2(folder: Path) -> Scene:
    return impacts(folder, "2.0")


def integrated(folder: Path) -> Scene:
    parts, links = pair(folder)
    return [replace(p, run_as="model_exchange", tolerance=1e-8) for p in parts], links


def jumping(folder: Path) -> Scene:
    """Return a ball whose velocity jumps within a step, unannounced: steps are taken back."""
    return [part("a", fmu_factory.bouncing_ball(folder)), oscillator("b")], [link("a.v", "b.force")]


def discarding(folder: Path, version: str = "3.0") -> Scene:
    mass = part("a", fmu_factory.mass(folder, version), k=1.0, load=1.0, scheme=6, inner_step=0.02)
    return [mass, oscillator("b")], both_ways("a.x.f", "b.displacement.force")


def without_states(folder: Path) -> Scene:
    return [oscillator("a", displacement_start=1.0), part("g", fmu_factory.gain(folder), k=-0.5)], [
        link("a.displacement", "g.u"),
        link("g.y", "a.force"),
    ]


SCENES = [pair, impacts, impacts2, integrated, jumping, discarding, without_states]


def run(scene: Scene, exchange: str, *, in_c: bool, tolerance: float = 1e-3, end: float = 1.5) -> object:
    parts, links = scene
    importer = Importer(
        parts,
        links,
        exchange=exchange,  # type: ignore[arg-type]  # a parameter of tests
        macro_step="auto",
        coupling_tolerance=tolerance,
    )
    importer.steps_in_c = in_c
    events = events_of(importer)
    importer.begin()
    importer.advance(end)
    assert importer.adaptive is not None
    names = [(t.source, c.source[1]) for t in importer.transfers for c in t.connections]
    values = [float(owner.group("Float64", [name]).get()[0]).hex() for owner, name in names]
    record = importer.adaptive.record.row().tobytes()
    counts = importer.steps, importer.repeated_steps, importer.time
    importer.free()
    return values, record, counts, events


@pytest.mark.parametrize("exchange", ["gauss_seidel", "jacobi"])
@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: scene.__name__)
def test_steps_in_c_have_the_bits_of_steps_in_python(
    folder: Path, scene: Callable[[Path], Scene], exchange: str
) -> None:
    made = scene(folder)
    assert run(made, exchange, in_c=True) == run(made, exchange, in_c=False)


@settings(max_examples=10, deadline=None)
@given(
    st.sampled_from([("3.0", "3.0"), ("2.0", "3.0"), ("2.0", "2.0")]),
    st.sampled_from(["gauss_seidel", "jacobi"]),
    st.floats(-6.0, 0.0),
    st.floats(0.1, 100.0),
    st.floats(-20.0, 20.0),
)
def test_any_two_coupled_bodies_have_the_same_bits(
    versions: tuple[str, str], exchange: str, digits: float, stiffness: float, start: float
) -> None:
    # a large scale beside a small one, growth, and motion from rest
    parts = [
        oscillator("a", versions[0], displacement_start=10.0**start),
        oscillator("b", versions[1], stiffness=stiffness),
    ]
    scene = parts, both_ways("a.displacement.force", "b.displacement.force", 0.3)
    one, other = (run(scene, exchange, in_c=c, tolerance=10.0**digits, end=0.1) for c in (True, False))
    assert one == other


@pytest.mark.parametrize("fault", [1, 2, 3, 10, 11, 19, 20])
@pytest.mark.parametrize("version", VERSIONS)
def test_faults_and_values_that_are_no_numbers_have_the_same_end(
    folder: Path, version: str, fault: int
) -> None:
    faulty = part("a", fmu_factory.faulty(folder, version), fault=fault, fault_time=0.3)
    scene = [faulty, oscillator("b", displacement_start=1.0)], both_ways("a.y.u", "b.displacement.force")
    said = []
    for in_c in (True, False):
        try:
            said.append(run(scene, "gauss_seidel", in_c=in_c, tolerance=1e-2))
        except ComponentError as error:
            said.append((str(error), error.instance, error.time))
    assert said[0] == said[1]


def test_a_pair_makes_its_steps_in_c(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    parts, links = pair(folder)
    importer = Importer(parts, links, macro_step="auto")
    importer.begin()
    monkeypatch.setattr(importer, "attempt", None)
    importer.advance(0.1)
    assert importer.steps > 10
    assert importer.time == 0.1
    importer.free()
