"""Descriptions as other tools write them: read if no number changes, with a report of the assumptions."""

from __future__ import annotations

import time
from importlib.metadata import version

import pytest
from scaling.descriptions import all_tokens
from support.fmpy_checks import description_problems

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.fmpy_door import Reading, read
from vibroimpact.fmus.packaging.model_description import Finding, Grade, schema


def content_of(name: str, fmi: str, *changes: tuple[str, str]) -> bytes:
    text = (unpack(fmu_path(name, fmi)).folder / "modelDescription.xml").read_text()
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return text.encode()


def gain2(*changes: tuple[str, str]) -> Reading:
    return read(content_of("Gain", "2.0", *changes))


def gain3(*changes: tuple[str, str]) -> Reading:
    return read(content_of("Gain", "3.0", *changes))


def only(reading: Reading) -> Finding:
    (finding,) = reading.findings
    return finding


def variable(reading: Reading, name: str):  # type: ignore[no-untyped-def]
    return next(v for v in reading.description.modelVariables if v.name == name)


GAIN = 'causality="parameter" variability="fixed" initial="exact"'
OUTPUT = 'causality="output" variability="continuous" initial="calculated"'
ROOT = '<fmiModelDescription fmiVersion="2.0"'
UNKNOWNS2 = '<InitialUnknowns>\n      <Unknown index="3" />\n    </InitialUnknowns>'


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("name", ["Gain", "Oscillator"])
def test_a_description_without_a_fault_is_read_as_it_is(name: str, fmi: str) -> None:
    assert read(content_of(name, fmi)).findings == ()


def test_dymolas_namespaces_and_annotations_are_no_findings() -> None:
    namespaces = 'xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance" xsi:noNamespaceSchemaLocation="x.xsd"'
    own = '<GraphicsGroup coordinateSystem="1"/><ScalarVariable name="x"/>text<Tool/>'
    tool = f'<VendorAnnotations><Tool name="Dymola">{own}</Tool></VendorAnnotations>'
    for before in ("  <DefaultExperiment", "  <ModelVariables>"):  # Dymola writes them before the experiment
        found = gain2((ROOT, f"{ROOT} {namespaces}"), (before, f"  {tool}{before}"))
        assert found.findings == ()


def test_annotations_of_variables_are_a_tools_own() -> None:
    own = '<Annotations><Annotation type="t"><a/><b c="1"/></Annotation></Annotations>'
    start = '<Float64 name="gain" valueReference="1"'
    found = gain3(
        (start, f'<Float64 name="other" valueReference="99" causality="local">{own}</Float64>{start}')
    )
    assert [one.text for one in found.findings] == []


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_missing_unknowns_of_initialization_are_a_remark(fmi: str) -> None:
    listed = UNKNOWNS2 if fmi == "2.0" else '<InitialUnknown valueReference="3" />'
    finding = only(read(content_of("Gain", fmi, (listed, ""))))
    assert finding.grade is Grade.remark
    assert "expected its unknowns of initialization, got none of output" in finding.text


def test_sianis_empty_lists_are_no_lists() -> None:
    outputs = '<Outputs>\n      <Unknown index="3" dependencies="2" />\n    </Outputs>'
    empty = "<Outputs>\n\n</Outputs><Derivatives/>", "<InitialUnknowns/>"
    found = gain2((outputs, empty[0]), (UNKNOWNS2, empty[1]))
    without = gain2((outputs, ""), (UNKNOWNS2, ""))
    names = "Outputs", "Derivatives", "InitialUnknowns"
    lists = {f"{name}: expected a list with entries, got an empty one. Read as none." for name in names}
    assert {one.text for one in found.findings if one.grade is Grade.remark} >= lists
    assert {one for one in found.findings if one.text not in lists} == set(without.findings)


@pytest.mark.parametrize("kind", ["Integer", "Boolean", "String"])
def test_simulinks_outputs_without_variability_are_discrete(kind: str) -> None:
    found = gain2((f"{OUTPUT}>\n      <Real />", f'causality="output"><{kind} />'))
    assert only(found).grade is Grade.remark
    assert "got none. Read as discrete." in only(found).text
    assert variable(found, "output").variability == "discrete"


def test_simulinks_enumeration_without_variability_is_discrete() -> None:
    items = '<Enumeration><Item name="a" value="1"/></Enumeration>'
    types = f'<TypeDefinitions><SimpleType name="E">{items}</SimpleType></TypeDefinitions>'
    found = gain2(
        ("  <LogCategories>", f"  {types}<LogCategories>"),
        (f"{GAIN}>\n      <Real start", 'causality="local"><Enumeration declaredType="E" quantity'),
    )
    assert "of a local of type Enumeration, got none. Read as discrete." in only(found).text
    read_as = variable(found, "gain")
    assert (read_as.variability, read_as.initial, read_as.declaredType.items[0].name) == (
        "discrete",
        "calculated",
        "a",
    )


def test_pythonfmus_parameter_without_variability_is_fixed_and_can_be_set() -> None:
    found = gain2((GAIN, 'causality="parameter"'))
    assert only(found).grade is Grade.remark
    assert (variable(found, "gain").variability, variable(found, "gain").initial) == ("fixed", "exact")


def test_a_parameter_that_is_constant_takes_no_value() -> None:
    found = gain2((GAIN, 'causality="parameter" variability="constant" initial="exact"'))
    assert only(found) == Finding(
        Grade.remark,
        "variable gain: expected a variability of a parameter, got constant. No value can be given to it.",
    )
    assert (variable(found, "gain").causality, variable(found, "gain").variability) == ("local", "constant")


def test_a_start_value_of_what_is_calculated_is_not_used() -> None:
    found = gain2((f"{OUTPUT}>\n      <Real />", f'{OUTPUT}>\n      <Real start="1" />'))
    assert only(found).grade is Grade.remark
    assert variable(found, "output").start is None


def test_a_unit_that_means_none_is_none_and_another_is_a_doubt() -> None:
    dash = gain2(("<Real />", '<Real unit="-" />'))
    assert only(dash).grade is Grade.remark
    assert variable(dash, "output").unit is None
    odd = gain2(("<Real />", '<Real unit="furlong" displayUnit="mile" />'))
    assert [one.grade for one in odd.findings] == [Grade.doubt, Grade.remark]
    assert (
        "expected a unit that is defined, got 'furlong'. Its values are passed on unchanged."
        in odd.findings[0].text
    )
    assert variable(odd, "output").unit == "furlong"


def test_a_display_unit_without_a_unit_is_a_remark() -> None:
    assert only(gain2(("<Real />", '<Real displayUnit="mm" />'))).grade is Grade.remark


def test_an_input_that_is_fixed_is_a_doubt_since_it_will_be_set_all_the_same() -> None:
    found = gain2(('causality="input" variability="continuous"', 'causality="input" variability="fixed"'))
    assert only(found).grade is Grade.doubt
    assert "Read as continuous." in only(found).text


def test_an_output_that_model_structure_lacks_is_a_doubt() -> None:
    found = gain3(('<Output valueReference="3" dependencies="2" />', ""))
    assert only(found) == Finding(
        Grade.doubt,
        "ModelStructure: expected all outputs, got none of output. Taken to depend on no input.",
    )


def test_dependencies_on_no_variable_are_a_doubt_and_not_those_of_another() -> None:
    found = gain2(('dependencies="2"', 'dependencies="0"'))  # FMPy counts from the end there
    assert only(found).grade is Grade.doubt
    assert found.description.outputs[0].dependencies is None


def test_a_declared_type_that_is_not_defined_is_a_doubt() -> None:
    found = gain2(("<Real />", '<Real declaredType="Modelica.Mass" />'))
    assert only(found).grade is Grade.doubt
    assert "got Modelica.Mass. Its unit and limits are unknown." in only(found).text


def test_an_attribute_of_no_consequence_with_a_bad_value_is_a_remark_and_others_are_refused() -> None:
    assert only(gain2((ROOT, f'{ROOT} generationDateAndTime="today"'))).grade is Grade.remark
    assert only(gain2(("<Real />", '<Real min="low" />'))).grade is Grade.doubt
    for change in (
        ('valueReference="3"', 'valueReference="three"'),
        ('causality="output"', 'causality="cause"'),
    ):
        with pytest.raises(ComponentFileError, match=r"modelDescription\.xml: line \d+: "):
            gain2(change)


@pytest.mark.parametrize(("written", "read_as"), [("True", True), ("FALSE", False)])
def test_truth_in_capitals_is_truth(written: str, read_as: bool) -> None:
    flag = 'canHandleVariableCommunicationStepSize="{}"'
    found = gain2((flag.format("true"), flag.format(written)))
    assert only(found).grade is Grade.remark
    assert found.description.coSimulation.canHandleVariableCommunicationStepSize is read_as
    with pytest.raises(ComponentFileError, match="'maybe' is not a valid value"):
        gain2((flag.format("true"), flag.format("maybe")))


def test_an_element_elsewhere_is_read_there_and_one_of_no_meaning_left_out() -> None:
    text = content_of("Gain", "2.0").decode()
    begin, end = text.index("  <DefaultExperiment"), text.index("  <ModelVariables>")
    experiment = text[begin:end]
    moved = text[:begin] + text[end:]
    found = read(moved.replace("</ModelStructure>", f"</ModelStructure>{experiment}").encode())
    assert only(found).grade is Grade.remark
    assert found.description.defaultExperiment.stepSize == "0.01"
    assert only(gain2(("  <ModelVariables>", "<Extra/><ModelVariables>"))).grade is Grade.remark


@pytest.mark.parametrize(
    ("change", "got"),
    [
        (
            ('name="input"', 'name="gain"'),
            "variable gain: expected names of one variable each, got them twice.",
        ),
        (('fmiVersion="2.0"', 'fmiVersion="1.0"'), "expected FMI 2.0 or 3.0, got FMI 1.0"),
        (("</ModelStructure>", "</ModelStructure><!DOCTYPE x>"), "modelDescription.xml"),
    ],
)
def test_what_has_no_way_round_is_refused(change: tuple[str, str], got: str) -> None:
    with pytest.raises(ComponentFileError) as refusal:
        gain2(change)
    assert got in str(refusal.value)


def test_variables_with_the_same_fault_share_a_line_of_bounded_length() -> None:
    many = "".join(
        f'<ScalarVariable name="{"p" * 1000}{k}" valueReference="{k}" causality="parameter">'
        '<Real start="1"/></ScalarVariable>'
        for k in range(10, 2010)
    )
    found = gain2(("</ModelVariables>", f"{many}</ModelVariables>"))
    assert only(found).text.startswith("variables ppp")
    assert "and 1995 more: expected a variability" in only(found).text
    assert len(only(found).text) < 600


def many_variables(wrong: dict[int, str]) -> tuple[str, str]:
    """Return a change that adds 1,300 variables, with an addition to some of them."""
    more = "".join(
        f'<Float64 name="v{k}" valueReference="{k + 100}" causality="local"{wrong.get(k, "")}/>'
        for k in range(1300)
    )
    return ("</ModelVariables>", f"{more}</ModelVariables>")


@pytest.mark.parametrize("place", [0, 496, 497, 498, 499, 996, 1299])
def test_a_fault_is_found_at_any_place_among_many_variables(place: int) -> None:
    found = gain3(many_variables({place: ' min="word"'}))
    assert (
        only(found).text == "Float64: min: expected a value that FMI allows, got 'word'. It is not looked at."
    )
    assert [v.name for v in found.description.modelVariables[-1300:]] == [f"v{k}" for k in range(1300)]
    with pytest.raises(ComponentFileError, match="xs:boolean"):
        gain3(
            many_variables(
                {place: ' clearAtReset="word" canHandleMultipleSetPerTimeInstant="word"', 3: ' min="word"'}
            )
        )


@pytest.mark.parametrize("size", [1, 2, 5, 36])
def test_what_is_shown_at_a_time_changes_no_finding(monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    kinds = [one for one in all_tokens() if one.parser == "FMU description"]
    contents = {one.kind: one.content(37) for one in kinds if one.kind != "odd elements of one name"}
    assert len(contents) > 40
    whole = {kind: _found(content) for kind, content in contents.items()}
    monkeypatch.setattr(schema, "_WINDOW", size)
    assert {kind: _found(content) for kind, content in contents.items()} == whole


def _found(content: bytes) -> object:
    try:
        return sorted((finding.grade.name, finding.text) for finding in read(content).findings)
    except ComponentFileError as refusal:
        return str(refusal)


@pytest.mark.parametrize("place", [3, 499, 500, 501, 1299])
def test_an_order_that_fmi_does_not_have_is_refused_at_any_place(place: int) -> None:
    listed = ['<Output valueReference="3"/>'] * 1300
    listed[place] = '<InitialUnknown valueReference="3"/><Output valueReference="3"/>'
    with pytest.raises(ComponentFileError, match="This element is not expected"):
        gain3(("</ModelStructure>", f"{''.join(listed)}</ModelStructure>"))


#: Changes of a description of FMI 2.0; FMPy finds a fault in each, or none.
CHANGES = (
    ("<Real />", "<Real/>"),
    (GAIN, 'causality="parameter"'),
    (GAIN, 'causality="parameter" variability="tunable"'),
    (GAIN, 'causality="parameter" variability="discrete" initial="exact"'),
    (GAIN, 'causality="parameter" variability="fixed" initial="calculated"'),
    (GAIN, 'causality="calculatedParameter" variability="fixed" initial="exact"'),
    (GAIN, 'causality="local" variability="fixed" initial="exact"'),
    (GAIN, 'causality="local" variability="constant"'),
    ('<Real start="0.0" />', "<Real />"),
    ('<Real start="1.0" />', "<Real />"),
    ('causality="input" variability="continuous"', 'causality="input" variability="tunable"'),
    (OUTPUT, 'causality="output" variability="fixed" initial="calculated"'),
    (OUTPUT, 'causality="output" variability="constant"'),
    (OUTPUT, 'causality="output" initial="exact"'),
    (OUTPUT, 'causality="output" initial="approx"'),
    (OUTPUT, 'causality="independent" variability="continuous"'),
    ("<Real />", '<Real unit="s" />'),
    ("<Real />", '<Real unit="m" />'),
    ("<Real />", '<Real unit="s" displayUnit="ms" />'),
    ("<Real />", "<Boolean />"),
    ('name="gain"', 'name="a gain"'),
    ('name="gain"', 'name="der(gain,2)"'),
    ('dependencies="2"', 'dependencies="2" dependenciesKind="constant"'),
    ('dependencies="2"', 'dependencies="2" dependenciesKind="constant fixed"'),
    ('<Unknown index="3" dependencies="2" />', '<Unknown index="2" />'),
    ('<Unknown index="3" />', '<Unknown index="1" />'),
    ("<Real />", '<Real declaredType="T" />'),
    ("<Real />", '<Real derivative="9" />'),
    ("<Real />", '<Real min="1" max="0" />'),
    (ROOT, f'{ROOT} generationDateAndTime="2020"'),
)  # fmt: skip


@pytest.mark.parametrize("change", CHANGES)
def test_nothing_is_said_where_fmpy_says_nothing_and_something_where_it_does(change: tuple[str, str]) -> None:
    content = content_of("Gain", "2.0", change)
    fmpy = description_problems(content)
    try:
        found: tuple[object, ...] = read(content).findings
    except ComponentFileError as refusal:
        found = (refusal,)
    # an older FMPy checks less
    is_older = tuple(map(int, version("fmpy").split(".")[:3])) < (0, 3, 32)
    assert bool(found) == bool(fmpy) or (found and is_older), (found, fmpy)


def seconds_to_read(name: str) -> float:
    """Return the processor time for reading a description of 758 variables with such names."""
    many = "".join(
        f'<ScalarVariable name="{name.format(k)}" valueReference="{k}" causality="local"><Real/></ScalarVariable>'
        for k in range(10, 765)
    )
    content = content_of("Gain", "2.0", ("</ModelVariables>", f"{many}</ModelVariables>"))
    read(content)
    began = time.process_time()
    read(content)
    return time.process_time() - began


def test_names_of_any_kind_are_judged_as_fast_as_plain_ones() -> None:
    # FMPy's grammar takes a hundredth of a second for a name: 4 s for these, and a tenth of a second for the rest
    assert seconds_to_read("Thruster {}.'any state'") < 5.0 * seconds_to_read("thruster_{}")


def test_a_reference_of_five_thousand_digits_is_refused_in_a_line() -> None:
    """Python does not convert texts of so many digits; FMI's schema allows zeros before a number."""
    with pytest.raises(ComponentFileError, match="4300 digits") as refused:
        gain3(('valueReference="3"', f'valueReference="{"0" * 5000}3"'))
    assert len(str(refused.value)) < 1000
