"""One variables.toml generates the two descriptions, the C header and the README's table."""

import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
from fmpy.model_description import read_model_description
from fmpy.validation import validate_fmu

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.build import NATIVE, fmi_headers, read_components, update_readmes
from vibroimpact.fmus.packaging.compiler import find_compiler
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    c_header,
    header_name,
    model_description,
    read_component,
    readme_table,
    with_table,
)

SMALL = """
[component]
name = "Small"
folder = "small"
struct = "small"
header = "small.h"
description = "A small one"
contacts = 2
event_mode = true
[[unit]]
name = "m"
base = { m = 1 }
[[enumeration]]
name = "Law"
items = [{ name = "none", value = 0 }, { name = "restitution", value = 1, description = "an impact" }]
[[variable]]
name = "time"
description = "Time"
causality = "independent"
variability = "continuous"
type = "Float64"
field = "time"
code = "TIME"
[[variable]]
name = "push"
description = "A force"
causality = "input"
variability = "continuous"
type = "Float64"
start = 0
field = "push"
code = "PUSH"
[[variable]]
name = "contact[{k}].law"
description = "Law | of stop {k}"
causality = "parameter"
variability = "fixed"
type = "Enumeration"
enumeration = "Law"
start = 1
field = "contacts[{i}].law"
code = "CONTACT_LAW"
repeat = "contact"
[[variable]]
name = "contact[{k}].gap"
description = "Gap to stop {k}"
causality = "output"
variability = "continuous"
type = "Float64"
unit = "m"
field = "contacts[{i}].gap"
code = "CONTACT_GAP"
repeat = "contact"
dependencies = ["push"]
[[variable]]
name = "rows"
description = "A record"
causality = "local"
variability = "discrete"
type = "Float64"
field = "rows"
code = "ROWS"
dimensions = [4, 3]
[[variable]]
name = "moving"
description = "Does it move?"
causality = "output"
variability = "discrete"
type = "Boolean"
field = "moving"
code = "MOVING"
dependencies = []
[[variable]]
name = "gain"
description = "A gain"
causality = "parameter"
variability = "tunable"
type = "Float64"
start = inf
field = "gain"
code = "GAIN"
"""
C_SOURCE = """
#include "small_variables.h"
int main(void) {
    const vi_variable *v = small_variables;
    const vi_description *shown = &vi_this_description;
    if (shown->variables != v || shown->variable_count != 9 || sizeof small_variables / sizeof *v != 9) return 1;
    if (shown->struct_size != sizeof(small) || shown->time != offsetof(small, time)) return 1;
    if (SMALL_CONTACT_LAW_2 != 4) return 2;
    if (v[4].offset != offsetof(small, contacts) + sizeof(((small *)0)->contacts[0])) return 2;
    if (v[SMALL_ROWS].count != 12 || v[SMALL_ROWS].access != VI_READ_ONLY) return 3;
    if (v[SMALL_PUSH].access != VI_SET_INPUT || v[SMALL_GAIN].access != VI_SET_TUNABLE) return 4;
    return v[SMALL_CONTACT_LAW_1].type == VI_INT64 && v[SMALL_MOVING].type == VI_BOOLEAN ? 0 : 5;
}
"""
C_STRUCT = """
#include <stdint.h>
typedef struct {
    double time, push, gain;
    struct { int64_t law; double gap; } contacts[2];
    double rows[12];
    int32_t moving;
} small;
"""


@pytest.fixture
def small(tmp_path: Path) -> ComponentDescription:
    path = tmp_path / "variables.toml"
    path.write_text(SMALL, encoding="utf-8")
    return read_component(path)


def problems(tmp_path: Path, old: str, new: str) -> str:
    path = tmp_path / "variables.toml"
    assert old in SMALL
    path.write_text(SMALL.replace(old, new), encoding="utf-8")
    with pytest.raises(ComponentFileError) as caught:
        read_component(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


def attributes(text: str, tag: str) -> list[dict[str, str]]:
    return [element.attrib for element in ElementTree.fromstring(text).iter(tag)]


def test_value_references_count_through_the_file_block_by_block(small: ComponentDescription) -> None:
    assert [v.name for v in small.variables] == [
        *("time", "push", "contact[1].law", "contact[1].gap", "contact[2].law", "contact[2].gap"),
        *("rows", "moving", "gain"),
    ]
    assert [v.value_reference for v in small.variables] == list(range(9))


@pytest.mark.parametrize("contacts", [0, 1, 2])
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_fmpy_finds_nothing_wrong_with_either_version(
    small: ComponentDescription, tmp_path: Path, contacts: int, fmi: str
) -> None:
    # the names in `small` represent all names: FMPy parses one in a hundredth of a second
    for component in (small, *read_components()):
        repeats = {block: 2 for block in component.repeats} | {"contact": contacts}
        text = model_description(component.with_repeats(repeats), fmi)
        (tmp_path / "modelDescription.xml").write_text(text, encoding="utf-8")
        names = component is small
        read = read_model_description(
            str(tmp_path), validate_variable_names=names, validate_model_structure=True
        )
        assert read.modelName == component.name


def test_fewer_contacts_leave_the_other_value_references_alone(small: ComponentDescription) -> None:
    names = {v.name: v.value_reference for v in small.with_repeats({"contact": 1}).variables}
    assert names == {
        v.name: v.value_reference for v in small.variables if not v.name.startswith("contact[2]")
    }


def test_fmi_2_has_no_arrays_and_no_time(small: ComponentDescription) -> None:
    names = [a["name"] for a in attributes(model_description(small, "2.0"), "ScalarVariable")]
    assert "rows" not in names
    assert "time" not in names
    assert "gain" in names


def test_outputs_depend_on_inputs_by_reference_or_by_position(small: ComponentDescription) -> None:
    three = attributes(model_description(small, "3.0"), "Output")
    assert {"valueReference": "3", "dependencies": "1"} in three
    assert {"valueReference": "7", "dependencies": ""} in three
    outputs = ElementTree.fromstring(model_description(small, "2.0")).find("ModelStructure/Outputs")
    assert outputs is not None
    # without time, push is the first variable of FMI 2.0
    assert outputs[0].attrib == {"index": "3", "dependencies": "1"}


def test_numbers_are_spelled_as_xml_schema_wants(small: ComponentDescription) -> None:
    starts = {a["name"]: a.get("start") for a in attributes(model_description(small, "3.0"), "Float64")}
    assert starts["gain"] == "INF"
    assert starts["push"] == "0.0"


def test_both_versions_and_the_c_code_have_one_token_that_follows_the_file(
    small: ComponentDescription, tmp_path: Path
) -> None:
    assert f'instantiationToken="{small.token}"' in model_description(small, "3.0")
    assert f'guid="{small.token}"' in model_description(small, "2.0")
    assert f'.token = "{small.token}",' in c_header(small)
    other = tmp_path / "other.toml"
    other.write_text(SMALL + "# changed\n", encoding="utf-8")
    assert read_component(other).token != small.token


def test_the_generated_header_compiles_and_points_into_the_struct(
    small: ComponentDescription, tmp_path: Path
) -> None:
    (tmp_path / "small.h").write_text(C_STRUCT)
    (tmp_path / header_name(small)).write_text(c_header(small))
    (tmp_path / "main.c").write_text(C_SOURCE)
    folders = [tmp_path, NATIVE / "adapters", NATIVE / "core", fmi_headers()]
    options = ["-std=c11", "-Wall", "-Wextra", "-Wconversion", "-Werror", *(f"-I{f}" for f in folders)]
    program = tmp_path / "program"
    subprocess.run([*find_compiler(), *options, str(tmp_path / "main.c"), "-o", str(program)], check=True)
    assert subprocess.run([str(program)]).returncode == 0


def test_the_readme_shows_a_repeated_block_once(small: ComponentDescription) -> None:
    table = readme_table(small)
    assert "| `contact[k].gap` | output, continuous | m | - | Gap to stop k |" in table
    assert "Law \\| of stop k" in table
    assert "| restitution |" in table
    assert table.count("contact[") == 2


def test_a_readme_keeps_everything_but_its_table(small: ComponentDescription) -> None:
    frame = (
        "# Small\n<!-- variables: generated from variables.toml -->\nold\n<!-- end of variables -->\nafter\n"
    )
    renewed = with_table(frame, small)
    assert renewed.startswith("# Small\n")
    assert renewed.endswith("-->\nafter\n")
    assert "old" not in renewed
    assert with_table(renewed, small) == renewed
    with pytest.raises(ComponentFileError, match="end of variables"):
        with_table("# no markers", small)


def test_the_readmes_of_the_repository_are_up_to_date() -> None:
    assert update_readmes(write=False) == ()


COMMON = """
[[unit]]
name = "N"
base = { kg = 1, m = 1, s = -2 }
[[variable]]
name = "size"
description = "Modes in use"
causality = "parameter"
variability = "fixed"
type = "Int64"
start = 4
min = 1
max = 6
counts = "mode"
field = "size"
code = "SIZE"
[[variable]]
name = "load[{k}]"
description = "Load {k}"
causality = "input"
variability = "continuous"
type = "Float64"
unit = "N"
start = 0.0
field = "load[{i}]"
code = "LOAD"
repeat = "mode"
[[variable]]
name = "answer[{k}]"
description = "Answer {k}"
causality = "output"
variability = "continuous"
type = "Float64"
unit = "N"
field = "answer[{i}]"
code = "ANSWER"
repeat = "mode"
dependencies = ["load[{*}]", "push", "pull"]
"""


@pytest.fixture
def joined(tmp_path: Path) -> ComponentDescription:
    """Return the small component with the content that it shares with others."""
    (tmp_path / "core").mkdir()
    (tmp_path / "core" / "common.toml").write_text(COMMON, encoding="utf-8")
    (tmp_path / "small").mkdir()
    path = tmp_path / "small" / "variables.toml"
    text = SMALL.replace("contacts = 2", 'contacts = 2\nmodes = 6\ninclude = ["../core/common.toml"]')
    path.write_text(text, encoding="utf-8")
    return read_component(path)


def test_included_variables_follow_the_components_own(
    joined: ComponentDescription, small: ComponentDescription
) -> None:
    assert [v.name for v in joined.variables[: len(small.variables)]] == [v.name for v in small.variables]
    assert [v.name for v in joined.variables[9:12]] == ["size", "load[1]", "answer[1]"]
    assert joined.repeats == {"contact": 2, "mode": 6}


def test_an_included_file_is_part_of_the_token(joined: ComponentDescription) -> None:
    common = joined.source.parents[1] / "core" / "common.toml"
    common.write_text(COMMON + "# changed\n", encoding="utf-8")
    assert read_component(joined.source).token != joined.token
    common.unlink()
    with pytest.raises(ComponentFileError, match=r"common\.toml: expected a file"):
        read_component(joined.source)


def test_a_dependency_may_stand_for_a_whole_block(joined: ComponentDescription) -> None:
    answer = next(v for v in joined.with_repeats({"mode": 2}).variables if v.name == "answer[2]")
    # dependencies that this component lacks are left out
    assert joined.with_repeats({"mode": 2}).direct_inputs(answer, 3) == ("load[1]", "load[2]", "push")


def test_what_counts_a_block_starts_with_the_number_asked_for(joined: ComponentDescription) -> None:
    for component, expected in (
        (joined, ("4", "1", "6")),
        (joined.with_repeats({"mode": 2}), ("2", "1", "2")),
    ):
        for fmi, tag in (("3.0", "Int64"), ("2.0", "Integer")):
            values = attributes(model_description(component, fmi), tag)[0]
            assert (values["start"], values["min"], values["max"]) == expected
    (joined.source.parent / "modelDescription.xml").write_text(
        model_description(joined, "3.0"), encoding="utf-8"
    )
    assert validate_fmu(str(joined.source.parent)) == []


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'type = "Boolean"',
            'type = "Bool"',
            "expected one of Float64, Int64, Boolean, Enumeration, Clock, got 'Bool'",
        ),
        ('unit = "m"', 'unit = "metre"', "unit: expected a unit of the file, got 'metre'"),
        ('enumeration = "Law"', 'enumeration = "Lore"', "enumeration: expected"),
        ('variability = "tunable"', 'variability = "continuous"', "variability: expected"),
        ('dependencies = ["push"]', 'dependencies = ["pull"]', "dependencies: expected"),
        ("contacts = 2", "", "repeat: expected a count"),
        ("start = inf", 'start = inf\ncounts = "mode"', "counts: expected a repeated block of the file"),
        ('dependencies = ["push"]', 'dependencies = ["push[{*}]"]', "dependencies: expected"),
        ("start = inf", "", "start: expected"),
        ('code = "GAIN"', "", "gain: expected the keys code"),
        ('code = "GAIN"', 'code = "GAIN"\ncolour = "red"', "got colour"),
        ('name = "push"', 'name = "gain"', "unique"),
        ('causality = "independent"', 'causality = "local"', "time first"),
        ("base = { m = 1 }", "base = { metre = 1 }", "base units"),
        ('struct = "small"', "", "component.struct: expected a string"),
        ("[component]", "[component", "expected a TOML file"),
    ],
)
def test_a_mistake_in_variables_toml_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert words in problems(tmp_path, old, new)


def test_all_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    path = tmp_path / "variables.toml"
    path.write_text(
        SMALL.replace('unit = "m"', 'unit = "x"').replace('"Boolean"', '"Bool"'), encoding="utf-8"
    )
    with pytest.raises(ComponentFileError) as caught:
        read_component(path)
    assert len(str(caught.value).splitlines()) == 2
