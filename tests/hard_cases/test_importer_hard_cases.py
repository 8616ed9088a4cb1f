"""Events of several components in one step, at one instant, at the ends of a run, and of FMUs without events."""

import math
import runpy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.coupled_parts import (
    EXCHANGES,
    P11,
    VERSIONS,
    Impact,
    ImpactLog,
    body,
    bounce_times,
    contact,
    events_of,
    external,
    largest_difference,
    link,
    part,
    stop,
    values,
)
from support.tolerance import PARTITION, SEQUENCE

from vibroimpact.fmus.core import Oscillator, flow, next_contact
from vibroimpact.orchestrator.importer.component import Value
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.sampling import Sampler
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec

BOUNCE = 1e-10
"""Largest error of the bounce times of a black box, s."""
MIXED = [("3.0", "3.0"), ("2.0", "2.0"), ("3.0", "2.0"), ("2.0", "3.0")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def ball(folder: Path) -> Path:
    return fmu_factory.bouncing_ball(folder)


# ---- several bodies with stops ----

#: Incommensurate periodic motions, whose events come in changing orders.
BODIES: list[dict[str, Value]] = [
    {**P11, **external(1.0)},
    {"damping": 0.1, "forcing.amplitude": 0.5, "forcing.angular_frequency": 0.85, **external(1.0)},
    {"damping": 0.2, "forcing.amplitude": -0.7, "forcing.angular_frequency": 1.13, **external(-0.5, "lower")},
]


def scene(
    bodies: list[dict[str, Value]], versions: list[str]
) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return bodies b0, b1, ... with one stop each."""
    parts, links = [], []
    for i, (parameters, version) in enumerate(zip(bodies, versions, strict=True)):
        parts += [body(f"b{i}", parameters, version), stop(f"s{i}", 0.7, version)]
        links += contact(f"b{i}", f"s{i}")
    return parts, links


def impacts(
    bodies: list[dict[str, Value]], versions: list[str], macro_step: float, exchange: str, end: float
) -> tuple[list[list[Impact]], list[Event], int]:
    parts, links = scene(bodies, versions)
    importer = Importer(parts, links, macro_step=macro_step, exchange=exchange)  # type: ignore[arg-type]
    logs = [ImpactLog(importer, f"b{i}") for i in range(len(bodies))]
    events = events_of(importer)
    importer.begin()
    importer.advance(end)
    found = [log.take() for log in logs], events, importer.repeated_steps
    importer.free()
    return found


@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("macro_step", [0.11, 3.0, 1e3])
@pytest.mark.parametrize("versions", [["3.0"] * 3, ["2.0"] * 3, ["2.0", "3.0", "2.0"]], ids="+".join)
def test_the_earliest_event_of_a_step_wins_and_the_others_are_met_later(
    versions: list[str], macro_step: float, exchange: str
) -> None:
    together, events, repeated = impacts(BODIES, versions, macro_step, exchange, 150.0)
    times = [event.time for event in events]
    assert times == sorted(times)
    assert repeated > 10
    for i, parameters in enumerate(BODIES):
        (alone,), _, _ = impacts([parameters], [versions[i]], math.inf, "gauss_seidel", 150.0)
        assert len(alone) == len(together[i]) > 10
        # each event of the others is one more communication point
        assert largest_difference(alone, together[i]) <= PARTITION


@pytest.mark.parametrize("macro_step", [0.11, 1e3])
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_events_of_two_bodies_at_one_instant_are_both_resolved(
    versions: tuple[str, str], macro_step: float
) -> None:
    # the same motion twice, one of them mirrored: every contact happens in both at once
    mirrored = {**P11, "forcing.amplitude": -0.5, **external(-1.0, "lower")}
    (one, other), events, _ = impacts(
        [BODIES[0], mirrored], list(versions), macro_step, "gauss_seidel", 100.0
    )
    assert len(one) == len(other) == 15
    assert largest_difference(one, other) <= SEQUENCE
    assert len(events) == 30
    for first, second in zip(events[::2], events[1::2], strict=True):
        assert {first.component, second.component} == {"b0", "b1"}
        assert (first.index, second.index) == (0, 1)
        assert first.time == second.time


@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_both_stops_of_one_body_answer_their_own_contact(versions: tuple[str, str]) -> None:
    # a free mass between walls 0 and 1 with restitution .5 and .25: its speed shows which wall answered
    parameters = {
        "stiffness": 0.0,
        "displacement_start": 0.5,
        "velocity_start": 1.0,
        **external(1.0),
        **external(0.0, "lower", k=2),
    }
    importer = Importer(
        [stop("low", 0.25, versions[1]), body("b", parameters, versions[0]), stop("high", 0.5, versions[1])],
        [*contact("b", "high", 1), *contact("b", "low", 2)],
        macro_step=0.3,
    )
    events = events_of(importer)
    importer.begin()
    speed, time, expected = 1.0, 0.5, []
    for i in range(6):
        expected.append(time)
        speed *= 0.25 if i % 2 else 0.5
        time += 1.0 / speed
    importer.advance(expected[-1] + 0.5)
    assert [event.time for event in events] == pytest.approx(expected, rel=SEQUENCE)
    assert abs(values(importer, "b", "velocity")[0]) == pytest.approx(speed, rel=SEQUENCE)
    importer.free()


@pytest.mark.parametrize("stop_first", [False, True])
@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_a_stop_is_asked_about_the_contact_and_not_about_the_step_before(
    versions: tuple[str, str], exchange: str, stop_first: bool
) -> None:
    parts = [body("b", {**P11, **external(1.0)}, versions[0]), stop("s", 0.7, versions[1])]
    importer = Importer(
        parts[::-1] if stop_first else parts,
        contact("b", "s"),
        macro_step=0.1,
        exchange=exchange,  # type: ignore[arg-type]
    )
    log = ImpactLog(importer, "b")
    stop_velocities: list[float] = []
    importer.on_event = lambda event: stop_velocities.append(values(importer, "s", "velocity")[0])
    importer.begin()
    importer.advance(60.0)
    if versions[0] == "2.0":
        # its own event ends the step, so the stop has stepped to it; a body of FMI 3.0 asks later, in event mode
        assert stop_velocities == [impact.velocity for impact in log.take()]
    assert len(log.take()) == len(stop_velocities) == 9
    assert (
        largest_difference(log.take(), impacts([BODIES[0]], ["3.0"], math.inf, "gauss_seidel", 60.0)[0][0])
        <= SEQUENCE
    )
    importer.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("macro_step", [0.2, 0.05])
def test_bodies_with_stops_and_a_spring_between_them_meet_events_that_the_iteration_moves(
    version: str, macro_step: float
) -> None:
    # iterated inputs over a step move the contact; the reference has ever finer steps
    def first_impacts(step: float) -> list[float]:
        soft = {"stiffness": 1.1, "damping": 0.02}
        importer = Importer(
            [
                body("a", {**soft, "displacement_start": 1.0}, version),
                body("b", {**soft, **external(0.3)}, version),
                stop("s", 0.7, version),
            ],
            [
                link("a.displacement", "b.force", 0.1),
                link("b.displacement", "a.force", 0.1),
                *contact("b", "s"),
            ],
            macro_step=step,
            exchange="iterated",
        )
        events = events_of(importer)
        importer.begin()
        importer.advance(25.0)
        importer.free()
        return [event.time for event in events]

    fine, coarse, half = (first_impacts(step) for step in (0.0125, macro_step, macro_step / 2))
    assert len(fine) == len(coarse) == len(half) > 2
    errors = [abs(np.array(found) - np.array(fine)).max() for found in (coarse, half)]
    assert errors[0] <= 0.5 * macro_step**2
    assert errors[1] <= 0.5 * errors[0]


# ---- the first and the last instant ----


@pytest.mark.parametrize("others", [0, 1, 2])
@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_a_contact_at_the_first_instant_is_resolved_there(
    versions: tuple[str, str], exchange: str, others: int
) -> None:
    start = {**P11, **external(1.0), "displacement_start": 1.0, "velocity_start": 0.5}
    parts = [body("b", start, versions[0]), stop("s", 0.7, versions[1])]
    bystander = {"displacement_start": 0.5}
    if others:  # it steps before the body
        parts.insert(0, body("before", bystander, versions[0]))
    if others > 1:  # a second body that meets its stop at once
        parts += [body("b2", start, versions[0]), stop("s2", 0.7, versions[1])]
    links = contact("b", "s") + (contact("b2", "s2") if others > 1 else [])
    importer = Importer(parts, links, macro_step=0.5, exchange=exchange)  # type: ignore[arg-type]
    events = events_of(importer)
    importer.begin()
    importer.advance(1.0)
    assert [event.time for event in events] == [0.0] * (2 if others > 1 else 1)
    assert values(importer, "b", "contact[1].last_time", "contact[1].last_velocity") == [0.0, 0.5]
    exact = flow(Oscillator(1.0, 0.2, 1.0, 0.5, 1.0), (1.0, -0.35), 1.0)
    assert values(importer, "b", "displacement", "velocity") == pytest.approx(exact, abs=SEQUENCE)
    if others:
        x, v = values(importer, "before", "displacement", "velocity")
        assert (x, v) == pytest.approx((0.5 * math.cos(1.0), -0.5 * math.sin(1.0)), abs=SEQUENCE)
    importer.free()


@pytest.mark.parametrize("versions", MIXED, ids="+".join)
def test_a_contact_around_the_last_instant_is_met_once(versions: tuple[str, str]) -> None:
    parts = [
        body("b", {**P11, **external(1.0), "velocity_start": 1.0}, versions[0]),
        stop("s", 0.7, versions[1]),
    ]
    importer = Importer(parts, contact("b", "s"))
    events = events_of(importer)
    importer.begin()
    importer.advance(3.0)
    ((instant, _, _),) = [(e.time, e.index, e.component) for e in events]
    reference = values(importer, "b", "displacement", "velocity")
    for offset in (-1e-9, -1e-12, -3e-14, -1e-15, 0.0, 1e-15, 3e-14, 1e-12, 1e-9):
        events.clear()
        importer.begin()
        importer.advance(instant + offset)
        met = len(events)
        assert met == 1 or offset < -1e-14
        importer.advance(3.0)
        assert len(events) == 1
        assert values(importer, "b", "displacement", "velocity") == pytest.approx(reference, abs=SEQUENCE)
    importer.free()


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("macro_step", [1e-3, 0.02, 7.0, 1e4])
def test_chatter_and_sticking_do_not_depend_on_the_macro_step(version: str, macro_step: float) -> None:
    slow = {
        "damping": 0.1,
        "forcing.amplitude": 1.0,
        "forcing.angular_frequency": 0.2,
        "displacement_start": -0.1,
    }
    importer = Importer(
        [body("b", {**slow, **external(0.0)}, version), stop("s", 0.7, version)],
        contact("b", "s"),
        macro_step=macro_step,
    )
    importer.begin()
    importer.advance(5.0)
    assert importer.components["b"].group("Boolean", ["contact[1].stuck"]).get()[0]
    assert values(importer, "b", "displacement", "velocity") == [0.0, 0.0]
    start = values(importer, "b", "contact[1].stick_start")[0]
    importer.advance(9.0)
    (end,) = values(importer, "b", "contact[1].stick_end")
    assert end == pytest.approx(math.pi / 0.4, abs=SEQUENCE)  # the force changes its sign there
    # the same chatter in one FMU
    own: dict[str, Value] = {"contact[1].law": "restitution", "contact[1].restitution": 0.7}
    fused = Importer([body("b", {**slow, **external(0.0), **own})])
    fused.begin()
    fused.advance(5.0)
    assert start == pytest.approx(values(fused, "b", "contact[1].stick_start")[0], abs=SEQUENCE)
    fused.free()
    importer.free()


# ---- a black-box ball beside a body ----


def test_two_watches_of_two_balls_and_a_body_keep_their_order(ball: Path) -> None:
    importer = Importer(
        [
            part("low", ball, e=0.8),
            part("high", ball, h=3.0),
            body("b", {**P11, **external(1.0)}),
            stop("s"),
        ],
        contact("b", "s"),
        [EventSpec("low", "h"), EventSpec("high", "h")],
        macro_step=0.7,
    )
    log = ImpactLog(importer, "b")
    events = events_of(importer)
    importer.begin()
    importer.advance(3.0)
    times = {name: np.array([e.time for e in events if e.component == name]) for name in ("low", "high", "b")}
    assert np.abs(times["low"] - bounce_times(len(times["low"]), 0.8)).max() <= BOUNCE
    assert np.abs(times["high"] - bounce_times(len(times["high"]), height=3.0)).max() <= BOUNCE
    assert len(times["low"]) > 5
    assert len(times["high"]) == 3
    alone = impacts([BODIES[0]], ["3.0"], math.inf, "gauss_seidel", 3.0)[0][0]
    assert len(alone) == len(log.take())
    importer.free()


# ---- sampling ----


@pytest.mark.parametrize("rate", [0.7, 11.0, 200.0])
@pytest.mark.parametrize("version", VERSIONS)
def test_samples_do_not_disturb_the_run(folder: Path, ball: Path, version: str, rate: float) -> None:
    recorded = [
        ("b0", "displacement"),
        ("ball", "h"),
        ("gain", "y"),
        ("b1", "contact[1].count"),
        ("s0", "velocity"),
    ]

    def run(sampled: bool) -> tuple[list[Event], list[float], int, Sampler | None]:
        parts, links = scene(BODIES, [version] * 3)
        importer = Importer(
            [*parts, part("ball", ball), part("gain", fmu_factory.gain(folder), k=2.0)],
            [*links, link("b0.displacement", "gain.u")],
            [EventSpec("ball", "h")],
            macro_step=0.17,
        )
        events = events_of(importer)
        sampler = Sampler(importer, recorded, rate) if sampled else None
        importer.begin()
        importer.advance(1.7)
        if sampler is not None:
            sampler.begin(1.7, 20.0)
        importer.advance(20.0)
        ends = [v for i in range(3) for v in values(importer, f"b{i}", "displacement", "velocity")]
        ends += values(importer, "ball", "h", "v")
        steps = importer.steps
        importer.free()
        return events, ends, steps, sampler

    plain, watched = run(False), run(True)
    assert plain[:3] == watched[:3]  # bit for bit
    assert watched[3] is not None
    rows = np.array(watched[3].rows)
    assert rows[:, 0] == pytest.approx(1.7 + np.arange(len(rows)) / rate, abs=1e-12)
    assert len(rows) == math.floor((20.0 - 1.7) * rate * (1.0 + 1e-12)) + 1


def test_samples_inside_a_step_are_those_of_the_exact_motion() -> None:
    importer = Importer([body("a", {"displacement_start": 1.0})], macro_step=5.0)
    sampler = Sampler(importer, [("a", "displacement"), ("a", "velocity")], 7.0)
    importer.begin()
    sampler.begin(0.0, 30.0)
    importer.advance(30.0)
    rows = np.array(sampler.rows)
    assert np.abs(rows[:, 1] - np.cos(rows[:, 0])).max() <= SEQUENCE
    assert np.abs(rows[:, 2] + np.sin(rows[:, 0])).max() <= SEQUENCE
    importer.free()


# ---- a user's contact law ----

LAW = """\
def contact_law(displacement, velocity):
    return 0.9 / (1.0 + 0.4 * velocity ** 0.8)
"""


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("macro_step", [0.1, 1e3])
@pytest.mark.parametrize("first", ["body", "law"])
def test_a_law_in_python_gives_the_impacts_of_the_same_law_in_the_exact_flow(
    tmp_path: Path, version: str, macro_step: float, first: str
) -> None:
    pytest.importorskip("pythonfmu")
    from vibroimpact.fmus.packaging.python_fmus import build_user_contact_law

    (tmp_path / "law.py").write_text(LAW, encoding="utf-8")
    law: Callable[[float, float], float] = runpy.run_path(str(tmp_path / "law.py"))["contact_law"]
    fmu = build_user_contact_law(tmp_path / "law.py", tmp_path / "law.fmu")
    parts = [body("b", {**P11, **external(1.0)}, version), part("law", fmu)]
    importer = Importer(parts if first == "body" else parts[::-1], contact("b", "law"), macro_step=macro_step)
    log = ImpactLog(importer, "b")
    importer.begin()
    importer.advance(200.0)
    found = log.take()
    importer.free()
    expected = reference_impacts(law, 200.0)
    assert len(found) == len(expected) >= 30
    errors = np.abs(np.array([[i.time, i.velocity] for i in found]) - np.array(expected))
    assert errors[:, 0].max() <= SEQUENCE * 200.0
    assert errors[:, 1].max() <= SEQUENCE


def reference_impacts(law: Callable[[float, float], float], end: float) -> list[tuple[float, float]]:
    """Return times and velocities of the impacts by the core's exact flow and contact search alone."""
    o, state, times = Oscillator(1.0, 0.2, 1.0, 0.5, 1.0), (0.0, 0.0), [0.0]
    found: list[tuple[float, float]] = []
    while True:
        time = math.fsum(times)
        met = next_contact(o, state, 1.0, end - time, phase=math.remainder(time, 2.0 * math.pi))
        if met is None:
            return found
        times.append(met.time)
        found.append((math.fsum(times), met.velocity))
        state = (1.0, -law(1.0, met.velocity) * met.velocity)
