"""Chosen communication steps where FMUs and motions are hard: jumps, chatter, loops, missing states, chaos."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import pytest
from support import fmu_factory
from support.coupled_parts import body, contact, events_of, external, link, part, stop, values

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.events import StepWatcher
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


def oscillator(name: str, **parameters: float) -> ComponentSpec:
    return body(name, {"mass": 1.0, "stiffness": 1.0, **parameters})


def chosen(
    parts: Sequence[ComponentSpec],
    links: Sequence[ConnectionSpec],
    events: Sequence[EventSpec] = (),
    tolerance: float = 1e-4,
    exchange: str = "gauss_seidel",
) -> Importer:
    importer = Importer(
        parts,
        links,
        events,
        exchange=exchange,  # type: ignore[arg-type]  # a parameter of tests
        macro_step="auto",
        coupling_tolerance=tolerance,
    )
    assert importer.adaptive is not None
    return importer


def test_a_watched_event_is_located_within_a_chosen_step(folder: Path) -> None:
    ball = part("ball", fmu_factory.bouncing_ball(folder))
    importer = chosen(
        [ball, oscillator("b", displacement_start=1.0)],
        [link("ball.v", "b.force", 0.1)],
        [EventSpec("ball", "v", "rising")],
    )
    events = events_of(importer)
    importer.begin()
    importer.advance(0.6)
    assert events[0].time == pytest.approx(math.sqrt(2.0 / 9.81), abs=1e-9)
    importer.free()


def test_chatter_beside_a_coupled_body_needs_few_steps() -> None:
    driven = {"damping": 0.2, "forcing.amplitude": 1.0, "forcing.angular_frequency": 0.2, **external(0.2)}
    parts = [body("b", driven), stop("s", 0.5), oscillator("c", displacement_start=1.0)]
    links = [
        *contact("b", "s"),
        link("b.displacement", "c.force", 0.1),
        link("c.displacement", "b.force", 0.05),
    ]
    importer = chosen(parts, links, tolerance=1e-3)
    events = events_of(importer)
    importer.begin()
    importer.advance(12.0)
    assert len(events) > 10
    assert importer.steps < 1000
    importer.free()


@pytest.mark.parametrize("fault", [1, 3, 12])
def test_a_fault_in_a_step_is_the_fault_of_its_component(folder: Path, fault: int) -> None:
    faulty = part("f", fmu_factory.faulty(folder), fault=fault, fault_time=0.5)
    importer = chosen(
        [faulty, oscillator("b", displacement_start=1.0)],
        [link("b.displacement", "f.u"), link("f.y", "b.force")],
        tolerance=1e-2,
    )
    importer.begin()
    with pytest.raises(ComponentError, match=r"f: fmi3DoStep"):
        importer.advance(1.0)
    importer.free()


def test_a_component_ends_the_run_within_a_step_on_trial(folder: Path) -> None:
    ending = part("f", fmu_factory.faulty(folder), fault=11, fault_time=0.5)
    importer = chosen(
        [ending, oscillator("b", displacement_start=1.0)],
        [link("b.displacement", "f.u"), link("f.y", "b.force")],
        tolerance=1e-2,
    )
    importer.begin()
    importer.advance(1.0)
    assert importer.wants_to_end
    assert 0.5 <= importer.time < 0.6
    importer.free()


def test_a_loop_is_consistent_at_the_ends_of_chosen_steps(folder: Path) -> None:
    # y = u / 2 + w of two components in a circle, driven by a body
    through = fmu_factory.feedthrough(folder)
    parts = [
        part("f", through, k=0.5, l=1.0),
        part("g", through, k=0.5),
        oscillator("b", displacement_start=1.0),
    ]
    links = [
        link("f.y", "g.u"),
        link("g.y", "f.u"),
        link("b.displacement", "f.w"),
        link("f.y", "b.force", -0.75),
    ]
    importer = chosen(parts, links)
    importer.begin()
    importer.advance(1.0)
    # y = x / (1 - 1/4), so that the force is -x
    assert values(importer, "b", "displacement")[0] == pytest.approx(math.cos(math.sqrt(2.0)), abs=5e-3)
    assert importer.loops.residual <= 1e-12
    importer.free()


def test_components_without_states_are_never_taken_back(folder: Path) -> None:
    stateless = fmu_factory.mass(folder, states=False)
    parts = [part("m", stateless, m=1.0, k=1.0, load=1.0), part("n", stateless, m=1.0, k=1.0)]
    importer = chosen(parts, [link("m.x", "n.f", 0.1), link("n.x", "m.f", 0.1)], tolerance=1e-3)
    importer.begin()
    importer.advance(1.2)
    assert importer.adaptive is not None
    assert importer.adaptive.record.rejected == 0
    # symmetric and antisymmetric motion: (1 - cos(w t)) / (2 w^2) with w^2 = .9 and 1.1
    slow, fast = ((1.0 - math.cos(math.sqrt(w) * 1.2)) / (2.0 * w) for w in (0.9, 1.1))
    assert values(importer, "n", "x")[0] == pytest.approx(slow - fast, abs=3e-4)
    importer.free()


def test_model_exchange_is_taken_back_too() -> None:
    parts = [
        ComponentSpec(c.name, c.fmu, c.parameters, tolerance=1e-9, run_as="model_exchange")
        for c in (oscillator("a", displacement_start=1.0), oscillator("b"))
    ]
    importer = chosen(parts, [link("b.displacement", "a.force", 0.1), link("a.displacement", "b.force", 0.1)])
    importer.begin()
    importer.advance(2.0)
    slow, fast = math.sqrt(0.9), math.sqrt(1.1)
    exact = 0.5 * (math.cos(2.0 * slow) + math.cos(2.0 * fast))
    assert importer.adaptive is not None
    assert abs(values(importer, "a", "displacement")[0] - exact) < importer.adaptive.record.error
    importer.free()


# ---- steps that an FMU discards ----

#: Schemes of the mass that discard steps above its `inner_step`: with a last successful time, and with a false one.
DISCARDS, DISCARDS_MUTE = 6, 7


def beside(spec: ComponentSpec, source: str, target: str) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return a component with unit mass and stiffness beside a body that it moves, and that moves it."""
    links = [
        link(f"{spec.name}.{source}", "b.force", 0.1),
        link("b.displacement", f"{spec.name}.{target}", 0.1),
    ]
    return [spec, oscillator("b", displacement_start=1.0)], links


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("exchange", ["gauss_seidel", "iterated"])
def test_inputs_without_slopes_have_an_error_of_second_order(
    folder: Path, exchange: str, tolerance: float
) -> None:
    masses = [part(name, fmu_factory.mass(folder), m=1.0, k=1.0, x=x) for name, x in (("a", 1.0), ("b", 0.0))]
    importer = chosen(
        masses, [link("a.x", "b.f", -0.1), link("b.x", "a.f", -0.1)], tolerance=tolerance, exchange=exchange
    )
    importer.begin()
    importer.advance(4.0)
    slow, fast = math.sqrt(0.9), math.sqrt(1.1)
    error = abs(values(importer, "a", "x")[0] - 0.5 * (math.cos(4.0 * slow) + math.cos(4.0 * fast)))
    assert importer.adaptive is not None
    assert importer.adaptive.order == 2
    assert error < 0.8 * importer.adaptive.record.error
    importer.free()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("scheme", [DISCARDS, DISCARDS_MUTE])
@pytest.mark.parametrize("exchange", ["gauss_seidel", "iterated"])
def test_a_discarded_step_is_taken_back_and_made_shorter(
    folder: Path, fmi: str, scheme: int, exchange: str
) -> None:
    longest = 0.013
    discarding = part("m", fmu_factory.mass(folder, fmi), m=1.0, k=1.0, scheme=scheme, inner_step=longest)
    parts, links = beside(discarding, "x", "f")
    importer = chosen(parts, links, tolerance=1e-2, exchange=exchange)
    sizes: list[float] = []
    importer.watchers.append(StepWatcher(lambda time: None, lambda time, end: sizes.append(end - time)))
    importer.begin()
    importer.advance(2.0)
    slow, fast = math.sqrt(0.9), math.sqrt(1.1)
    exact = 0.5 * (math.cos(2.0 * slow) - math.cos(2.0 * fast))
    assert importer.adaptive is not None
    record = importer.adaptive.record
    assert values(importer, "m", "x")[0] == pytest.approx(exact, abs=1e-3)
    assert 0.4 * longest < max(sizes) <= longest
    # a size that is known to be discarded is not tried at each step
    assert 0 < record.rejected < 0.2 * record.steps
    importer.free()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_step_that_ends_before_its_end_is_followed(folder: Path, fmi: str) -> None:
    # FMI 3.0 returns early after .1 s; FMI 2.0 discards and says so
    short = part("f", fmu_factory.faulty(folder, fmi), fault=33, fault_time=0.5)
    importer = chosen(
        [short, oscillator("b", displacement_start=1.0)],
        [link("b.displacement", "f.u"), link("f.y", "b.force", -0.5)],
        tolerance=0.05,
    )
    sizes: list[float] = []
    importer.watchers.append(StepWatcher(lambda time: None, lambda time, end: sizes.append(end - time)))
    importer.begin()
    importer.advance(3.0)
    assert importer.time == 3.0
    assert 0.09 < max(sizes[len(sizes) // 2 :]) < 0.1 + 1e-9
    importer.free()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_fmu_that_discards_every_step_is_named_with_the_instant(folder: Path, fmi: str) -> None:
    discarding = part("f", fmu_factory.faulty(folder, fmi), fault=3, fault_time=0.5)
    importer = chosen(*beside(discarding, "y", "u"), tolerance=1e-2)
    importer.begin()
    expected = (
        rf"f: fmi{fmi[0]}DoStep: expected a step of 1e-10 s, .* of the run, got a discard at time 0\.[45]"
    )
    with pytest.raises(ComponentError, match=expected) as error:
        importer.advance(1.0)
    assert error.value.instance == "f"
    assert error.value.time == pytest.approx(0.5, abs=1e-6)
    importer.free()


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_discard_without_states_is_refused_by_the_flag(folder: Path, fmi: str) -> None:
    stateless = fmu_factory.mass(folder, fmi, states=False)
    importer = chosen(
        *beside(part("m", stateless, scheme=DISCARDS, inner_step=1e-3), "x", "f"), tolerance=1e-2
    )
    importer.begin()
    with pytest.raises(
        ComponentError, match=r"m: fmi.DoStep: expected .* without states \(canGetAndSet.*time 0\.0"
    ):
        importer.advance(1.0)
    importer.free()


# ---- impacts and chaos ----


def test_an_impact_just_after_the_start_of_a_step_ends_it(folder: Path) -> None:
    # a step ends 1e-13 s before the impact: halves of the next one meet it in the first half
    parts = [
        stop("s", 0.7),
        oscillator("b", stiffness=20.429066562504765, displacement_start=-0.3129482693927197),
        oscillator("a", velocity_start=0.8645727438786404, **external(0.3)),
    ]
    links = [
        *contact("a", "s"),
        link("b.displacement", "a.force", 0.21218296064725167),
        link("a.displacement", "b.force", -0.15734607939644005),
    ]
    for in_c in (True, False):
        importer = chosen(parts, links, tolerance=0.002797543140367294)
        importer.steps_in_c = in_c
        events = events_of(importer)
        importer.begin()
        importer.advance(1.0)
        assert [event.time for event in events] == pytest.approx([0.358209570124])
        importer.free()


def test_chaos_multiplies_errors_that_the_estimate_has_counted_once() -> None:
    # the estimate bounds the error of the first impacts; later two tolerances give two motions, which it does not tell
    hit = {
        "stiffness": 1.094,
        "damping": 0.099,
        "forcing.amplitude": 1.695,
        "forcing.angular_frequency": 2.605,
    }
    parts = [
        oscillator("a", **hit, **external(0.252)),
        stop("s", 0.818),
        oscillator("b", stiffness=2.764, damping=0.1),
    ]
    links = [
        *contact("a", "s"),
        link("a.displacement", "b.force", 0.241),
        link("b.displacement", "a.force", 0.241),
    ]
    times, found, sums = (5.0, 20.0, 40.0), [], []
    for tolerance in (1e-3, 1e-4):
        importer = chosen(parts, links, tolerance=tolerance)
        importer.begin()
        assert importer.adaptive is not None
        for time in times:
            importer.advance(time)
            found.append(values(importer, "a", "displacement")[0])
            sums.append(importer.adaptive.record.error)
        importer.free()
    off = [abs(one - other) for one, other in zip(found[:3], found[3:], strict=True)]
    assert off[0] < sums[0] + sums[3]
    assert max(off[1:]) > 50.0 * off[0]
    assert sums[2] < 3.0 * sums[0]
