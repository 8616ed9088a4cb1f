"""Components that are systems: an archive in an archive, and a description beside the outer one."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.fmu_factory import gain as gain_fmu
from support.ssp_files import archive, component, connection, connector, factor, real, ssd, values

import vibroimpact as vi
from vibroimpact.fmus.errors import ComponentFileError, SceneError
from vibroimpact.orchestrator.ssp import load_system

ENDS = connector("u", "input") + connector("y", "output")
PACKAGE = 'type="application/x-ssp-package"'
DEFINITION = 'type="application/x-ssp-definition"'


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return gain_fmu(tmp_path_factory.mktemp("gains"))


def inner(source: str = "resources/gain.fmu") -> str:
    """Return a system of one gain, 3 by its own parameter, between its connectors."""
    own = component("g", source, ENDS, values({"k": real(3.0)}))
    joined = connection("u", "g.u") + connection("g.y", "y", factor(2.0))
    return ssd(own, joined, connectors=ENDS)


def outer(source: str, kind: str, bindings: str = "") -> str:
    both = component("part", source, ENDS, bindings, kind) + component("last", "resources/gain.fmu", ENDS)
    return ssd(both, connection("part.y", "last.u"))


def packed(folder: Path, fmu: Path) -> Path:
    return archive(folder / "inner.ssp", inner(), {"resources/gain.fmu": fmu})


@pytest.mark.parametrize("kind", [PACKAGE, DEFINITION])
def test_a_system_as_a_component_is_its_elements(tmp_path: Path, fmu: Path, kind: str) -> None:
    fmus: dict[str, bytes | Path] = {"resources/gain.fmu": fmu}
    if kind == PACKAGE:
        members, source = {**fmus, "parts/inner.ssp": packed(tmp_path, fmu)}, "parts/inner.ssp"
    else:
        # sources of a description are relative to it
        members = {**fmus, "parts/inner.ssd": inner("gain.fmu").encode(), "parts/gain.fmu": fmu}
        source = "parts/inner.ssd"
    scene = load_system(archive(tmp_path / "s.ssp", outer(source, kind), members)).scene
    assert [one.name for one in scene.components] == ["part_g", "last"]
    (link,) = scene.connections
    assert (link.source, link.target, link.gain) == (("part_g", "y"), ("last", "u"), 2.0)
    assert scene.components[0].parameters == {"k": 3.0}
    assert vi.run(scene).outcome.item() == 0


def test_parameters_of_the_component_go_before_those_of_its_system(tmp_path: Path, fmu: Path) -> None:
    members: dict[str, bytes | Path] = {"resources/gain.fmu": fmu, "inner.ssp": packed(tmp_path, fmu)}
    description = outer("inner.ssp", PACKAGE, values({"g.k": real(7.0)}))
    scene = load_system(archive(tmp_path / "s.ssp", description, members)).scene
    assert scene.components[0].parameters == {"k": 7.0}


def test_an_archive_in_an_archive_in_an_archive(tmp_path: Path, fmu: Path) -> None:
    members: dict[str, bytes | Path] = {"resources/gain.fmu": fmu, "inner.ssp": packed(tmp_path, fmu)}
    middle = archive(tmp_path / "middle.ssp", outer("inner.ssp", PACKAGE), members)
    outermost = ssd(component("all", "middle.ssp", "", "", PACKAGE))
    scene = load_system(archive(tmp_path / "s.ssp", outermost, {"middle.ssp": middle})).scene
    assert [one.name for one in scene.components] == ["all_part_g", "all_last"]


def test_a_problem_inside_has_the_names_of_both_files(tmp_path: Path, fmu: Path) -> None:
    broken = archive(tmp_path / "inner.ssp", inner("resources/no.fmu"), {})
    members: dict[str, bytes | Path] = {"resources/gain.fmu": fmu, "inner.ssp": broken}
    with pytest.raises(SceneError) as refusal:
        load_system(archive(tmp_path / "s.ssp", outer("inner.ssp", PACKAGE), members))
    assert "s.ssp: inner.ssp: SystemStructure.ssd: g: source: expected a file of the archive" in str(
        refusal.value
    )
    members["inner.ssp"] = b"no archive"
    with pytest.raises(ComponentFileError, match=r"s\.ssp: inner\.ssp: expected an SSP"):
        load_system(archive(tmp_path / "s.ssp", outer("inner.ssp", PACKAGE), members))


def test_descriptions_that_name_themselves_end_in_a_line(tmp_path: Path) -> None:
    twice = component("a", "again.ssd", "", "", DEFINITION) + component("b", "again.ssd", "", "", DEFINITION)
    path = archive(tmp_path / "s.ssp", ssd(twice), {"again.ssd": ssd(twice).encode()})
    with pytest.raises(SceneError) as refusal:
        load_system(path)
    assert "expected at most 50 systems in each other" in str(refusal.value)
    assert len(str(refusal.value)) < 3000
