"""Archives that are damaged, hostile or unsupported: one line with the remedy, and no file written."""

from __future__ import annotations

import re
import stat
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest
from support.command_line import in_this_process
from support.ssp_files import (
    archive,
    component,
    connection,
    connector,
    entry,
    factor,
    mapping,
    real,
    ssd,
    ssv,
    system,
    values,
)

from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.values import read_parameter_set

BODY = connector("displacement", "output") + connector("force", "input")


@pytest.fixture(scope="module")
def body(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """An FMU without a mark of this package."""
    return export_fmu("oscillator", tmp_path_factory.mktemp("fmu") / "body.fmu", fmi="2.0").read_bytes()


def part(name: str = "body", source: str = "resources/body.fmu", bindings: str = "", more: str = "") -> str:
    return component(name, source, BODY, bindings, more)


def bound(source: str, more: str = "") -> str:
    return f'<ssd:ParameterBinding source="{source}" {more}/>'


def nested(depth: int) -> str:
    return part() if depth == 0 else system(f"s{depth}", nested(depth - 1))


def noted(text: str, more: str = "") -> str:
    note = f'<v:Scene xmlns:v="urn:vibroimpact:ssp"><v:Tables>{text}</v:Tables>{more}</v:Scene>'
    return f'<ssd:Annotations><ssc:Annotation type="vibroimpact">{note}</ssc:Annotation></ssd:Annotations>'


TWO = part("a") + part("b")
BUS = (
    '<ssd:SignalDictionaryReference name="bus" dictionary="d"><ssd:Connectors>'
    '<ssd:Connector name="x" kind="inout"/></ssd:Connectors></ssd:SignalDictionaryReference>'
)
MAP_ENTRY = '<ssc:MapEntry source="1" target="2"/>'
DESCRIPTIONS: dict[str, tuple[str, str]] = {
    "no component": (ssd(""), "expected a system with components"),
    "no such file": (ssd(part(source="resources/other.fmu")), "which it does not have"),
    "out of the archive": (ssd(part(source="../body.fmu")), "expected a file of the archive"),
    "out of it, in disguise": (
        ssd(part(source="resources/%2e%2e/%2e%2e/x.fmu")),
        "expected a file of the archive",
    ),
    "an absolute path": (ssd(part(source="/etc/passwd")), "expected a file of the archive"),
    "a drive": (ssd(part(source="C:/body.fmu")), "expected a file of the archive"),
    "a file address": (ssd(part(source="file:///etc/passwd")), "expected a file of the archive"),
    "a web address": (ssd(part(source="http://a.example/b.fmu")), "expected a file of the archive"),
    "another host": (ssd(part(source="//host/b.fmu")), "expected a file of the archive"),
    "brackets of no address": (ssd(part(source="http://[b.fmu")), "Pack the file into its resources folder"),
    "a part of a file": (ssd(part(source="#other")), "expected a whole file of the archive"),
    "values out of it": (ssd(part(bindings=bound("../x.ssv"))), "expected a file of the archive"),
    "values in the FMU": (ssd(part(bindings=bound("x.ssv", 'sourceBase="component"'))), "Copy the file out"),
    "values of another kind": (ssd(part(bindings=bound("resources/body.fmu"))), "expected well-formed XML"),
    "a system in a file": (
        ssd(part(more='type="application/x-ssp-package"')),
        "resources/body.fmu: expected a safe SSP, got: no SystemStructure.ssd",
    ),
    "a model that another kind of tool schedules": (
        ssd(part(more='implementation="ScheduledExecution"')),
        "expected any, CoSimulation or ModelExchange",
    ),
    "a dictionary that is not there": (
        ssd(part() + BUS, connection("bus.x", "body.force")),
        'expected a signal dictionary, got "d"',
    ),
    "too deep": (ssd(nested(60)), "at most 50 systems in each other"),
    "a crowd": (ssd("".join(part(f"n{k}") for k in range(1001))), "at most 1000 components"),
    "a long name": (ssd(part(bindings=values({"a." * 5000: real(1.0)}))), "a name of at most"),
    "a name twice": (ssd(part() + part()), "a name of its own for each element"),
    "another version": (ssd(part(), version="3.0"), 'got "3.0"'),
    "no system": ("<a/>", "expected <ssd:SystemStructureDescription>"),
    "entities": ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "document type declaration"),
    "no XML": ("SystemStructure", "expected well-formed XML"),
    "an unknown element": (ssd(part(), connection("other.x", "body.force")), "an element of its system"),
    "an unknown connector": (ssd(part(), connection("body.x", "body.force")), "a connector of body"),
    "two sources": (
        ssd(TWO, connection("a.displacement", "b.force") * 2),
        "an input of its own for each connection",
    ),
    "two outputs": (ssd(TWO, connection("a.displacement", "b.displacement")), "an end that gives a value"),
    "metres to newtons": (
        ssd(TWO, connection("a.displacement", "b.force")),
        "Give it a LinearTransformation",
    ),
    "a number that is none": (
        ssd(TWO, connection("a.displacement", "b.force", factor(float("nan")))),
        "finite",
    ),
    "a table of values": (
        ssd(
            TWO,
            connection(
                "a.displacement",
                "b.force",
                f"<ssc:IntegerMappingTransformation>{MAP_ENTRY}</ssc:IntegerMappingTransformation>",
            ),
        ),
        "expected a mapping only between whole numbers",
    ),
    "a mapped table of values": (
        ssd(
            part(
                bindings=values(
                    {"m": real(1.0)},
                    "",
                    mapping(entry("m", "mass", "<ssc:BooleanMappingTransformation/>")),
                )
            )
        ),
        "BooleanMappingTransformation: expected 1 to 10000 entries, got 0",
    ),
    "ends of no kind": (
        ssd(part("a").replace(' kind="output"', "") + part("b"), connection("a.displacement", "b.force")),
        'got "none and input". The kinds of its connectors say it',
    ),
    "a whole number beyond its type": (
        ssd(part(bindings=values({"mass": f'<ssv:Integer value="{"9" * 400}"/>'}))),
        "expected a whole number of 64 bits",
    ),
    "a whole number as Python writes it": (
        ssd(part(bindings=values({"impact_limit": '<ssv:Integer value="1_0"/>'}))),
        'expected a whole number of 64 bits, got "1_0"',
    ),
    "digits of another script": (
        ssd(part(bindings=values({"mass": '<ssv:Real value="٣"/>'}))),
        'expected a finite number, got "٣"',
    ),
    "two numbers for one": (ssd(part(bindings=values({"mass": real(1.0) + real(2.0)}))), "got Real, Real"),
    "a step of no time": (
        ssd(TWO, connection("a.displacement", "b.force", factor(1.0)), step=0.0),
        'macro_step: expected a number > 0, or "auto", got 0.0',
    ),
    "an array": (ssd(part(bindings=values({"mass": real(1.0).replace("1.0", "1 2")}))), "finite number"),
    "a value out of range": (ssd(part(bindings=values({"mass": real(-1.0)}))), "got -1"),
    "bytes": (ssd(part(bindings=values({"mass": '<ssv:Binary value="00"/>'}))), "got Binary"),
    "an end before the start": (
        ssd(part(), times='startTime="3" stopTime="2"'),
        "expected an end after the start",
    ),
    "an endless run": (ssd(part(), times='stopTime="INF"'), "finite number"),
    "a note that is no TOML": (ssd(part(), more=noted("a = ")), "Take the annotation out"),
    "a note that says components": (
        ssd(part(), more=noted('[component.x]\nfmu = "/etc/x.fmu"')),
        "The system itself says it",
    ),
    "a note of another body": (ssd(part(), more=noted("[body]\nmass = 1")), "component: expected"),
    "a component that we have not": (
        ssd(part(), more=noted("", '<v:Component name="body" fmu="../Oscillator" fmi="3.0"/>')),
        "the FMU of the archive is used",
    ),
}


def refused(folder: Path, path: Path) -> str:
    """Return the one line with which the command line refuses an archive."""
    before = {file for file in folder.rglob("*") if file != path}
    done = in_this_process("ssp", "import", path, "-o", folder / "scene.toml")
    assert done.returncode == 2, done.stderr
    assert {file for file in folder.rglob("*") if file != path} == before
    (line,) = done.stderr.strip().splitlines()
    assert str(path) in line
    assert "Traceback" not in line
    assert len(line) < 1000
    return line


@pytest.mark.parametrize("name", DESCRIPTIONS)
def test_what_cannot_run_is_one_line_with_the_way_out(tmp_path: Path, body: bytes, name: str) -> None:
    description, expected = DESCRIPTIONS[name]
    path = archive(tmp_path / "s.ssp", description, {"resources/body.fmu": body})
    assert expected in refused(tmp_path, path)


def _twice(file: zipfile.ZipFile) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        file.writestr("SystemStructure.ssd", "<other/>")


def _link(file: zipfile.ZipFile) -> None:
    info = zipfile.ZipInfo("resources/link")
    info.create_system, info.external_attr = 3, (stat.S_IFLNK | 0o777) << 16
    file.writestr(info, "/etc/passwd")


def _bomb(file: zipfile.ZipFile) -> None:
    file.writestr("big", "x")
    file.filelist[-1].file_size = 1 << 31


@pytest.mark.parametrize(
    ("spoil", "expected"),
    [
        (lambda file: file.writestr("../outside", "x"), "leads out of the archive"),
        (lambda file: file.writestr("/outside", "x"), "absolute path"),
        (lambda file: file.writestr("resources\\x", "x"), "backslash"),
        (_link, "is a link or a device"),
        (_twice, "two members have the same name"),
        (_bomb, "bytes when unpacked, limit"),
    ],
    ids=["out", "absolute", "backslash", "link", "twice", "bomb"],
)
def test_an_unsafe_archive_is_refused_before_a_byte_is_unpacked(
    tmp_path: Path, body: bytes, spoil: Callable[[zipfile.ZipFile], None], expected: str
) -> None:
    path = archive(tmp_path / "s.ssp", ssd(part()), {"resources/body.fmu": body})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        spoil(file)
    line = refused(tmp_path, path)
    assert expected in line
    assert "expected a safe SSP" in line


def test_what_is_no_archive_and_what_is_none_of_a_system_are_refused(tmp_path: Path, body: bytes) -> None:
    path = tmp_path / "s.ssp"
    assert "expected an SSP file, got" in refused(tmp_path, path)
    path.write_bytes(b"no zip")
    assert "expected an SSP (a zip archive)" in refused(tmp_path, path)
    path.write_bytes(body)
    assert "no SystemStructure.ssd" in refused(tmp_path, path)
    archive(path, ssd(part()), {"resources/body.fmu": body[:5000]})
    assert re.search(r"body\.fmu: expected an FMU", refused(tmp_path, path))


def test_a_member_with_damaged_bytes_is_refused(tmp_path: Path, body: bytes) -> None:
    path = archive(tmp_path / "s.ssp", ssd(part()), {"resources/body.fmu": body})
    content = bytearray(path.read_bytes())
    place = content.index(b"resources/body.fmu") + 5000
    content[place : place + 64] = bytes(64)
    path.write_bytes(content)
    assert "expected an intact SSP" in refused(tmp_path, path)


def test_values_out_of_an_archive_that_are_no_values_are_refused(tmp_path: Path, body: bytes) -> None:
    path = archive(tmp_path / "s.ssp", ssd(part()), {"resources/body.fmu": body})
    for name, content, expected in (
        ("no.ssv", "x", "expected well-formed XML"),
        ("../absent.ssv", None, "expected a file of the archive"),
    ):
        given = tmp_path / name
        if content is not None:
            given.write_text(content)
        command = (
            "ssp",
            "import",
            path,
            "--parameters",
            given if content else name,
            "-o",
            tmp_path / "s.toml",
        )
        done = in_this_process(*command)
        assert done.returncode == 2
        assert expected in done.stderr
    assert not (tmp_path / "s.toml").exists()


def test_a_parameter_of_thousands_of_values_is_one_short_line() -> None:
    root = root_of(ssv({"p": real(1.5) * 3000}).encode(), "a.ssv", namespaces=True)
    with pytest.raises(RefusalError) as refusal:
        read_parameter_set(root, "a.ssv")
    assert "got Real, Real, Real, Real, Real and 2995 more" in refusal.value.problem.line("system.ssp")
