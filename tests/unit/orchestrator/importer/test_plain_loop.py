"""Plain steps in C and the same steps in Python agree to the bit."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest
from support import fmu_factory
from support.body_scenes import BEAM, CHAIN, BodyScene
from support.component_fmu import EXTERNAL
from support.component_fmu import stop as numbered_stop
from support.coupled_parts import P11, VERSIONS, body, contact, external, link, part, stop
from support.plain_runs import Run, both

from vibroimpact.fmus import fmu_path
from vibroimpact.orchestrator.importer.specification import ComponentSpec

MIXED = [("3.0", "3.0"), ("2.0", "2.0"), ("3.0", "2.0"), ("2.0", "3.0")]
END = 60.0
FAULTS = (
    "error", "fatal", "discard", "not_a_number", "terminate", "stall", "says_nan", "says_infinite",
    "says_beyond", "says_start", "says_past", "end_short", "round_upward", "flush_to_zero", "strange_log",
)  # fmt: skip
CALLS = {
    "get": "GetFloat64", "set": "SetFloat64", "save": "GetFMUState", "restore": "SetFMUState",
    "event": "UpdateDiscreteStates",
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.mark.parametrize("macro_step", [math.inf, 0.3])
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_a_body_and_its_stop_move_as_step_by_step(versions: tuple[str, str], macro_step: float) -> None:
    parts = [body("b", {**P11, **external(1.0)}, versions[0]), stop("s", 0.7, versions[1])]
    run = both(parts, contact("b", "s"), 7.0, END, macro_step=macro_step)
    assert len(run.events) >= 9


@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_two_bodies_with_stops_that_are_sent_back_to_each_others_events(versions: tuple[str, str]) -> None:
    slow = {"damping": 0.1, "forcing.amplitude": 0.5, "forcing.angular_frequency": 0.85}
    parts = [body("a", {**P11, **external(1.0)}, versions[0]), stop("sa", 0.7, versions[1])]
    parts += [body("b", {**slow, **external(1.0)}, versions[1]), stop("sb", 0.6, versions[0])]
    links = [*contact("a", "sa"), *contact("b", "sb"), link("a.displacement", "b.force", 0.01)]
    run = both(parts, links, END, macro_step=3.0)
    assert {name for _, _, name in run.events} == {"a", "b"}
    assert run.importer.repeated_steps > 5


@pytest.mark.parametrize("room", [0, 1, 3])
def test_events_that_pass_are_told_in_the_order_and_numbers_of_those_heard_at_once(room: int) -> None:
    # two mirrored bodies hit at one instant, so that a step has two events
    mirrored = {**P11, "forcing.amplitude": -0.5, **external(-1.0, "lower")}
    parts = [stop("sa"), body("a", {**P11, **external(1.0)}), stop("sb"), body("b", mirrored)]
    run = both(
        parts, [*contact("a", "sa"), *contact("b", "sb")], END, room=lambda seen: room - seen % (room + 1)
    )
    assert [index for _, index, _ in run.events] == [0, 1] * (len(run.events) // 2)
    assert len(run.events) >= 18


def test_a_run_that_begins_again_is_the_same_run() -> None:
    run = Run([body("b", {**P11, **external(1.0)}), stop("s")], contact("b", "s"), in_c=True).go(END)
    first = run.facts()
    run.events = []
    assert run.go(END).facts() == first
    run.importer.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_chatter_sticking_and_release_are_those_of_single_steps(version: str) -> None:
    slow = {
        "damping": 0.1,
        "forcing.amplitude": 1.0,
        "forcing.angular_frequency": 0.2,
        "displacement_start": -0.1,
    }
    parts = [body("b", {**slow, **external(0.0)}, version), stop("s", 0.7, version)]
    run = both(parts, contact("b", "s"), 5.0, 200.0, macro_step=7.0)
    assert len(run.events) > 100


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("scene", [CHAIN, BEAM], ids=str)
def test_structures_with_several_stops_move_as_step_by_step(scene: BodyScene, version: str) -> None:
    low = numbered_stop(-scene.position, side=2, law=EXTERNAL, k=2)
    spec = ComponentSpec("b", fmu_path(scene.component, version), {**scene.coupled, **low})
    parts = [spec, stop("up", 0.7, version), stop("low", 0.6, version)]
    run = both(parts, [*contact("b", "up"), *contact("b", "low", 2)], scene.end, macro_step=scene.end / 7.0)
    assert len(run.events) > 10


@pytest.mark.parametrize("offset", [0.0, -0.25])
def test_values_with_gains_and_of_other_tools_move_as_step_by_step(folder: Path, offset: float) -> None:
    # the ball has no event mode and rests on the ground; the gain has no states; the stepped ball ends early
    parts = [body("b", {**P11, **external(1.0)}), part("ball", fmu_factory.bouncing_ball(folder, "3.0"))]
    parts += [
        part("mass", fmu_factory.mass(folder), k=2.0, x=0.1),
        part("stepped", fmu_factory.stepped_ball(folder)),
    ]
    links = [link("b.displacement", "mass.f", -0.3), link("mass.x", "b.force", 0.1)]
    links[0] = replace(links[0], offset=offset)
    both(parts, links, 7.0, 20.0, macro_step=0.1)


@pytest.mark.parametrize(("fmi", "place", "early"), [("3.0", 0, 0), ("3.0", 2, 1), ("2.0", 1, 0)])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_component_that_misbehaves_is_met_as_step_by_step(
    folder: Path, fault: str, fmi: str, place: int, early: int
) -> None:
    parts = [body("b", {**P11, **external(1.0)}), stop("s")]
    culprit = part("f", fmu_factory.faulty(folder, fmi), fault=fault, fault_time=2.0, says_early=early)
    parts.insert(place, culprit)
    links = [*contact("b", "s"), link("b.displacement", "f.u", 2.0)]
    run = both(parts, links, 4.0, macro_step=0.25)
    assert run.failure or run.importer.time > 1.7


@pytest.mark.parametrize("place", ["get", "set", "save", "restore", "event"])
def test_a_call_that_fails_is_told_as_step_by_step(folder: Path, place: str) -> None:
    # the faults of a process are counted: both runs must make equally many calls, or the second run ends elsewhere
    good, failures = 7, []
    links = [*contact("a", "s"), link("a.displacement", "f.u"), link("f.y", "a.force", 0.01)]
    for in_c, before in ((True, 0), (False, good + 1)):
        numbers = {"fault_after": before + good, "fault": "error", "fault_place": place}
        culprit = part("f", fmu_factory.faulty(folder), **numbers)
        parts = [culprit, body("a", {**P11, **external(1.0)}, "2.0"), stop("s")]
        run = Run(parts, links, in_c=in_c, macro_step=0.5).go(60.0)
        failures.append((run.failure, run.events, run.importer.steps))
        run.importer.free()
    assert failures[0] == failures[1]
    assert f"f: fmi3{CALLS[place]} returned error at time" in failures[0][0]


def test_events_that_never_settle_are_told_as_step_by_step(folder: Path) -> None:
    culprit = part("f", fmu_factory.faulty(folder), fault="endless_events", fault_time=2.0)
    run = both(
        [culprit, body("b", {**P11, **external(1.0)}), stop("s")], contact("b", "s"), 4.0, macro_step=0.25
    )
    assert "f: fmi3UpdateDiscreteStates: expected event iteration to end" in run.failure
