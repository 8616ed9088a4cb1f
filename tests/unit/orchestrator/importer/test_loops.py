"""Algebraic loops: found whatever the descriptions say, solved by derivatives or differences, refused with numbers."""

import math
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import EXCHANGES, VERSIONS, body, link, part, values

import vibroimpact as vi
from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.orchestrator.fmi.library import Library
from vibroimpact.orchestrator.importer.loops import slopes
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.scene import parse_scene

LINEAR, COSINE, SQUARE, ROOT, OFF_ABOVE = range(5)
SOLVED = 1e-11
"""Solution of a loop of order 1: its relative residual of 1e-12 over the slope of the residual."""
#: Texts of the description by what they declare.
LISTS = {
    "3.0": ('<Output valueReference="3" dependencies="1 2"/>', '<Output valueReference="3"{}/>'),
    "2.0": ('<Unknown index="3" dependencies="1 2"/>', '<Unknown index="3"{}/>'),
}
DECLARED = ' providesDirectionalDerivative{}="true"'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmus")


@pytest.fixture(scope="module", params=VERSIONS)
def any_version(folder: Path, request: pytest.FixtureRequest) -> Path:
    return fmu_factory.feedthrough(folder, str(request.param))


@pytest.fixture(scope="module", params=VERSIONS)
def version(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture(scope="module")
def fmu(folder: Path, version: str) -> Path:
    return fmu_factory.feedthrough(folder, version)


@pytest.fixture(scope="module")
def plain(folder: Path, version: str, fmu: Path) -> Path:
    """An FMU without directional derivatives."""
    text = DECLARED.format("s" if version == "3.0" else "")
    return fmu_factory.redescribed(fmu, folder / f"plain{version}.fmu", (text, ""))


@pytest.fixture(scope="module")
def silent(folder: Path, version: str, fmu: Path) -> Path:
    """An FMU without a list of dependencies, for steps or initialization."""
    return relisted(folder / f"silent{version}.fmu", fmu, version, "")


@pytest.fixture(scope="module")
def lying(folder: Path, version: str, fmu: Path) -> Path:
    """An FMU whose list says that y depends on no input."""
    return relisted(folder / f"lying{version}.fmu", fmu, version, ' dependencies=""')


def relisted(path: Path, fmu: Path, version: str, dependencies: str) -> Path:
    old, new = LISTS[version]
    texts = [(old, new.format(dependencies))]
    if version == "3.0":
        texts.append(('<InitialUnknown valueReference="3" dependencies="1 2"/>', ""))
    return fmu_factory.redescribed(fmu, path, *texts)


@pytest.fixture(scope="module")
def kinds(fmu: Path, plain: Path, silent: Path, lying: Path) -> dict[str, Path]:
    return {"derivatives": fmu, "plain": plain, "silent": silent, "lying": lying}


@pytest.fixture
def made() -> Iterator[list[Importer]]:
    importers: list[Importer] = []
    yield importers
    for importer in importers:
        importer.free()


def run(
    made: list[Importer], specs: Sequence[ComponentSpec], links: Sequence[ConnectionSpec], end: float = 0.3
) -> Importer:
    made.append(Importer(specs, links, macro_step=0.1))
    made[-1].begin()
    made[-1].advance(end)
    return made[-1]


def ring(
    fmu: Path, gains: Sequence[float], **more: float
) -> tuple[list[ComponentSpec], list[ConnectionSpec]]:
    names = [f"g{i}" for i in range(len(gains))]
    parts = [part(name, fmu, k=k, **more) for name, k in zip(names, gains, strict=True)]
    return parts, [link(f"{a}.y", f"{b}.u") for a, b in zip(names, names[1:] + names[:1], strict=True)]


# ---- linear loops ----


@pytest.mark.parametrize("kind", ["derivatives", "plain", "silent", "lying"])
@pytest.mark.parametrize("gains", [(0.5, 3.0), (-2.0,), (-1.0,), (1e6, 1.5e-6), (-2.0, 1.0, 3.0)])
def test_a_linear_loop_of_any_gain_is_solved_whatever_its_fmus_declare(
    made: list[Importer], kinds: dict[str, Path], kind: str, gains: tuple[float, ...]
) -> None:
    parts, links = ring(kinds[kind], gains, b=1.0)
    importer = run(made, parts, links)
    matrix = np.eye(len(gains)) - np.diag(gains) @ np.roll(np.eye(len(gains)), -1, axis=1)
    found = [values(importer, f"g{i}", "y")[0] for i in range(len(gains))]
    exact = np.linalg.solve(matrix, np.ones(len(gains)))
    np.testing.assert_allclose(found, exact, rtol=SOLVED, atol=SOLVED if len(gains) == 3 else 0.0)
    assert importer.loops.residual <= 1e-12
    assert len(importer.loops.names) == 1
    lies = [text for text in importer.loops.remarks() if "which its list of dependencies leaves out" in text]
    assert len(lies) == (len(gains) if kind == "lying" else 0)


def test_a_loop_of_gain_above_1_that_is_driven_at_0_comes_to_0(made: list[Importer], fmu: Path) -> None:
    parts, links = ring(fmu, (0.5, 3.0))
    parts[0] = part("g0", fmu, k=0.5, u=1.0)
    importer = run(made, parts, links)
    assert values(importer, "g0", "y") == values(importer, "g1", "y") == [0.0]


def test_values_that_cancel_to_0_are_a_solution(made: list[Importer], fmu: Path) -> None:
    # x1 = x2 / 3 - 1 / 3 and x2 = x1 + 1 + 1e-17: x1 is rounding beside x2
    parts = [part("a", fmu, k=1.0 / 3.0, b=-1.0 / 3.0), part("b", fmu, k=1.0, b=1.0)]
    importer = run(made, parts, [link("a.y", "b.u"), link("b.y", "a.u")])
    assert abs(values(importer, "a", "y")[0]) <= 1e-15
    assert values(importer, "b", "y") == pytest.approx([1.0], rel=1e-15)


@pytest.mark.parametrize("gains", [(1.0,), (0.5, 2.0), (1e6, 1e-6), (-1.0, 1.0, -1.0)])
def test_a_singular_loop_without_a_solution_is_refused_with_names_gain_and_residual(
    made: list[Importer], fmu: Path, gains: tuple[float, ...]
) -> None:
    with pytest.raises(ComponentError) as failure:
        run(made, *ring(fmu, gains, b=1.0))
    text = str(failure.value)
    assert all(f"g{i}.y -> " in text for i in range(len(gains)))
    assert "a singular loop without a solution (smallest singular value of I - G " in text
    assert "gain 1 - det(I - G) = 1)" in text
    (residual,) = re.findall(r"; residual (\S+), relative", text)
    assert 0.3 < float(residual) < 1e6


def test_a_singular_loop_with_many_solutions_is_said(made: list[Importer], fmu: Path) -> None:
    parts, links = ring(fmu, (0.5, 2.0))
    parts[0] = part("g0", fmu, k=0.5, u=1.0)
    importer = run(made, parts, links)
    (remark,) = importer.loops.remarks()
    assert "g0.y -> g1.u , g1.y -> g0.u is singular: other values nearby solve it as well" in remark
    half, whole = values(importer, "g0", "y", "u")
    assert half == whole / 2.0 != 0.0


def test_a_loop_that_becomes_singular_in_a_run_is_refused_there(made: list[Importer], fmu: Path) -> None:
    parts, links = ring(fmu, (0.5,), b=1.0)
    importer = run(made, parts, links, 0.1)
    gain = importer.components["g0"].group("Float64", ["k"])
    gain.values[0] = 1.0
    gain.set()
    with pytest.raises(ComponentError, match=r"at time 0\.1\d*: .*singular loop without a solution"):
        importer.advance(0.3)


# ---- loops that are not linear ----


@pytest.mark.parametrize("kind", ["derivatives", "plain"])
def test_the_fixed_point_of_the_cosine_is_found(
    made: list[Importer], kinds: dict[str, Path], kind: str
) -> None:
    importer = run(made, [part("c", kinds[kind], law=COSINE)], [link("c.y", "c.u")])
    # x = cos x, 20 digits
    assert values(importer, "c", "y") == pytest.approx([0.73908513321516064166], rel=SOLVED)


@pytest.mark.parametrize(("start", "solution"), [(0.3, 0.2), (0.7, 0.8), (5.0, 0.8), (-3.0, 0.2)])
def test_of_two_solutions_the_one_beside_the_start_value_is_found(
    made: list[Importer], fmu: Path, start: float, solution: float
) -> None:
    # x = x^2 + 0.16: both solutions, 0.2 and 0.8
    importer = run(made, [part("s", fmu, law=SQUARE, b=0.16, u=start)], [link("s.y", "s.u")])
    assert values(importer, "s", "y") == pytest.approx([solution], rel=SOLVED)


def test_a_loop_without_a_real_solution_is_refused_at_its_least_residual(
    made: list[Importer], fmu: Path
) -> None:
    # x = x^2 + 1: the residual is least, 3/4, at x = 1/2
    with pytest.raises(ComponentError, match=r"s\.y -> s\.u at time 0: .*; residual 0\.75, relative"):
        run(made, [part("s", fmu, law=SQUARE, b=1.0, u=3.0)], [link("s.y", "s.u")])


def test_values_that_an_fmu_discards_are_stepped_around(made: list[Importer], plain: Path) -> None:
    # x = sqrt x + 2 has the solution 4; from 0.01 a whole Newton step leads to a negative number, which has no root
    importer = run(made, [part("r", plain, law=ROOT, b=2.0, u=0.01)], [link("r.y", "r.u")])
    assert values(importer, "r", "y") == pytest.approx([4.0], rel=SOLVED)


def test_a_start_without_a_value_is_refused_by_name(made: list[Importer], fmu: Path) -> None:
    with pytest.raises(ComponentError, match=r"r\.y -> r\.u at time 0: .*no finite values to begin at"):
        run(made, [part("r", fmu, law=ROOT, u=-1.0)], [link("r.y", "r.u")])


# ---- several loops ----


def test_a_loop_is_solved_after_the_loop_that_feeds_it_in_each_step(made: list[Importer], fmu: Path) -> None:
    # one = 2 / 3, and a = half of a + one, through a connection of two; both follow a parameter within the run
    parts = [part("one", fmu, k=-0.5, b=1.0), part("on", fmu, k=2.0), part("a", fmu, k=0.5, l=1.0)]
    links = [link("a.y", "a.u"), link("on.y", "a.w"), link("one.y", "on.u"), link("one.y", "one.u")]
    importer = run(made, parts, links, 0.1)
    assert importer.loops.names == ("one.y -> one.u", "a.y -> a.u")
    offset = importer.components["one"].group("Float64", ["b"])
    offset.values[0] = 3.0
    offset.set()
    importer.advance(0.15)
    assert values(importer, "a", "y") == pytest.approx([8.0], rel=SOLVED)


def test_two_loops_that_share_a_connection_are_one(made: list[Importer], fmu: Path) -> None:
    # a = b / 2 + c / 4 + 1 with c = -2 a: b = 2 a gives a = 2, and b = 3 a is singular
    parts = [part("a", fmu, k=0.5, l=0.25, b=1.0), part("b", fmu, k=2.0), part("c", fmu, k=-2.0)]
    links = [link("a.y", "b.u"), link("a.y", "c.u"), link("b.y", "a.u"), link("c.y", "a.w")]
    importer = run(made, parts, links)
    assert len(importer.loops.names) == 1
    assert values(importer, "a", "y") == pytest.approx([2.0], rel=SOLVED)
    importer.free()
    parts[1] = part("b", fmu, k=3.0)
    with pytest.raises(ComponentError, match="singular loop without a solution"):
        run([], parts, links)


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_outputs_at_the_end_of_a_step_agree_with_their_loops(
    made: list[Importer], fmu: Path, exchange: str
) -> None:
    # force = k acceleration: the mass is 1 - k, for any k but 1
    orders = {"iterated": 2}
    for gain in (0.5, -3.0):
        errors = []
        for step in (0.02, 0.01):
            specs = [body("a", {"displacement_start": 1.0}), part("g", fmu, k=gain)]
            links = [link("a.acceleration", "g.u"), link("g.y", "a.force")]
            made.append(Importer(specs, links, exchange=exchange, macro_step=step))  # type: ignore[arg-type]
            made[-1].begin()
            made[-1].advance(1.0)
            x, acceleration = values(made[-1], "a", "displacement", "acceleration")
            assert values(made[-1], "g", "y") == pytest.approx([gain * acceleration], rel=SOLVED)
            errors.append(abs(x - math.cos(1.0 / math.sqrt(1.0 - gain))))
        assert math.log2(errors[0] / errors[1]) == pytest.approx(orders.get(exchange, 1), abs=0.1)


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_a_loop_of_large_gain_stays_solved_from_step_to_step(
    made: list[Importer], fmu: Path, silent: Path, exchange: str
) -> None:
    gains = (3e4, -2e4, 1e4)
    parts, links = ring(fmu, gains, b=1.0)
    parts[1] = part("g1", silent, k=gains[1], b=1.0)
    made.append(Importer(parts, links, exchange=exchange, macro_step=0.1))  # type: ignore[arg-type]
    made[-1].begin()
    made[-1].advance(1.0)
    for a, b in ("g0", "g1"), ("g1", "g2"), ("g2", "g0"):
        (y,), (u,), (k,) = values(made[-1], a, "y"), values(made[-1], b, "u"), values(made[-1], a, "k")
        assert abs(y - u) <= 1e-12 * max(abs(y), 1.0, abs(k * values(made[-1], a, "u")[0]))


def test_an_fmu_behind_a_loop_sees_its_solution_alone(made: list[Importer], fmu: Path) -> None:
    # a = 2 a - 4 begins at -4, of which r = sqrt a has no value; the solution is 4
    parts = [part("r", fmu, law=ROOT), part("a", fmu, k=2.0, b=-4.0)]
    importer = run(made, parts, [link("a.y", "r.u"), link("a.y", "a.u")])
    assert values(importer, "r", "y") == pytest.approx([2.0], rel=SOLVED)


SIZES = st.tuples(st.sampled_from([-1.0, 1.0]), st.floats(-4.0, 4.0)).map(
    lambda drawn: drawn[0] * 10.0 ** drawn[1]
)


@settings(max_examples=40)
@given(data=st.data())
def test_any_system_of_linear_fmus_is_solved_to_rounding(data: st.DataObject, any_version: Path) -> None:
    n = data.draw(st.integers(1, 5))
    rows = st.lists(SIZES, min_size=n, max_size=n)
    k, w, b = (np.array(data.draw(rows)) for _ in range(3))
    of_u, of_w = (data.draw(st.lists(st.integers(0, n - 1), min_size=n, max_size=n)) for _ in range(2))
    matrix = np.eye(n)
    np.subtract.at(matrix, (np.arange(n), of_u), k)
    np.subtract.at(matrix, (np.arange(n), of_w), w)
    assume(np.linalg.cond(matrix) < 1e6)
    parts = [part(f"g{i}", any_version, k=k[i], l=w[i], b=b[i]) for i in range(n)]
    links = [link(f"g{j}.y", f"g{i}.u") for i, j in enumerate(of_u)]
    links += [link(f"g{j}.y", f"g{i}.w") for i, j in enumerate(of_w)]
    importer = Importer(parts, links, macro_step=0.1)
    importer.begin()
    importer.advance(0.2)
    y, u, v = (np.array([values(importer, f"g{i}", name)[0] for i in range(n)]) for name in "yuw")
    importer.free()
    terms = np.max(np.abs([k * u, w * v, b]), axis=0)
    assert np.all(np.abs(u - y[of_u]) <= 1e-12 * terms[of_u])
    assert np.all(np.abs(v - y[of_w]) <= 1e-12 * terms[of_w])


def test_inputs_that_share_an_output_cancel_without_a_singular_loop(made: list[Importer], fmu: Path) -> None:
    # b = 1e4 a - 1e4 a - 1, a = -a - 100 b - 1
    parts = [part("a", fmu, k=-1.0, l=-100.0, b=-1.0), part("b", fmu, k=1e4, l=-1e4, b=-1.0)]
    importer = run(
        made, parts, [link("a.y", "a.u"), link("a.y", "b.u"), link("b.y", "a.w"), link("a.y", "b.w")]
    )
    assert values(importer, "a", "y") == pytest.approx([49.5], rel=SOLVED)


# ---- initialization ----


def test_a_loop_of_initialization_alone_is_solved_there_and_is_none_in_steps(
    made: list[Importer], fmu: Path
) -> None:
    # latched = 3 (-0.5 latched + 2) + 1: 7 / 2.5
    parts = [part("m", fmu, k=3.0, b=1.0), part("g", fmu, k=-2.5, b=2.0)]
    importer = run(made, parts, [link("m.latched", "g.u"), link("g.y", "m.u")])
    assert importer.loops.names == ()
    assert values(importer, "m", "latched") == pytest.approx([7.0 / 8.5], rel=SOLVED)
    importer.free()
    with pytest.raises(ComponentError, match=r"m\.latched -> g\.u , g\.y -> m\.u at time 0: .*singular"):
        run(
            [], [parts[0], part("g", fmu, k=1.0 / 3.0, b=2.0)], [link("m.latched", "g.u"), link("g.y", "m.u")]
        )
    made.clear()


# ---- derivatives that lie ----


@pytest.mark.parametrize(("lie", "why"), [(0.5, "derivative 2.5, difference 2"), (-1.0, "returns status 3")])
def test_derivatives_that_lie_or_fail_are_not_used_and_said(
    made: list[Importer], fmu: Path, lie: float, why: str
) -> None:
    importer = run(made, [part("g", fmu, k=2.0, b=1.0, lie=lie)], [link("g.y", "g.u")])
    assert values(importer, "g", "y") == pytest.approx([-1.0], rel=SOLVED)
    (remark,) = importer.loops.remarks()
    assert remark.startswith("g declares providesDirectionalDerivative, and they are not used: ")
    assert why in remark


def test_a_library_without_the_function_that_it_declares_is_said(
    made: list[Importer], fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    function = Library.function

    def without(library: Library, name: str, *result: object) -> object:
        if "Directional" in name:
            raise ComponentFileError(f"expected a binary that exports {name}, got one without it.")
        return function(library, name, *result)

    monkeypatch.setattr(Library, "function", without)
    importer = run(made, [part("g", fmu, k=2.0, b=1.0)], [link("g.y", "g.u")])
    assert values(importer, "g", "y") == pytest.approx([-1.0], rel=SOLVED)
    assert any("got one without it" in remark for remark in importer.loops.remarks())


def test_derivatives_of_a_loop_are_taken_without_differences(
    made: list[Importer], fmu: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    importer = run(made, [part("g", fmu, law=COSINE)], [link("g.y", "g.u")])
    monkeypatch.setattr(slopes, "_differences", None)  # the comparison of the first run is not repeated
    importer.begin()
    importer.advance(0.2)
    assert values(importer, "g", "y") == pytest.approx([0.73908513321516064166], rel=SOLVED)


# ---- whole numbers ----


@pytest.fixture(scope="module")
def whole(folder: Path, version: str, fmu: Path) -> Path:
    """An FMU whose input u and output y are whole numbers."""
    texts = (
        [(f'<Float64 name="{v}"', f'<Int64 name="{v}"') for v in "uy"]
        if version == "3.0"
        else [
            ('Input">\n      <Real start="0"/>', 'Input">\n      <Integer start="0"/>'),
            ('l w">\n      <Real/>', 'l w">\n      <Integer/>'),
        ]
    )
    path = folder / f"whole{version}.fmu"
    return fmu_factory.redescribed(fmu, path, *texts)


def test_whole_numbers_in_a_loop_are_substituted_until_they_stay(made: list[Importer], whole: Path) -> None:
    parts = [part("a", whole, law=OFF_ABOVE, b=3.0, u=9), part("b", whole, k=1.0, b=1.0)]
    importer = run(made, parts, [link("a.y", "b.u"), link("b.y", "a.u")])
    found = [importer.components[name].group("Int64", ["y"]).get()[0] for name in "ab"]
    assert found == [1, 2]


def test_whole_numbers_that_never_stay_are_refused_by_name(made: list[Importer], whole: Path) -> None:
    with pytest.raises(ComponentError, match=r"settle by substitution, got a\.y -> a\.u that still change"):
        run(made, [part("a", whole, law=OFF_ABOVE)], [link("a.y", "a.u")])


def test_real_numbers_are_solved_for_each_choice_of_whole_numbers(
    made: list[Importer], whole: Path, fmu: Path
) -> None:
    # x = 2 x - switch - 4 is 4 with 0 and 5 with 1; the switch is 1 up to 6
    parts = [part("x", fmu, k=2.0, l=-1.0, b=-4.0), part("switch", whole, law=OFF_ABOVE, b=6.0)]
    links = [link("x.y", "x.u"), link("x.y", "switch.u"), link("switch.y", "x.w")]
    importer = run(made, parts, links)
    assert values(importer, "x", "y") == pytest.approx([5.0], rel=SOLVED)


# ---- the same run twice ----


def test_a_run_begun_anew_gives_the_same_bits(made: list[Importer], plain: Path) -> None:
    importer = run(made, [part("c", plain, law=COSINE), part("g", plain, k=0.7)], [
        link("c.y", "g.u"), link("g.y", "c.u"),
    ])  # fmt: skip
    first = values(importer, "c", "y")
    importer.begin()
    importer.advance(0.3)
    assert values(importer, "c", "y") == first


# ---- scenes ----

SCENE = """
[component.a]
fmu = "Gain"
parameters = {{ gain = 0.5, input = 1.0 }}
[component.b]
fmu = "Gain"
parameters = {{ gain = {gain} }}
[[connection]]
from = "a.output"
to = "b.input"
[[connection]]
from = "b.output"
to = "a.input"
[record]
recorded_time = 1.0
rate = 10
variables = ["a.output", "b.output"]
[execution]
how = "coupled"
macro_step = 0.1
exchange = "{exchange}"
"""


@pytest.mark.parametrize("exchange", EXCHANGES)
def test_a_scene_with_a_loop_of_gain_above_1_runs(exchange: str) -> None:
    dataset = vi.run(parse_scene(SCENE.format(gain=3.0, exchange=exchange), "loop"), progress=False)
    assert np.all(dataset.a_output == 0.0)
    assert np.all(dataset.b_output == 0.0)
    assert float(dataset.loop_residual) <= 1e-12
    assert str(dataset.message.values) == ""


def test_a_scene_with_a_singular_loop_says_so() -> None:
    dataset = vi.run(parse_scene(SCENE.format(gain=2.0, exchange="jacobi"), "loop"), progress=False)
    assert "algebraic loop a.output -> b.input , b.output -> a.input is singular" in str(
        dataset.message.values
    )
