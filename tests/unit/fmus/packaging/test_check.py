"""`fmu check` finds faults that a validator of the description alone misses."""

import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from fmpy.validation import validate_fmu
from support import fmu_factory
from support.fmpy_checks import validate

from vibroimpact.fmus import component_name, components, fmu_path
from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.packaging import load_check
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.build import is_current
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.model_description import Grade
from vibroimpact.fmus.packaging.platform_names import binary_folder, library_suffix

VERSIONS = ("2.0", "3.0")
SUFFIX = library_suffix()


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


def changed(path: Path, target: Path, change: Callable[[str, bytes], tuple[str, bytes]]) -> Path:
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(target, "w") as out:
        for name in source.namelist():
            out.writestr(*change(name, source.read(name)))
    return target


def with_text(old: str, new: str) -> Callable[[str, bytes], tuple[str, bytes]]:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        described = name == "modelDescription.xml"
        assert not described or old.encode() in content
        return name, content.replace(old.encode(), new.encode()) if described else content

    return change


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("name", components())
def test_every_fmu_of_the_package_passes(name: str, fmi: str) -> None:
    assert check_fmu(fmu_path(name, fmi)) == ()


def test_the_built_fmus_belong_to_the_present_sources() -> None:
    assert is_current(), "run `python -m vibroimpact.fmus.packaging.build`"


def test_a_misspelt_capability_is_found_though_the_schema_lets_it_pass(tmp_path: Path) -> None:
    change = with_text("canGetAndSetFMUState", "canGetAndSetFMUstate")
    path = changed(fmu_path("Oscillator"), tmp_path / "O.fmu", change)
    assert validate(path) == ()
    problems = check_fmu(path)
    assert [problem.text.partition(":")[0] for problem in problems] == ["ModelExchange", "CoSimulation"]
    assert all("got canGetAndSetFMUstate. Did you mean canGetAndSetFMUState?" in one.text for one in problems)
    assert {one.grade for one in problems} == {Grade.doubt}


@pytest.mark.parametrize(
    ("name", "is_legal"),
    [
        *(("a.b[2,31].c_1", True), ("_x", True), ("der(x)", True), ("'any thing'", True)),
        *(("any thing", False), ("a[1", False), ("a[]", False), ("1a", False), ("a..b", False), ("ä", False)),
        ("output", False),  # listed twice
    ],
)
def test_names_are_judged_as_by_fmpy(tmp_path: Path, name: str, is_legal: bool) -> None:
    path = changed(fmu_path("Gain"), tmp_path / "G.fmu", with_text('name="gain"', f'name="{name}"'))
    assert validate(path) == tuple(validate_fmu(str(path)))
    assert (validate(path) == ()) == (check_fmu(path) == ()) == is_legal


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_token_that_is_not_the_binarys_is_found(tmp_path: Path, fmi: str) -> None:
    token = unpack(fmu_path("Oscillator", fmi)).token
    change = with_text(token, "{00000000-0000-0000-0000-000000000000}")
    found = check_fmu(changed(fmu_path("Oscillator", fmi), tmp_path / "O.fmu", change))
    assert all("expected an instance for the token of the description" in one.text for one in found)
    assert Grade.refused in {one.grade for one in found}


def test_a_declared_binary_that_is_absent_is_found(tmp_path: Path) -> None:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        return name.replace(f"/Oscillator{SUFFIX}", f"/Other{SUFFIX}"), content

    problems = check_fmu(changed(fmu_path("Oscillator"), tmp_path / "O.fmu", change))
    folder = f"binaries/{binary_folder('3.0')}"
    assert f"{folder}/Oscillator{SUFFIX}: expected this file" in problems[0].text
    (refused,) = [one.text for one in problems if one.grade is Grade.refused]
    assert f"got '{folder}/Other{SUFFIX}'. Its file and the modelIdentifier" in refused


def test_a_binary_that_does_not_load_is_found(tmp_path: Path) -> None:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        return name, b"no machine code" if name.startswith("binaries/") else content

    (problem,) = check_fmu(changed(fmu_path("Oscillator"), tmp_path / "O.fmu", change))
    assert "expected a library that loads" in problem.text
    assert "/binaries/" not in problem.text
    assert problem.grade is Grade.refused


@pytest.mark.parametrize("declared", [True, False])
def test_an_fmu_may_make_instances_in_event_mode_alone(
    monkeypatch: pytest.MonkeyPatch, declared: bool
) -> None:
    def instance(library: object, facts: object, token: bytes, *, event_mode: bool = False) -> int:
        return int(event_mode)

    monkeypatch.setattr(load_check, "instance3", instance)
    assert load_check._opens(object(), {"fmi_version": "3.0", "event_mode": declared}, "token") == declared  # type: ignore[arg-type]


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_instances_that_share_memory_are_found_unless_only_one_may_be(tmp_path: Path, fmi: str) -> None:
    only_once = fmu_factory.single(tmp_path, fmi)
    lie = ('canBeInstantiatedOnlyOncePerProcess="true"', "")
    (found,) = check_fmu(fmu_factory.redescribed(only_once, tmp_path / "lying.fmu", lie))
    assert "a step of one instance changes y of another" in found.text
    assert found.grade is Grade.doubt
    assert not any("common memory" in one.text for one in check_fmu(only_once))
    assert not any("common memory" in one.text for one in check_fmu(fmu_factory.mass(tmp_path, fmi)))


def test_a_function_that_does_not_resolve_is_found(tmp_path: Path) -> None:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        renamed = content.replace(b"\0fmi3GetShiftDecimal\0", b"\0fmi3GetShiftDecimax\0")
        return name, renamed if name.startswith("binaries/") else content

    problems = check_fmu(changed(fmu_path("Oscillator"), tmp_path / "O.fmu", change))
    assert "got none called fmi3GetShiftDecimal" in problems[0].text
    assert {one.grade for one in problems} == {Grade.remark}  # runs call it only for FMUs with clocks


def test_a_function_that_each_run_calls_is_a_refusal(tmp_path: Path) -> None:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        renamed = content.replace(b"\0fmi3DoStep\0", b"\0fmi3DoStex\0")
        return name, renamed if name.startswith("binaries/") else content

    problems = check_fmu(changed(fmu_path("Gain"), tmp_path / "G.fmu", change))
    assert [(one.grade, "got none called fmi3DoStep" in one.text) for one in problems] == [
        (Grade.refused, True)
    ]


@pytest.mark.parametrize("declared", [True, False])
def test_functions_of_states_are_needed_by_an_fmu_that_declares_states(
    tmp_path: Path, declared: bool
) -> None:
    def change(name: str, content: bytes) -> tuple[str, bytes]:
        if name == "modelDescription.xml" and not declared:
            return name, content.replace(b'canGetAndSetFMUstate="true"', b'canGetAndSetFMUstate="false"')
        renamed = content.replace(b"\0fmi2GetFMUstate\0", b"\0fmi2GetFMUstatx\0")
        return name, renamed if name.startswith("binaries/") else content

    (problem,) = check_fmu(changed(fmu_path("Gain", "2.0"), tmp_path / "G.fmu", change))
    assert "got none called fmi2GetFMUstate." in problem.text
    assert problem.grade is (Grade.refused if declared else Grade.remark)


def test_a_file_that_is_no_fmu_is_one_problem(tmp_path: Path) -> None:
    path = tmp_path / "O.fmu"
    path.write_bytes(b"nothing")
    (problem,) = check_fmu(path)
    assert problem.text.startswith("expected an FMU (a zip archive), got")


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("contacts", [0, 1, 2])
def test_an_exported_fmu_has_just_the_contacts_asked_for_and_passes(
    tmp_path: Path, contacts: int, fmi: str
) -> None:
    path = export_fmu("oscillator", tmp_path / "O.fmu", contacts=contacts, fmi=fmi)
    assert check_fmu(path) == ()
    names = {v.name for v in read_description(path).modelVariables}
    assert {name.split(".")[0] for name in names if name.startswith("contact[")} == {
        f"contact[{k + 1}]" for k in range(contacts)
    }
    assert (unpack(path).resources / "sizes.txt").read_text() == f"contacts {contacts}\nexternal_laws 0\n"


def test_an_export_needs_no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("VIBROIMPACT_CC", "no-such-compiler")
    assert export_fmu("Oscillator", tmp_path / "O.fmu", contacts=1).is_file()


def test_the_same_export_twice_gives_the_same_bytes_but_for_its_date(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    one, other = (export_fmu("Oscillator", tmp_path / name, contacts=1) for name in ("a.fmu", "b.fmu"))
    assert one.read_bytes() == other.read_bytes()


def test_more_contacts_than_were_compiled_in_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="contacts: expected 0 to 2, got 3"):
        export_fmu("Oscillator", tmp_path / "O.fmu", contacts=3)


def test_an_unknown_component_gets_the_nearest_name_offered() -> None:
    with pytest.raises(ComponentFileError, match="Did you mean Oscillator"):
        fmu_path("Oscilator")


def test_a_component_is_known_in_any_spelling_of_its_name() -> None:
    for name in components():
        words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
        for sign in "-_ ":
            assert component_name(words.replace(" ", sign)) == name
            assert component_name(words.replace(" ", sign).lower()) == name
        assert component_name(name.upper()) == name
    for nothing in ("", "-", "impact stop!1"):
        with pytest.raises(ComponentFileError, match="component: expected one of"):
            component_name(nothing)


def test_an_unknown_version_is_refused() -> None:
    with pytest.raises(ComponentFileError, match=r"expected FMI version 3\.0 or 2\.0, got '1\.0'"):
        fmu_path("Oscillator", fmi="1.0")
