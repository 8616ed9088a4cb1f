"""Variables of all types are set, connected and recorded: arrays, texts, enumerations, integers of all widths."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from support.fmu_factory import redescribed, typed
from support.serial_pool import workers_here

import vibroimpact as vi
from vibroimpact.analysis.dataset.stores.converting import convert
from vibroimpact.analysis.dataset.stores.runs import read_runs
from vibroimpact.fmus.errors import DatasetError, SceneError, UsageError
from vibroimpact.orchestrator.campaign import CampaignInterrupted, run_campaign, schedule
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.component_facts import component_facts
from vibroimpact.orchestrator.ssp import export_system

WHOLE = {
    f"{u}Int{bits}": (0 if u else -(2 ** (bits - 1)), 2 ** (bits - (not u)) - 1)
    for u in ("", "U")
    for bits in (8, 16, 32, 64)
}
TEXTS = st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=50)
VALUES: dict[str, st.SearchStrategy[Any]] = {
    **{name: st.integers(*limits) for name, limits in WHOLE.items()},
    "Float64": st.floats(allow_nan=False, allow_infinity=False),
    "Float32": st.floats(allow_nan=False, allow_infinity=False, width=32),
    "Boolean": st.booleans(),
    "String": TEXTS | st.sampled_from(["%s%n", "ü" * 2500, "a\nb\t", ""]),
}
FMI2 = {
    "Real": VALUES["Float64"],
    "Integer": VALUES["Int32"],
    "Boolean": VALUES["Boolean"],
    "String": VALUES["String"],
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("typed")
    typed(made).rename(made / "typed.fmu")
    typed(made, "2.0").rename(made / "typed2.fmu")
    return made


def scene(folder: Path, parameters: dict[str, Any], variables: list[str], **more: Any) -> Scene:
    """Return a scene of one component `c` of the FMU of all types."""
    document = {
        "component": {"c": {"fmu": more.pop("fmu", "typed.fmu"), "parameters": parameters}},
        "record": {"recorded_time": 1.0, "rate": 4, "variables": [f"c.{name}" for name in variables]},
        "execution": {"macro_step": 0.25, "guard": False},
    }
    for name, table in more.items():
        document[name] = {**document.get(name, {}), **table} if isinstance(table, dict) else table
    (folder / "s.toml").write_text(tomli_w.dumps(document), encoding="utf-8")
    return Scene.from_file(folder / "s.toml")


def refusal(folder: Path, parameters: dict[str, Any], variables: list[str], **more: Any) -> str:
    with pytest.raises(SceneError) as refused:
        scene(folder, parameters, variables, **more)
    return str(refused.value)


@settings(max_examples=25, deadline=None)
@given(data=st.data(), rows=st.integers(1, 4), columns=st.integers(1, 4))
def test_any_value_of_any_type_comes_back_equal(
    folder: Path, data: st.DataObject, rows: int, columns: int
) -> None:
    single = {name: data.draw(values) for name, values in VALUES.items()}
    row = {name: st.lists(values, min_size=columns, max_size=columns) for name, values in VALUES.items()}
    several = {name: data.draw(st.lists(one, min_size=rows, max_size=rows)) for name, one in row.items()}
    given_values = {f"p_{name}": value for name, value in single.items()}
    given_values |= {f"a_{name}": value for name, value in several.items()}
    given_values |= {"rows": rows, "columns": columns}
    names = [*(f"y_{name}" for name in single), *(f"b_{name}" for name in several)]
    made = vi.run(scene(folder, given_values, names))
    for name in VALUES:
        assert made[f"c_y_{name}"].values[-1] == single[name]
        np.testing.assert_array_equal(made[f"c_b_{name}"].values[-1], np.array(several[name], dtype=object))
        assert made[f"c_b_{name}"].shape == (5, rows, columns)
    assert (made["rows"], made["columns"]) == (rows, columns)


@settings(max_examples=10, deadline=None)
@given(data=st.data())
def test_any_value_of_a_type_of_fmi_2_comes_back_equal(folder: Path, data: st.DataObject) -> None:
    drawn = {name: data.draw(values) for name, values in FMI2.items()} | {"Enumeration": "ü %s"}
    made = vi.run(
        scene(folder, {f"p_{n}": v for n, v in drawn.items()}, [f"y_{n}" for n in drawn], fmu="typed2.fmu")
    )
    for name, value in drawn.items():
        expected = 2**31 - 1 if name == "Enumeration" else value
        assert made[f"c_y_{name}"].values[-1] == expected
    assert made.c_y_Enumeration.attrs["flag_meanings"] == "idle ramp_up s"


def changing(folder: Path, **more: Any) -> Scene:
    """Return a sweep that records what changes with each step, of every form."""
    names = ["word", "big", "mode", "x", "y_UInt64", "b_String", "y_Float64"]
    given_values = {
        "u": [[1.0, 2.0]],
        "a_String": [["a", "ä"]],
        "p_UInt64": 2**64 - 1,
        "rows": 1,
        "columns": 2,
    }
    sweep = {"c.p_Float64": {"values": [1.0, 2.0, 3.0]}}
    return scene(folder, given_values, names, sweep=sweep, **more)


def check_changing(rows: Any) -> None:
    """Check the samples of `changing`, one run after the other."""
    steps = np.tile(np.arange(5), 3)
    assert rows["c_word"].values.tolist() == [f"step {k} ä %s" for k in steps]
    np.testing.assert_array_equal(rows["c_big"].values, 2**62 + steps)
    np.testing.assert_array_equal(rows["c_mode"].values, np.array([-1, 7, 9007199254740993])[steps % 3])
    np.testing.assert_array_equal(rows["c_x"].values[:, 0], 0.25 * steps[:, None] * [1.0, 2.0])
    np.testing.assert_array_equal(rows["c_y_UInt64"].values, np.full(15, 2**64 - 1, dtype=np.uint64))
    assert rows["c_b_String"].values.tolist() == [[["a", "ä"]]] * 15
    np.testing.assert_array_equal(rows["c_y_Float64"].values, np.repeat([1.0, 2.0, 3.0], 5))


@pytest.mark.parametrize("guard", [False, True])
def test_values_change_with_the_steps_of_a_run(folder: Path, guard: bool) -> None:
    check_changing(vi.run(changing(folder, execution={"guard": guard})))


@pytest.mark.parametrize(("kind", "other"), [("netcdf", "d.zarr"), ("zarr", "d.nc")])
def test_a_campaign_holds_every_type_and_goes_on(
    folder: Path, tmp_path: Path, kind: Literal["netcdf", "zarr"], other: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, place = changing(folder), tmp_path / "c"
    monkeypatch.setattr(schedule, "FIRST_POINTS", 1)
    workers_here(monkeypatch, most_chunks=1)
    report, commands = None, 0
    while report is None:
        with suppress(CampaignInterrupted):
            report = run_campaign(whole, place, workers=1, format=kind)
        commands += 1
    assert commands > 1
    check_changing(read_runs(place))
    opened = vi.open_dataset(place)
    check_changing(opened)
    one = opened.vibroimpact.samples(p_Float64=2.0)
    assert (one.c_word.values[-1], one.c_x.values[-1].tolist()) == ("step 4 ä %s", [[1.0, 2.0]])
    convert(place, tmp_path / other).close()
    check_changing(read_runs(tmp_path / other))


# ---- arrays between components ----

TWO = """
[component.a]
fmu = "typed.fmu"
parameters = {{ rows = 2, columns = 2, u = [[1.0, 2.0], [3.0, 4.0]] }}
[component.b]
fmu = "typed.fmu"
parameters = {{ rows = 2, columns = 2 }}
{connections}
[record]
recorded_time = 1.0
rate = 8
variables = ["b.{output}"]
[execution]
macro_step = 0.25
exchange = "{exchange}"
guard = false
"""
GIVEN = np.array([[1.0, 2.0], [3.0, 4.0]])


def connected(folder: Path, *lines: str, output: str = "u", exchange: str = "gauss_seidel") -> Scene:
    each = "".join(f"[[connection]]\n{line}\n" for line in lines)
    (folder / "two.toml").write_text(TWO.format(connections=each, output=output, exchange=exchange))
    return Scene.from_file(folder / "two.toml")


def test_a_structural_parameter_that_is_a_truth_value_is_no_size(tmp_path: Path) -> None:
    attributes = 'valueReference="9999" causality="structuralParameter" variability="fixed" start="false"'
    switch = ("<ModelVariables>", f'<ModelVariables><Boolean name="dae" {attributes}/>')
    path = redescribed(typed(tmp_path, "3.0"), tmp_path / "dae.fmu", switch)
    assert set(component_facts(path).sizes) == {"rows", "columns"}


@pytest.mark.parametrize("exchange", ["jacobi", "gauss_seidel", "iterated"])
def test_an_array_is_connected_whole(folder: Path, exchange: str) -> None:
    line = 'from = "a.z"\nto = "b.u"\ngain = 0.5\noffset = 1.0'
    made = vi.run(connected(folder, line, output="x", exchange=exchange))
    expected = made.time.values[:, None, None] * (GIVEN + 1.0)
    np.testing.assert_allclose(made.b_x.values, expected, rtol=1e-14, atol=0.0)


def test_arrays_of_single_precision_take_doubles(folder: Path) -> None:
    made = vi.run(connected(folder, 'from = "a.z"\nto = "b.single"', output="single"))
    np.testing.assert_array_equal(made.b_single.values[-1], 2.0 * GIVEN)


def test_a_loop_through_arrays_is_solved_element_by_element(folder: Path) -> None:
    # b.u = 0.75 a.z + 1 = 1.5 a.u + 1, and a.u = b.z = 2 b.u: b.u = 3 b.u + 1
    lines = ('from = "a.z"\nto = "b.u"\ngain = 0.75\noffset = 1.0', 'from = "b.z"\nto = "a.u"')
    made = vi.run(connected(folder, *lines))
    np.testing.assert_allclose(made.b_u.values, np.full((9, 2, 2), -0.5), rtol=1e-12)
    assert made.loop_residual <= 1e-12


# ---- refusals ----


@pytest.mark.parametrize(
    ("parameters", "names", "expected"),
    [
        ({"u": [1.0, 2.0]}, ["x"], "expected an array of the shape 2 x 3"),
        ({"u": [[1.0, 2.0, 3.0], [1.0, 2.0]]}, ["x"], "expected an array of the shape 2 x 3"),
        ({"u": 1.0}, ["x"], "expected an array of the shape 2 x 3"),
        ({"u": [[1.0, 2.0, 3.0], [1.0, 2.0, "a"]]}, ["x"], "expected elements that are each a finite number"),
        ({"p_Float64": [1.0]}, ["x"], "expected a finite number"),
        ({"rows": 3, "u": [[0.0] * 3] * 2}, ["x"], "expected an array of the shape 3 x 3"),
        ({"rows": 0}, ["x"], "rows: expected a whole number from 1 to 64"),
        ({"a_Int8": [[0, 0, 128], [0, 0, 0]]}, ["x"], "each a whole number from -128 to 127"),
        ({"p_String": "a\0"}, ["x"], "text without null characters"),
        ({"blob": "00"}, ["x"], "blob"),
        ({}, ["blob"], "expected numbers, true or false, or texts, got the Binary c.blob"),
    ],
)
def test_a_wrong_value_or_variable_is_refused(
    folder: Path, parameters: dict[str, Any], names: list[str], expected: str
) -> None:
    assert expected in refusal(folder, parameters, names)


def test_connections_of_other_shapes_and_types_are_refused(folder: Path) -> None:
    for line, expected in (
        (
            'from = "a.z"\nto = "b.input"',
            "expected two variables of one shape, got 2 x 2 (a.z) to a single value",
        ),
        (
            'from = "a.y_String"\nto = "b.input"',
            "expected numbers, or true or false, got the String a.y_String",
        ),
        ('from = "a.b_Boolean"\nto = "b.u"', "expected two variables of one type"),
    ):
        with pytest.raises(SceneError) as refused:
            connected(folder, line)
        assert expected in str(refused.value)


def test_sizes_of_arrays_that_a_scene_uses_are_not_swept(folder: Path) -> None:
    sweep = {"c.rows": {"values": [1, 2]}}
    assert "expected a size of no array that this scene uses, got that of c.x" in refusal(
        folder, {}, ["x"], sweep=sweep
    )
    made = vi.run(scene(folder, {}, ["y_Float64"], sweep=sweep))
    assert made["rows"].values.tolist() == [1.0, 2.0]
    assert "expected a number, got the array of Float64 c.u" in refusal(
        folder, {}, ["word"], sweep={"c.u": {"values": [1.0]}}
    )


def test_samples_within_a_step_hold_what_is_no_real_number(folder: Path, tmp_path: Path) -> None:
    plain = tmp_path / "plain.fmu"
    redescribed(folder / "typed.fmu", plain, ('canGetAndSetFMUState="true"', ""))
    made = vi.run(
        scene(folder, {"u": [[1.0] * 3] * 2}, ["word", "big", "x"], fmu=str(plain), record={"rate": 8})
    )
    assert made.c_word.values.tolist() == [f"step {k} ä %s" for k in (0, 0, 1, 1, 2, 2, 3, 3, 4)]
    assert (made.c_big.values - 2**62).tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4]
    np.testing.assert_allclose(made.c_x.values[:, 0, 0], made.time.values)


def test_long_and_odd_names_have_names_in_a_file(folder: Path, tmp_path: Path) -> None:
    odd = {"y_Float64": "ü%s%n" * 1000, "b_Float64": "ü%s%n" * 1000 + "[1]", "word": "\u65e5\u672c"}
    changes = [(f'name="{old}"', f'name="{new}"') for old, new in odd.items()]
    redescribed(folder / "typed.fmu", tmp_path / "odd.fmu", *changes)
    made = vi.run(scene(folder, {}, list(odd.values()), fmu=str(tmp_path / "odd.fmu")))
    names = {one.attrs.get("component_variable"): name for name, one in made.data_vars.items()}
    stored = [str(names[f"c.{new}"]) for new in odd.values()]
    assert len(set(stored)) == 3
    assert max(map(len, stored)) <= 200
    assert made[stored[2]].values[-1] == "step 4 ä %s"


def test_a_figure_says_which_variables_it_leaves_out(folder: Path, tmp_path: Path) -> None:
    made = vi.run(scene(folder, {}, ["word", "x", "big"]))
    (axis,) = made.vibroimpact.samples().pipe(lambda _: vi.draw(made)).axes
    assert axis.get_xlabel().endswith(", without c_word, c_x (arrays, texts)")
    with pytest.raises(DatasetError, match=r"got none recorded, without c_word, c_x \(arrays, texts\)"):
        vi.draw(vi.run(scene(folder, {}, ["word", "x"])))


def test_arrays_have_no_form_in_an_exported_system(folder: Path, tmp_path: Path) -> None:
    for made, expected in (
        (connected(folder, 'from = "a.z"\nto = "b.u"'), "component.a.parameters.u: expected a single value"),
        (
            scene(folder, {}, ["x"], connection=[{"from": "c.z", "to": "c.u"}]),
            "connection[1].from: expected a single value in a system (SSP), got the array of Float64 z",
        ),
    ):
        with pytest.raises(UsageError) as refused:
            export_system(made, tmp_path / "s.ssp", ssp="2.0")
        assert expected in str(refused.value)
