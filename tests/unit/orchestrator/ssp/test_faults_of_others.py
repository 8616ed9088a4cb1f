"""Faults in systems that other tools accept: each is taken with a remark."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.ssp_files import archive, component, connection, connector, real, ssd, ssv

from vibroimpact.fmus.errors import ComponentFileError, SceneError
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.ssp import load_system
from vibroimpact.orchestrator.ssp.importing import Imported

BODY = connector("displacement", "output") + connector("force", "input")
FROM_SSV = '<ssd:ParameterBindings><ssd:ParameterBinding source="p.ssv"/></ssd:ParameterBindings>'
PLAIN_SSV = (
    '<?xml version="1.0"?><ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>'
    '<ssv:Parameter name="mass"><ssv:Real value="3"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>'
)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu("oscillator", tmp_path_factory.mktemp("fmus") / "body.fmu", fmi="2.0")


def body(source: str = "body.fmu", bindings: str = "") -> str:
    return component("body", source, BODY).replace("</ssd:Component>", f"{bindings}</ssd:Component>")


def load(folder: Path, fmu: Path, description: str, **members: str) -> Imported:
    given: dict[str, bytes | Path] = {"body.fmu": fmu}
    given |= {name.replace("_", "."): text.encode() for name, text in members.items()}
    return load_system(archive(folder / "s.ssp", description, given))


def test_a_prefix_without_a_declaration_has_the_namespace_of_ssp(tmp_path: Path, fmu: Path) -> None:
    description = ssd(body(bindings=FROM_SSV))
    imported = load(tmp_path, fmu, description, p_ssv=PLAIN_SSV)
    assert imported.scene.components[0].parameters == {"mass": 3.0}
    assert "p.ssv: prefixes without a declaration have the namespaces of SSP: ssv" in imported.notes
    # the annotation of libcosim's step, as the demo cases write it
    bare = description.replace('xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations" ', "")
    two = load(tmp_path, fmu, bare, p_ssv=PLAIN_SSV)
    assert any(
        note.startswith("SystemStructure.ssd: prefixes") and note.endswith("osp") for note in two.notes
    )


def test_a_prefix_that_nothing_knows_is_an_error(tmp_path: Path, fmu: Path) -> None:
    wrong = PLAIN_SSV.replace("ssv:", "abc:")
    with pytest.raises(ComponentFileError, match="unbound prefix"):
        load(tmp_path, fmu, ssd(body(bindings=FROM_SSV)), p_ssv=wrong)


def test_the_last_of_several_values_of_a_parameter_counts(tmp_path: Path, fmu: Path) -> None:
    more = f'<ssv:Parameter name="mass">{real(5.0)}</ssv:Parameter></ssv:Parameters>'
    twice = ssv({"mass": real(2.0), "stiffness": real(7.0)}).replace("</ssv:Parameters>", more)
    imported = load(tmp_path, fmu, ssd(body(bindings=FROM_SSV)), p_ssv=twice)
    assert imported.scene.components[0].parameters == {"mass": 5.0, "stiffness": 7.0}
    assert "p.ssv: the last of several values was taken: mass" in imported.notes


def test_an_fmu_in_another_process_of_this_machine_is_taken_from_the_archive(
    tmp_path: Path, fmu: Path
) -> None:
    for host in ("localhost", "127.0.0.1:9090"):
        imported = load(tmp_path, fmu, ssd(body(f"proxyfmu://{host}?file=body.fmu")))
        assert imported.scene.components[0].fmu.name == "body.fmu"
        assert any("is taken from the archive" in note for note in imported.notes)


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        ("proxyfmu://elsewhere?file=body.fmu", "expected proxyfmu://localhost?file=NAME"),
        ("proxyfmu://localhost?file=proxyfmu://localhost?file=body.fmu", "expected proxyfmu://localhost"),
        ("proxyfmu://localhost?file=../body.fmu", "expected a file of the archive"),
        ("proxyfmu://localhost", "expected proxyfmu://localhost?file=NAME"),
    ],
)
def test_an_address_of_another_machine_or_place_is_refused(
    tmp_path: Path, fmu: Path, source: str, expected: str
) -> None:
    with pytest.raises(SceneError) as refusal:
        load(tmp_path, fmu, ssd(body(source)))
    assert expected in str(refusal.value)


def test_samples_lie_at_ends_of_steps(tmp_path: Path, fmu: Path) -> None:
    two = body() + component("other", "body.fmu", BODY)
    joined = connection("body.displacement", "other.force", '<ssc:LinearTransformation factor="1.0"/>')
    for step, rate in ((0.125, 8.0), (0.001, 1000.0 / 2.0), (4.0, 500.0)):
        imported = load(tmp_path, fmu, ssd(two, joined, step=step))
        assert imported.scene.sampling_rate == pytest.approx(rate, rel=1e-12)
