"""Exports have exactly the requested contacts, modes, masses and sensors, and their binary uses these numbers."""

import zipfile
from ctypes import byref
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions
from support.command_line import in_this_process
from support.component_fmu import LOGGER2, VERSIONS, ComponentFmu

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging.archive import UnpackedFmu, unpack
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.export import STARTS_MEMBER, export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.members import REFERENCES_MEMBER, SIZES_MEMBER
from vibroimpact.orchestrator.fmi.instance3 import Instance3

BODIES = {"Beam": "modes", "Chain": "masses"}
SIZES = [(1, 0), (3, 1), (64, 8)]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # spaces, a percent sign and letters beyond ASCII: FMI 2.0 names this folder by an encoded URI
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "ein Ordner mit 100%20 für é"))


def exported(folder: Path, body: str, fmi: str, count: int, contacts: int) -> Path:
    counts: dict[str, int] = {BODIES[body]: count, "contacts": contacts}
    return export_fmu(body, folder / f"{body}{fmi[0]}.fmu", fmi=fmi, starts={"forcing.phase": 0.0}, **counts)


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize(("count", "contacts"), SIZES)
@pytest.mark.parametrize("body", BODIES)
def test_an_export_of_any_size_passes_every_check(
    tmp_path: Path, body: str, count: int, contacts: int, fmi: str
) -> None:
    path = exported(tmp_path, body, fmi, count, contacts)
    assert check_fmu(path) == ()
    names = {v.name for v in read_description(path).modelVariables}
    each = "damping_ratio" if body == "Beam" else "mass"
    assert sum(name.startswith(f"{each}[") for name in names) == count
    assert sum(name.startswith("contact[") and name.endswith(".law") for name in names) == contacts


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("body", BODIES)
def test_the_binary_starts_with_the_exported_number_and_refuses_more(
    tmp_path: Path, body: str, fmi: str
) -> None:
    name, path = BODIES[body], exported(tmp_path, body, fmi, 5, 1)
    with ComponentFmu(path, version=fmi) as fmu:
        assert fmu.start_values()[name] == fmu.get(name) == 5
        fmu.fmu.reset()
        assert fmu.get(name) == 5
    with ComponentFmu(path, {name: 6}, version=fmi, initialize=False) as fmu:
        with pytest.raises(FMICallException):
            fmu.initialize()
        assert f"{name}: expected 1 to 5, got 6" in fmu.messages[-1]
        fmu.set(name, 4)
        fmu.fmu.exitInitializationMode()


@pytest.mark.parametrize("fmi", VERSIONS)
@pytest.mark.parametrize("body", BODIES)
def test_every_start_value_of_the_description_is_the_binarys(tmp_path: Path, body: str, fmi: str) -> None:
    for path in (fmu_path(body, fmi), exported(tmp_path, body, fmi, 7, 2)):
        with ComponentFmu(path, version=fmi, initialize=False) as fmu:
            described = fmu.start_values()
            assert {name: fmu.get(name) for name in described} == described


def test_an_export_moves_as_the_component_that_it_was_made_from(tmp_path: Path) -> None:
    scene = {"modes": 3, "forcing.amplitude": 1.0, "forcing.angular_frequency": 160.0}
    ends = []
    for path in (fmu_path("Beam"), exported(tmp_path, "Beam", "3.0", 3, 0)):
        with ComponentFmu(path, scene) as fmu:
            fmu.step(0.37)
            ends.append(fmu.get_each("modal_displacement[{}]", 3).tolist())
    assert ends[0] == ends[1]
    assert all(ends[0])


def test_only_what_was_asked_for_is_written_into_the_resources(tmp_path: Path) -> None:
    path = export_fmu("Beam", tmp_path / "b.fmu", modes=8, contacts=2, sensors=1)
    assert (unpack(path).folder / STARTS_MEMBER).read_text().endswith(" bf50624dd2f1a9fc\n")
    assert (
        unpack(path).folder / SIZES_MEMBER
    ).read_text() == "modes 8\ncontacts 2\nsensors 1\nexternal_laws 0\n"
    bare = export_fmu("Beam", tmp_path / "all.fmu", full=True)
    assert not any((unpack(bare).folder / member).exists() for member in (SIZES_MEMBER, STARTS_MEMBER))
    assert bare.read_bytes() == fmu_path("Beam").read_bytes()


def test_numbers_that_cannot_be_are_refused_all_at_once(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as caught:
        export_fmu("Beam", tmp_path / "b.fmu", modes=0, contacts=9, masses=2, sensors=-1)
    text = str(caught.value)
    assert "Beam: modes: expected 1 to 64, got 0." in text
    assert "Beam: contacts: expected 0 to 8, got 9." in text
    assert "Beam: masses: expected no number of them" in text
    assert "Beam: sensors: expected 0 to 4, got -1." in text
    assert not (tmp_path / "b.fmu").exists()


def test_the_command_line_exports_a_beam_and_a_chain(tmp_path: Path) -> None:
    beam, chain = tmp_path / "beam8.fmu", tmp_path / "chain5.fmu"
    for arguments in (
        ["beam", "--modes", "8", "--contacts", "2", "-o", str(beam)],
        ["chain", "--masses", "5", "--contacts", "1", "--fmi", "2.0", "-o", str(chain)],
    ):
        done = in_this_process("fmu", "export", *arguments)
        assert done.returncode == 0, done.stderr
    with ComponentFmu(beam) as fmu:
        assert fmu.get("modes") == 8
    with ComponentFmu(chain, version="2.0") as fmu:
        assert fmu.get("masses") == 5


def modes_for(fmu: UnpackedFmu, location: bytes | None) -> Any:
    """Return the start value of `modes` of an FMI 2.0 instance with this resource location."""
    slave = FMU2Slave(
        guid=fmu.token, unzipDirectory=str(fmu.folder), modelIdentifier="Beam", instanceName="beam"
    )
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = LOGGER2
    slave.component = slave.fmi2Instantiate(b"beam", 1, fmu.token.encode(), location, byref(callbacks), 0, 0)
    (reference,) = (
        v.valueReference for v in read_description(fmu.source).modelVariables if v.name == "modes"
    )
    try:
        return slave.getInteger([reference])[0]
    finally:
        slave.freeInstance()


def test_resources_that_cannot_be_read_leave_the_built_in_sizes(tmp_path: Path) -> None:
    fmu = unpack(exported(tmp_path, "Beam", "2.0", 9, 1))
    uri = fmu.resources.as_uri()
    readable = [
        uri,
        uri.replace("file:///", "file:/"),
        uri.replace("file:///", "file://localhost/"),
        f"{uri}/",
    ]
    assert [modes_for(fmu, text.encode()) for text in readable] == [9] * len(readable)
    others = (
        "",
        "file:",
        "file://",
        "file://host",
        "http://host/resources",
        f"{uri}x",
        f"file:///{'x/' * 9000}",
        "%",
    )
    assert [modes_for(fmu, text.encode()) for text in others] == [4] * len(others)
    assert modes_for(fmu, None) == 4


@pytest.mark.parametrize(
    ("text", "modes"),
    [
        (b"", 4),
        (b"modes", 4),
        (b"modes eight\n", 4),
        (b"modes 0\n", 4),
        (b"modes 65\n", 4),
        (b"modes 99999999999999999999\n", 4),
        (b"modes -3\n", 4),
        (b"\xff\x00\xfe", 4),
        (b"word" * 100 + b" 3\nmodes 8\n", 4),
        (b"contacts 1\r\nmodes 8\r\n", 8),
        (b"unknown 3\nmodes 6", 6),
    ],
)
def test_a_damaged_file_of_sizes_does_no_harm(tmp_path: Path, text: bytes, modes: int) -> None:
    fmu = unpack(exported(tmp_path, "Beam", "2.0", 9, 1))
    folder = tmp_path / "resources"
    folder.mkdir()
    (folder / "sizes.txt").write_bytes(text)
    assert modes_for(fmu, folder.as_uri().encode()) == modes


@pytest.mark.parametrize("name", ["oscillator", "chain", "beam", "impact_stop"])
def test_value_references_of_fmi_3_are_places_in_the_description(tmp_path: Path, name: str) -> None:
    # OMSimulator takes references in dependencies for places, and refused a chain and a beam
    path = export_fmu(name, tmp_path / "x.fmu")
    references = [variable.valueReference for variable in read_description(path).modelVariables]
    assert references == list(range(1, len(references) + 1))
    assert check_fmu(path) == ()


@pytest.mark.parametrize("text", [None, b"", b"words", b"\xff\x00", b"-1\n", b"999999999\n" * 9999, b"1\n"])
def test_an_export_whose_list_of_references_is_gone_or_damaged_does_no_harm(
    tmp_path: Path, text: bytes | None
) -> None:
    path = export_fmu("impact_stop", tmp_path / "whole.fmu")
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    last = len(read_description(path).modelVariables)
    del members[REFERENCES_MEMBER]
    write_fmu(tmp_path / "x.fmu", members | ({} if text is None else {REFERENCES_MEMBER: text}))
    with pytest.raises(ComponentError, match=r"with references\.txt|not a variable of this type"):
        Instance3(unpack(tmp_path / "x.fmu"), "x").group("Float64", [last]).get()


def test_references_out_of_the_description_are_none_of_the_binarys(tmp_path: Path) -> None:
    path = export_fmu("impact_stop", tmp_path / "x.fmu")
    instance = Instance3(unpack(path), "x")
    for reference in (0, len(read_description(path).modelVariables) + 1, 2**32 - 1):
        with pytest.raises(ComponentError, match="not a variable of this type"):
            instance.group("Float64", [reference]).get()
