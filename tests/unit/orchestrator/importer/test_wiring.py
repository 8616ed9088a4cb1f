"""Values move in the order of direct feedthrough, loops are named and solved, starts are carried over connections."""

import ctypes
import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.coupled_parts import EXCHANGES, body, link, part, values
from support.tolerance import ROUNDING

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.fmi.library import Function
from vibroimpact.orchestrator.importer.component import Component, Value
from vibroimpact.orchestrator.importer.energy import InterfaceEnergy
from vibroimpact.orchestrator.importer.feedthrough import order_of
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec, EventSpec
from vibroimpact.orchestrator.importer.wiring import equal_values, transfers_of

LOOP = 1e-9
"""Solution of a loop: its residual, 1e-12 relative, over the distance of its gain from 1."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module")
def gain(folder: Path) -> Path:
    return fmu_factory.gain(folder)


@pytest.fixture(scope="module")
def ball(folder: Path) -> Path:
    return fmu_factory.bouncing_ball(folder)


@pytest.fixture
def made() -> Iterator[list[Importer]]:
    importers: list[Importer] = []
    yield importers
    for importer in importers:
        importer.free()


def begun(made: list[Importer], specs: Sequence[ComponentSpec], *rest, **options) -> Importer:  # type: ignore[no-untyped-def]
    made.append(Importer(specs, *rest, **options))
    made[-1].begin()
    return made[-1]


def circle(
    gain: Path, factors: Sequence[float], offset: float = 1.0
) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return gains y = k u + offset in a circle."""
    names = [f"g{i}" for i in range(len(factors))]
    parts = [part(name, gain, k=k, b=offset) for name, k in zip(names, factors, strict=True)]
    return parts, [link(f"{a}.y", f"{b}.u") for a, b in zip(names, names[1:] + names[:1], strict=True)]


def exact_circle(factors: Sequence[float], offset: float = 1.0) -> list[float]:
    """Return the outputs of the circle, by elimination."""
    k, b = 1.0, 0.0
    for factor in factors:
        k, b = factor * k, factor * b + offset
    outputs = []
    u = b / (1.0 - k)
    for factor in factors:
        u = factor * u + offset
        outputs.append(u)
    return outputs


# ---- order ----


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_a_chain_of_direct_feedthrough_is_up_to_date_however_it_is_declared(
    made: list[Importer], gain: Path, exchange: str
) -> None:
    parts = [body("source", {"displacement_start": 1.0})]
    parts += [part(name, gain, k=2.0) for name in ("g1", "g2", "g3")]
    links = [link("g2.y", "g3.u"), link("source.displacement", "g1.u"), link("g1.y", "g2.u")]
    for order in itertools.permutations(range(4)):
        importer = begun(made, [parts[i] for i in order], links, exchange=exchange, macro_step=0.3)
        for k in range(5):
            importer.advance(0.3 * k)
            (x,), (y,) = values(importer, "source", "displacement"), values(importer, "g3", "y")
            assert y == 8.0 * x, order
        assert abs(x - math.cos(1.2)) <= ROUNDING


def test_connections_are_moved_after_those_that_they_depend_on(folder: Path, gain: Path) -> None:
    parts = {name: Component(part(name, gain)) for name in ("a", "b", "c")}
    links = [link("c.y", "a.u"), link("b.y", "c.u")]
    order = order_of(links, parts)
    assert order.connections == (links[1], links[0])
    assert order.loops == ()
    for component in parts.values():
        component.free()


def test_an_output_without_a_list_is_moved_after_all_inputs_of_its_component(
    folder: Path, gain: Path
) -> None:
    unlisted = fmu_factory.redescribed(
        gain, folder / "unlisted.fmu", ('index="2" dependencies="1"/>', 'index="2"/>')
    )
    parts = {name: Component(part(name, unlisted)) for name in ("a", "b", "c")}
    links = [link("c.y", "a.u"), link("b.y", "c.u")]
    assert order_of(links, parts).connections == (links[1], links[0])
    # a circle has no such order: the importer measures it, and solves it if it is a loop
    circle = [*links, link("a.y", "b.u")]
    order = order_of(circle, parts)
    assert (order.loops, order.unlisted) == ((), ())
    for component in parts.values():
        component.free()


def test_an_output_without_a_list_is_no_part_of_a_transfer_before_an_input(folder: Path, gain: Path) -> None:
    lists = 'index="3" dependencies="1 2"', 'index="3"'
    source = fmu_factory.redescribed(fmu_factory.feedthrough(folder, "2.0"), folder / "half.fmu", lists)
    parts = {name: Component(part(name, source)) for name in "ab"} | {"c": Component(part("c", gain))}
    links = [link("a.latched", "b.u"), link("a.y", "b.w"), link("c.y", "a.u")]
    moved = [t.connections for t in transfers_of(order_of(links, parts), parts)]
    assert moved.index((links[2],)) < moved.index((links[1],))
    for component in parts.values():
        component.free()


def test_connections_between_the_same_two_components_are_one_transfer() -> None:
    parts = {name: Component(body(name, {})) for name in ("a", "b")}
    links = [link("a.displacement", "b.force"), link("a.velocity", "b.base_acceleration")]
    (transfer,) = transfers_of(order_of(links, parts), parts)
    assert transfer.connections == tuple(links)
    for component in parts.values():
        component.free()


def test_components_are_instantiated_in_the_order_of_the_scene(
    made: list[Importer], gain: Path, ball: Path
) -> None:
    seen: list[str] = []

    def wrap(name: str) -> Wrapper:
        def wrapper(function: str, call: Function) -> Function:
            if function.endswith(("Instantiate", "InstantiateCoSimulation")):
                seen.append(name)
            return call

        return wrapper

    parts = [part("z", gain), body("m", {}), part("a", ball), body("b", {}, "2.0")]
    for _ in range(3):
        begun(made, parts, wrap=wrap)
    assert seen == ["z", "m", "a", "b"] * 3


# ---- loops ----


@pytest.mark.parametrize(
    "factors",
    [
        (0.5,), (-0.5,), (0.9,), (-0.99,), (0.999,), (-1.0,), (-3.0,), (2.0,), (1000.0,),
        (0.5, 0.5), (0.9, -0.9), (-3.0, 1.0), (1.0, -1.0), (-3.0, 3.0),
        (-1.5, -1.5, -1.5), (2.0, -1.0, 2.0), (-3.0, 1.0, 1.0, 1.0), (0.0, 5.0),
    ],
)  # fmt: skip
def test_an_algebraic_loop_is_solved_whatever_its_gain(
    made: list[Importer], gain: Path, factors: tuple[float, ...]
) -> None:
    importer = begun(made, *circle(gain, factors), macro_step=0.1)
    importer.advance(0.5)
    found = [values(importer, f"g{i}", "y")[0] for i in range(len(factors))]
    assert found == pytest.approx(exact_circle(factors), rel=LOOP, abs=LOOP)
    assert importer.loops.residual <= 1e-12


@pytest.mark.parametrize("factors", [(1.0,), (1.0, 1.0), (2.0, 0.5)])
def test_a_loop_without_a_solution_is_an_error_that_names_it(
    made: list[Importer], gain: Path, factors: tuple[float, ...]
) -> None:
    with pytest.raises(ComponentError, match=r"algebraic loop .*g0\.y -> .*\.u.*residual") as failure:
        begun(made, *circle(gain, factors), macro_step=0.1)
    for i in range(len(factors)):
        assert f"g{i}.y" in str(failure.value)


def test_a_loop_that_any_value_solves_is_left_as_it_is(made: list[Importer], gain: Path) -> None:
    importer = begun(made, *circle(gain, (1.0,), 0.0), macro_step=0.1)
    importer.advance(0.3)
    assert values(importer, "g0", "y") == [0.0]


def test_two_separate_loops_are_told_apart(made: list[Importer], gain: Path) -> None:
    parts, links = circle(gain, (0.5, -0.5))
    parts.append(part("alone", gain, k=0.25, b=3.0))
    importer = begun(made, parts, [*links, link("alone.y", "alone.u")], macro_step=0.1)
    assert sorted(importer.loops.names) == ["alone.y -> alone.u", "g0.y -> g1.u , g1.y -> g0.u"]
    assert values(importer, "alone", "y")[0] == pytest.approx(4.0, rel=LOOP)


@pytest.mark.parametrize("version", ["3.0", "2.0"])
@pytest.mark.parametrize("gain_factor", [0.5, -0.5, -3.0])
def test_a_mass_added_through_a_loop_slows_an_oscillator(
    made: list[Importer], gain: Path, version: str, gain_factor: float
) -> None:
    # force = k acceleration: the mass is 1 - k. Components behind the loop see its solution, not a guess
    errors = []
    for macro_step in (0.02, 0.01):
        importer = begun(
            made,
            [
                part("after", gain),
                body("a", {"displacement_start": 1.0}, version),
                part("g", gain, k=gain_factor),
            ],
            [link("g.y", "after.u"), link("a.acceleration", "g.u"), link("g.y", "a.force")],
            macro_step=macro_step,
        )
        importer.advance(1.0)
        assert values(importer, "after", "y") == values(importer, "g", "y")
        (x,) = values(importer, "a", "displacement")
        errors.append(abs(x - math.cos(1.0 / math.sqrt(1.0 - gain_factor))))
    assert errors[1] < 0.6 * errors[0] < 0.01


def test_the_gain_of_a_connection_in_a_loop_can_be_changed(made: list[Importer], gain: Path) -> None:
    loop = link("g.y", "g.u", 0.5)
    importer = begun(made, [part("g", gain, k=1.0, b=1.0)], [loop], macro_step=0.1)
    assert values(importer, "g", "y")[0] == pytest.approx(2.0, rel=LOOP)
    for transfer in (*importer.transfers, *importer.loops.transfers):
        transfer.set_gain(loop, -1.0)
    importer.plan_moves()
    importer.begin()
    assert values(importer, "g", "y")[0] == pytest.approx(0.5, rel=LOOP)


# ---- gains and types ----


def test_gains_multiply_and_conversions_keep_them(made: list[Importer], gain: Path, ball: Path) -> None:
    importer = begun(
        made,
        [part("ball", ball), part("count", gain), part("double", gain), body("height", {"stiffness": 0.0})],
        [
            link("ball.bounces", "count.u", 0.5),
            link("ball.h", "double.u", 2.0),
            link("ball.h", "height.force", -0.5),
        ],
        [EventSpec("ball", "h")],
        macro_step=0.1,
    )
    importer.advance(2.0)
    (h,) = values(importer, "ball", "h")
    assert values(importer, "double", "u") == [2.0 * h]
    bounces = int(importer.components["ball"].group("Int64", ["bounces"]).get()[0])
    assert bounces > 2
    assert values(importer, "count", "u") == [0.5 * bounces]


@pytest.mark.parametrize(
    ("source", "target"), [("3.0", "2.0"), ("2.0", "3.0"), ("2.0", "2.0"), ("3.0", "3.0")]
)
def test_truth_values_cross_versions(made: list[Importer], source: str, target: str) -> None:
    # record.impacts is a boolean input, and contact[1].stuck a boolean output
    stuck: dict[str, Value] = {"contact[1].law": "restitution", "contact[1].side": "upper", "force": 1.0}
    importer = begun(
        made,
        [body("a", stuck, source), body("b", {}, target)],
        [link("a.contact[1].stuck", "b.record.impacts")],
        macro_step=0.1,
    )
    group = importer.components["b"].group("Boolean", ["record.impacts"])
    assert not group.get()[0]
    importer.advance(1.0)
    assert importer.components["a"].group("Boolean", ["contact[1].stuck"]).get()[0]
    assert group.get()[0] == 1


def test_a_gain_is_changed_between_runs(made: list[Importer], gain: Path) -> None:
    connection = link("a.displacement", "g.u")
    importer = begun(
        made, [body("a", {"displacement_start": 3.0}), part("g", gain)], [connection], macro_step=0.1
    )
    assert values(importer, "g", "u") == [3.0]
    (transfer,) = importer.transfers
    for factor in (2.0, -1.0, 1.0):
        transfer.set_gain(connection, factor)
        importer.plan_moves()
        importer.begin()
        importer.advance(1.0)
        assert values(importer, "g", "u")[0] == factor * values(importer, "a", "displacement")[0]


def test_an_enumeration_is_set_by_its_word_and_an_unknown_word_is_refused(made: list[Importer]) -> None:
    stop: dict[str, Value] = {
        "contact[1].law": "restitution",
        "contact[1].side": "lower",
        "contact[1].position": -1.0,
    }
    importer = begun(made, [body("a", stop)])
    group = importer.components["a"].group("Int64", ["contact[1].law", "contact[1].side"])
    assert group.get().tolist() == [1, 2]
    made.append(Importer([body("a", {**stop, "contact[1].side": "above"})]))
    with pytest.raises(
        ComponentError, match=r"a\.contact\[1\]\.side: expected one of upper, lower, got 'above'"
    ):
        made[-1].begin()


# ---- beginning ----


def test_start_values_reach_the_end_of_a_chain_before_the_first_step(
    made: list[Importer], gain: Path
) -> None:
    names = [f"g{i}" for i in range(20)]
    links = [link(f"{a}.y", f"{b}.u") for a, b in itertools.pairwise(names)]
    parts = [part(name, gain, b=1.0) for name in names]
    for specs, connections in ((parts, links), (parts[::-1], links[::-1])):
        importer = begun(made, specs, connections)
        assert values(importer, "g19", "y") == [20.0]


def test_a_start_value_is_the_first_thing_a_force_knows(made: list[Importer]) -> None:
    # a is still; the start displacement of b moves it from the first instant on
    importer = begun(
        made,
        [body("a", {}), body("b", {"displacement_start": 2.0})],
        [link("b.displacement", "a.force", 0.5)],
        macro_step=1e-3,
    )
    assert values(importer, "a", "acceleration") == [1.0]


def test_every_run_begins_from_the_same_start(made: list[Importer], gain: Path, ball: Path) -> None:
    importer = begun(
        made,
        [body("a", {"displacement_start": 1.0}), part("ball", ball), part("g", gain, k=3.0)],
        [link("a.displacement", "g.u")],
        [EventSpec("ball", "h")],
        macro_step=0.1,
    )
    ends = []
    for _ in range(3):
        importer.begin()
        importer.advance(3.0)
        ends.append((values(importer, "a", "displacement", "velocity"), values(importer, "ball", "h", "v")))
    assert ends[0] == ends[1] == ends[2]


def test_an_fmu_of_scheduled_execution_alone_is_refused_by_name(folder: Path) -> None:
    path = folder / "scheduled_only.fmu"
    fmu_factory.redescribed(
        fmu_factory.stepped_ball(folder),
        path,
        ("<CoSimulation", "<ScheduledExecution"),
        (' canHandleVariableCommunicationStepSize="true"', ""),
        (' hasEventMode="true" mightReturnEarlyFromDoStep="true" fixedInternalStepSize="1e-3"', ""),
    )
    with pytest.raises(ComponentFileError, match=r"scheduled_only\.fmu.*co-simulation or model exchange"):
        Importer([part("b", path)])


def test_a_watched_component_must_be_able_to_save_its_state(gain: Path) -> None:
    with pytest.raises(ComponentError, match=r"g\.y: expected a watched component that can save its state"):
        Importer([part("g", gain)], events=[EventSpec("g", "y")])


def test_instances_of_one_fmu_do_not_share_anything(made: list[Importer], ball: Path) -> None:
    importer = begun(
        made,
        [part(f"ball{i}", ball, e=0.5 + 0.1 * i) for i in range(5)],
        events=[EventSpec(f"ball{i}", "h") for i in range(5)],
        macro_step=0.1,
    )
    importer.advance(1.3)  # the bounces of the first one accumulate at 1.35 s
    together = [values(importer, f"ball{i}", "h", "v") for i in range(5)]
    assert len({tuple(state) for state in together}) == 5
    for i in range(5):
        alone = begun(
            made, [part("ball", ball, e=0.5 + 0.1 * i)], events=[EventSpec("ball", "h")], macro_step=0.1
        )
        alone.advance(1.3)
        assert values(alone, "ball", "h", "v") == pytest.approx(together[i], abs=1e-10)


def test_a_macro_step_below_the_spacing_of_times_is_refused_and_not_stepped_for_ever(
    made: list[Importer],
) -> None:
    importer = begun(made, [body("a", {})], macro_step=1e-14)
    with pytest.raises(ComponentError, match="macro_step: expected more than"):
        importer.advance(1.0)


# ---- the exchange of two oscillators ----


def spring_pair(version: str = "3.0") -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return two oscillators with a spring .1 between them; normal modes at 1 and sqrt(1.2) rad/s."""
    parts = [
        body("a", {"stiffness": 1.1, "displacement_start": 1.0}, version),
        body("b", {"stiffness": 1.1}, version),
    ]
    return parts, [link("b.displacement", "a.force", 0.1), link("a.displacement", "b.force", 0.1)]


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_both_versions_make_the_same_exchange(made: list[Importer], exchange: str) -> None:
    ends = []
    for version in ("3.0", "2.0"):
        importer = begun(made, *spring_pair(version), exchange=exchange, macro_step=0.1)
        importer.advance(20.0)
        ends.append(values(importer, "a", "displacement", "velocity"))
    assert ends[0] == pytest.approx(ends[1], abs=1e-12)


def test_jacobi_does_not_depend_on_the_order_of_the_components(made: list[Importer]) -> None:
    parts, links = spring_pair()
    ends = []
    for specs in (parts, parts[::-1]):
        importer = begun(made, specs, links, exchange="jacobi", macro_step=0.1)
        importer.advance(20.0)
        ends.append(values(importer, "a", "displacement", "velocity"))
    assert ends[0] == ends[1]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_jacobi_gives_inputs_of_the_start_to_bodies_without_saved_states(
    made: list[Importer], folder: Path, fmi: str
) -> None:
    ends = []
    for states in (True, False):
        mass = fmu_factory.mass(folder, fmi, states=states)
        for names in ("ab", "ba"):
            importer = begun(made, *masses(mass, names), exchange="jacobi", macro_step=0.1)
            importer.advance(3.0)
            ends.append([values(importer, name, "x", "v") for name in "ab"])
    assert all(end == ends[0] for end in ends)


def test_jacobi_takes_no_component_as_a_formula_that_names_a_state(
    made: list[Importer], folder: Path
) -> None:
    source = fmu_factory.mass(folder, "3.0", states=False)
    depends, state = ('dependencies=""', 'dependencies="3"'), ('name="v"', 'name="v" derivative="1"')
    ends = []
    for name, changes in (("plain", []), ("formula", [depends]), ("state", [depends, state])):
        mass = fmu_factory.redescribed(source, folder / f"{name}.fmu", *changes)
        parts, links = masses(mass, "ab")
        importer = begun(made, parts, links[:1], exchange="jacobi", macro_step=0.1)
        importer.advance(3.0)
        ends.append(values(importer, "b", "x"))
    assert ends[2] == ends[0] != ends[1]


def masses(fmu: Path, names: str) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    """Return two masses in the order of their names, a moved by 1, with a force between them."""
    parts = [part(name, fmu, k=4.0, x=float(name == "a")) for name in names]
    return parts, [link("a.x", "b.f", 0.5), link("b.x", "a.f", 0.5)]


@pytest.mark.parametrize(("exchange", "order"), [("jacobi", 1), ("gauss_seidel", 1), ("iterated", 2)])
def test_the_error_of_an_exchange_falls_with_its_order(
    made: list[Importer], exchange: str, order: int
) -> None:
    errors, residuals = [], []
    exact = 0.5 * (math.cos(20.0) + math.cos(math.sqrt(1.2) * 20.0))
    for macro_step in (0.1, 0.05):
        parts, links = spring_pair()
        importer = Importer(parts, links, exchange=exchange, macro_step=macro_step)  # type: ignore[arg-type]
        made.append(importer)
        energy = InterfaceEnergy(importer, links)
        importer.begin()
        energy.begin(links)
        importer.advance(20.0)
        errors.append(abs(values(importer, "a", "displacement")[0] - exact))
        residuals.append(float(abs(energy.residuals()).max()))
    assert 0.8 * 2**order <= errors[0] / errors[1] <= 1.3 * 2**order
    # the force that both sides agree on does no work of its own
    assert residuals[1] <= (1e-13 if exchange == "iterated" else residuals[0])


def test_a_component_without_states_is_stepped_once_in_an_iterated_exchange(
    made: list[Importer], gain: Path
) -> None:
    # a spring 1 - .1 through a gain FMU whose step cannot be repeated
    steps = 0

    def wrap(name: str) -> Wrapper:
        def wrapper(function: str, call: Function) -> Function:
            def counted(*arguments: object) -> object:
                nonlocal steps
                steps += name == "g" and function.endswith("DoStep")
                return call(*arguments)

            return counted

        return wrapper

    importer = begun(
        made,
        [body("a", {"displacement_start": 1.0}), part("g", gain, k=0.1)],
        [link("a.displacement", "g.u"), link("g.y", "a.force")],
        exchange="iterated",
        macro_step=0.05,
        wrap=wrap,
    )
    importer.advance(3.0)
    assert steps == importer.steps == 60
    assert abs(values(importer, "a", "displacement")[0] - math.cos(math.sqrt(0.9) * 3.0)) <= 1e-4


def test_a_bad_status_in_a_prebound_path_names_instance_and_function(
    made: list[Importer], gain: Path
) -> None:
    importer = Importer([body("a", {}), part("g", gain)], [link("a.displacement", "g.u")], macro_step=0.1)
    made.append(importer)
    (transfer,) = importer.transfers
    importer.steps_in_c = False
    importer.begin()
    transfer.write.set_call = ctypes.CFUNCTYPE(ctypes.c_int)(lambda: 3)
    importer.plan_moves()
    with pytest.raises(ComponentError, match="g: fmi2SetReal returned error"):
        importer.advance(1.0)


def test_a_value_that_is_none_leaves_the_others_comparable() -> None:
    none = np.array([np.nan, 1.0, 2.0])
    assert equal_values(none, none.copy(), 1e-12)
    assert not equal_values(none, np.array([np.nan, 1.0, 2.1]), 1e-12)
    assert not equal_values(none, np.array([0.0, 1.0, 2.0]), 1e-12)
    assert equal_values(np.full(2, np.nan), np.full(2, np.nan), 1e-12)
