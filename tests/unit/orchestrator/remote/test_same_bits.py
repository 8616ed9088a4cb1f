"""An FMU on a server gives the bits of the same FMU in this process, and a step is one batch."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from support import fmu_factory
from support.coupled_parts import P11, VERSIONS, body, contact, external, link, part, stop
from support.held_parts import foreign_contact
from support.pair_parts import hit, pair
from support.plain_runs import Run
from support.served_fmus import Servers, servers

from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec
from vibroimpact.orchestrator.remote.session import Session


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def served() -> Iterator[Servers]:
    with servers() as found:
        yield found


def same(
    served: Servers,
    parts: Sequence[ComponentSpec],
    links: Sequence[ConnectionSpec],
    *ends: float,
    elsewhere: Sequence[str],
    **options: Any,
) -> Run:
    """Run with components here and elsewhere; return the run elsewhere, whose facts equal those of the other."""
    there = [served.there(spec) if spec.name in elsewhere else spec for spec in parts]
    here, run = (Run(each, links, in_c=True, **options).go(*ends) for each in (parts, there))
    assert run.facts() == here.facts()
    for each in (here, run):
        each.importer.free()
    return run


@pytest.mark.parametrize("version", VERSIONS)
def test_a_body_with_events_and_its_stop(served: Servers, version: str) -> None:
    parts = [body("b", {**P11, **external(1.0)}, version), stop("s", 0.7, version)]
    run = same(served, parts, contact("b", "s"), 7.0, 12.0, elsewhere=["b"], macro_step=0.5)
    assert len(run.events) >= 1
    assert run.importer._plan.plain_loop is None


def test_bodies_sent_back_to_each_others_events(served: Servers) -> None:
    slow = {"damping": 0.1, "forcing.amplitude": 0.5, "forcing.angular_frequency": 0.85}
    parts = [body("a", {**P11, **external(1.0)}), stop("sa", 0.7)]
    parts += [body("b", {**slow, **external(1.0)}, "2.0"), stop("sb", 0.6)]
    links = [*contact("a", "sa"), *contact("b", "sb"), link("a.displacement", "b.force", 0.01)]
    run = same(served, parts, links, 20.0, elsewhere=["a", "b"], macro_step=3.0)
    assert run.importer.repeated_steps > 0


def test_steps_that_return_early_and_an_iterated_exchange(served: Servers, folder: Path) -> None:
    parts = [body("b", P11), part("mass", fmu_factory.mass(folder), k=2.0, x=0.1)]
    parts += [part("ball", fmu_factory.stepped_ball(folder))]
    links = [link("b.displacement", "mass.f", -0.3), link("mass.x", "b.force", 0.1)]
    options = {"macro_step": 0.2, "exchange": "iterated"}
    run = same(served, parts, links, 3.0, elsewhere=["mass", "ball"], **options)
    assert len(run.events) > 2


def test_a_watched_variable_is_found_by_saved_states(served: Servers, folder: Path) -> None:
    parts = [part("ball", fmu_factory.bouncing_ball(folder, "2.0"))]
    events = [EventSpec("ball", "v", "rising")]
    run = same(served, parts, [], 1.5, elsewhere=["ball"], events=events, macro_step=0.1)
    assert len(run.events) > 1


def test_a_contact_with_a_held_force(served: Servers, folder: Path) -> None:
    parts = [part("b", fmu_factory.mass(folder), x=-0.5, v=1.0, k=1.0), stop("s", 0.7)]
    options = {"contacts": [foreign_contact()], "macro_step": 0.1}
    run = same(served, parts, [], 2.0, elsewhere=["b"], **options)
    assert run.importer.repeated_steps > 0


def test_bodies_that_hit_each_other(served: Servers) -> None:
    bodies = [hit("a", displacement_start=-1.0), hit("b", stiffness=7.3, displacement_start=0.6)]
    run = same(served, bodies, [], 3.0, elsewhere=["b"], pairs=[pair("a", "b", 0.9, 0.3)], macro_step=0.25)
    assert len(run.events) == 2


def test_an_input_clock_ticks_at_its_instants(served: Servers, folder: Path) -> None:
    parts = [body("b", P11), part("c", fmu_factory.clocked(folder), interval=0.35, shift=0.1)]
    links = [link("b.displacement", "c.u"), link("c.y", "b.force", 0.1)]
    found = []
    for there in (parts[1], served.there(parts[1])):
        run = Run([parts[0], there], links, in_c=True, macro_step=0.2).go(2.0)
        motion = run.importer.components["b"].group("Float64", ["displacement", "force"]).get()
        found.append((run.events, motion.tobytes(), run.failure))
        run.importer.free()
    assert found[0] == found[1]
    assert motion[1] > 3.0  # ten times the ticks, times the gain


def test_clocks_of_all_kinds_tick_at_their_instants(served: Servers, folder: Path) -> None:
    timed = fmu_factory.timed(folder)
    parts = [part("a", timed), part("b", timed, period=0.3, delay=0.0)]
    names = ["beats", "strides", "fuses", "hits", "sum", "last"]
    found = []
    for each in (parts, [served.there(spec) for spec in parts]):
        run = Run(each, [link("a.out", "b.hit")], in_c=True, macro_step=0.2).go(1.95)
        found.append([run.importer.components[c].group("Float64", names).get().tobytes() for c in "ab"])
        assert not run.failure
        run.importer.free()
    assert found[0] == found[1]


def test_sizes_arrays_and_texts(served: Servers, folder: Path) -> None:
    fmu = fmu_factory.typed(folder)
    values = {
        "rows": 1,
        "columns": 2,
        "a_Float64": (0.1, -2.5),
        "p_String": "Grüße",
        "a_String": ("", "x" * 5000),
    }
    spec = ComponentSpec("t", fmu, values)
    found = []
    for each in (spec, served.there(spec)):
        run = Run([each], [], in_c=True, macro_step=0.5).go(1.0)
        component = run.importer.components["t"]
        texts = component.group("String", ["y_String", "b_String"]).get().tolist()
        found.append((component.group("Float64", ["b_Float64"]).get().tobytes(), texts))
        run.importer.free()
    assert found[0] == found[1]
    assert texts == ["Grüße", "", "x" * 5000]


def test_a_step_that_calls_back_is_given_a_callback_there(served: Servers, folder: Path) -> None:
    parts = [part("m", fmu_factory.updating_mass(folder), k=1.0, x=0.1)]
    same(served, parts, [], 1.0, elsewhere=["m"], macro_step=0.1)


def test_a_loop_is_solved_with_derivatives_and_refused_values(served: Servers, folder: Path) -> None:
    fmu = fmu_factory.feedthrough(folder, "2.0")
    parts = [part("a", fmu, l=0.5), part("b", fmu, l=0.3)]
    links = [link("a.y", "b.u"), link("b.y", "a.u", 0.4)]
    same(served, parts, links, 1.0, elsewhere=["a"], macro_step=0.5)


def test_a_run_that_begins_again_is_the_same_run(served: Servers) -> None:
    parts = [served.there(body("b", {**P11, **external(1.0)})), stop("s")]
    run = Run(parts, contact("b", "s"), in_c=True, macro_step=1.0).go(20.0)
    first = run.facts()
    run.events, run.pauses = [], []
    assert run.go(20.0).facts() == first
    run.importer.free()


FAULTS = {"3.0": ("fatal", "says_past", "round_upward"), "2.0": ("discard", "strange_log")}


@pytest.mark.parametrize(("fmi", "fault"), [(fmi, fault) for fmi in FAULTS for fault in FAULTS[fmi]])
def test_a_fault_is_told_in_the_same_words(served: Servers, folder: Path, fmi: str, fault: str) -> None:
    parts = [part("f", fmu_factory.faulty(folder, fmi), fault=fault, fault_time=0.5), body("b", P11)]
    same(served, parts, [link("b.displacement", "f.u")], 1.0, elsewhere=["f"], macro_step=0.25)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_is_one_batch(served: Servers, version: str, monkeypatch: pytest.MonkeyPatch) -> None:
    batches: list[list[str]] = []
    exchanged = Session._exchanged

    def noted(self: Session, calls: Sequence[Any], *more: Any) -> Any:
        batches.append([call.function for call in calls])
        return exchanged(self, calls, *more)

    monkeypatch.setattr(Session, "_exchanged", noted)
    parts = [served.there(body("b", P11, version)), body("d", P11)]
    links = [link("d.displacement", "b.force", 0.1), link("b.displacement", "d.force", 0.1)]
    run = Run(parts, links, in_c=True, macro_step=0.1).go(2.0)
    batches.clear()
    run.importer.advance(12.0)
    assert len(batches) <= 1.05 * (run.importer.steps - 20)
    assert all("DoStep" in batch for batch in batches[:50])
    run.importer.free()


def test_the_derivative_of_an_output_is_that_here(served: Servers, folder: Path) -> None:
    fmu = fmu_factory.feedthrough(folder, "3.0")
    spec = part("a", fmu, l=0.5)
    found = []
    for each in (spec, served.there(spec)):
        run = Run([each], [], in_c=False, macro_step=1.0).go(1.0)
        component = run.importer.components["a"]
        y, u = (component.variables[name].valueReference for name in ("y", "u"))
        status, slopes = component.instance.directional_derivative([y], u)
        found.append((status, slopes.tobytes()))
        run.importer.free()
    assert found[0] == found[1]
    assert not math.isnan(sum(found[1][1]))
