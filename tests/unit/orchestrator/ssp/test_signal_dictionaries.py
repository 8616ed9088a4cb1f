"""Signal dictionaries: an output that one reference takes is what all references to the dictionary give."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.fmu_factory import gain as gain_fmu
from support.ssp_files import archive, component, connection, connector, factor, real, ssd, system, values

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import load_system

ENDS = connector("u", "input") + connector("y", "output")
SPACE = 'xmlns:ssb="http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"'
ENTRIES = (
    f'<ssb:SignalDictionary {SPACE} version="1.0"><ssb:DictionaryEntry name="push"><ssc:Real/></ssb:DictionaryEntry>'
    "</ssb:SignalDictionary>"
)
INLINE = f'<ssd:SignalDictionary name="bus">{ENTRIES}</ssd:SignalDictionary>'
IN_FILE = '<ssd:SignalDictionary name="bus" source="bus.ssb"/>'


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return gain_fmu(tmp_path_factory.mktemp("gains"))


def reference(name: str, signal: str = "push", kind: str = "inout", dictionary: str = "bus") -> str:
    signals = f"<ssd:Connectors>{connector(signal, kind)}</ssd:Connectors>"
    element = "ssd:SignalDictionaryReference"
    return f'<{element} name="{name}" dictionary="{dictionary}">{signals}</{element}>'


def read(folder: Path, fmu: Path, description: str, dictionary: str) -> Scene:
    with_it = description.replace(
        "</ssd:Connections></ssd:System><ssd:Def",
        f"</ssd:Connections><ssd:SignalDictionaries>{dictionary}</ssd:SignalDictionaries></ssd:System><ssd:Def",
    )
    assert with_it != description
    space = 'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
    members: dict[str, bytes | Path] = {
        "gain.fmu": fmu,
        "bus.ssb": ENTRIES.replace(SPACE, f"{SPACE} {space}").encode(),
    }
    return load_system(archive(folder / "s.ssp", with_it, members)).scene


def gains(*names: str) -> str:
    return "".join(component(name, "gain.fmu", ENDS) for name in names)


@pytest.mark.parametrize("dictionary", [INLINE, IN_FILE], ids=["inline", "in a file"])
def test_a_signal_reaches_all_references_in_all_systems(tmp_path: Path, fmu: Path, dictionary: str) -> None:
    inner = system(
        "rig",
        gains("b") + reference("inside", kind="output"),
        connection("inside.push", "b.u", factor(2.0, 1.0)),
    )
    elements = gains("a", "c") + reference("here") + reference("there") + inner
    joined = connection("a.y", "here.push", factor(3.0)) + connection("there.push", "c.u")
    scene = read(tmp_path, fmu, ssd(elements, joined), dictionary)
    assert {(c.source, c.target): (c.gain, c.offset) for c in scene.connections} == {
        (("a", "y"), ("c", "u")): (3.0, 0.0),
        (("a", "y"), ("rig_b", "u")): (6.0, 1.0),
    }
    assert vi.run(scene).outcome.item() == 0


def test_a_signal_that_nothing_gives_leaves_its_inputs_free(tmp_path: Path, fmu: Path) -> None:
    scene = read(tmp_path, fmu, ssd(gains("a") + reference("here"), connection("here.push", "a.u")), INLINE)
    assert scene.connections == ()


def test_a_parameter_does_not_reach_a_signal(tmp_path: Path, fmu: Path) -> None:
    given = values({"here.push": real(1.0), "a.k": real(2.0)})
    description = ssd(gains("a") + reference("here"), connection("here.push", "a.u"), bindings=given)
    assert read(tmp_path, fmu, description, INLINE).components[0].parameters == {"k": 2.0}


@pytest.mark.parametrize(
    ("elements", "joined", "expected"),
    [
        (
            gains("a", "b") + reference("here") + reference("there"),
            connection("a.y", "here.push") + connection("b.y", "there.push"),
            "expected an input of its own for each connection",
        ),
        (
            gains("a") + reference("here", "pull"),
            connection("a.y", "here.pull"),
            "an entry of the signal dictionary",
        ),
        (gains("a") + reference("here"), connection("a.y", "here.pull"), "expected a connector of here"),
        (
            gains("a") + reference("here", dictionary="other"),
            connection("a.y", "here.push"),
            'expected a signal dictionary, got "other"',
        ),
        (
            gains("a") + reference("here", kind="output"),
            connection("a.y", "here.push"),
            "an end that gives a value",
        ),
    ],
)
def test_a_wrong_signal_is_one_line(
    tmp_path: Path, fmu: Path, elements: str, joined: str, expected: str
) -> None:
    with pytest.raises(SceneError) as refusal:
        read(tmp_path, fmu, ssd(elements, joined), INLINE)
    assert expected in str(refusal.value)
