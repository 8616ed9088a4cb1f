"""Offsets of connections: in scenes, in systems of other tools, and in exported systems."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.fmu_factory import gain as gain_fmu
from support.ssp_files import archive, component, connection, connector, factor, ssd, system

import vibroimpact as vi
from vibroimpact.fmus.errors import SceneError
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.ssp import export_system, load_system

SCENE = """
[component.a]
fmu = "gain.fmu"
parameters = {{ k = 3.0, u = 2.0 }}
[component.b]
fmu = "gain.fmu"
parameters = {{ k = 1.0 }}
[[connection]]
from = "a.y"
to = "b.u"
gain = {gain}
offset = {offset}
[record]
recorded_time = 1.0
rate = 10
variables = ["b.y"]
[execution]
macro_step = 0.1
exchange = "{exchange}"
guard = false
"""
ENDS = connector("u", "input") + connector("y", "output")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("gains")
    gain_fmu(made).rename(made / "gain.fmu")
    return made


def scene(folder: Path, gain: float, offset: float, exchange: str = "gauss_seidel") -> Scene:
    (folder / "s.toml").write_text(SCENE.format(gain=gain, offset=offset, exchange=exchange))
    return Scene.from_file(folder / "s.toml")


@pytest.mark.parametrize("exchange", ["jacobi", "gauss_seidel", "iterated"])
def test_an_input_is_gain_times_output_plus_offset(folder: Path, exchange: str) -> None:
    for gain, offset in ((1.0, 3.0), (-2.0, 0.5)):
        values = vi.run(scene(folder, gain, offset, exchange)).b_y.values
        np.testing.assert_array_equal(values[-1], 6.0 * gain + offset)


@pytest.mark.parametrize("gains", ["component", "transformation"])
@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.1), (-1e-300, 1e300), (2.0 / 3.0, -5e-324)])
def test_an_exported_offset_comes_back(folder: Path, gain: float, offset: float, gains: str) -> None:
    path = folder / "s.ssp"
    path.unlink(missing_ok=True)
    export_system(scene(folder, gain, offset), path, gains=gains)
    (link,) = load_system(path).scene.connections
    assert (link.gain, link.offset) == (gain, offset)


def test_offsets_on_the_way_through_systems_add_up(tmp_path: Path, folder: Path) -> None:
    inner = system(
        "rig",
        component("b", "gain.fmu", ENDS),
        connection("push", "b.u", factor(4.0, 5.0)),
        connectors=connector("push", "input"),
    )
    description = ssd(
        component("a", "gain.fmu", ENDS) + inner, connection("a.y", "rig.push", factor(2.0, 3.0))
    )
    path = archive(tmp_path / "s.ssp", description, {"gain.fmu": folder / "gain.fmu"})
    (link,) = load_system(path).scene.connections
    assert (link.gain, link.offset) == (8.0, 17.0)


def test_an_offset_between_other_numbers_or_at_a_contact_is_refused(folder: Path) -> None:
    text = SCENE.format(gain=1.0, offset=1.0, exchange="jacobi")
    ball = text.replace('"gain.fmu"', '"Oscillator"').replace("{ k = 3.0, u = 2.0 }", "{ mass = 2.0 }")
    ball = ball.replace("{ k = 1.0 }", "{ mass = 2.0 }").replace("b.y", "b.displacement")
    at_contact = ball.replace("a.y", "a.contact[1].displacement").replace("b.u", "b.force")
    counted = ball.replace("a.y", "a.contact[1].count").replace("b.u", "b.contact[1].law")
    for wrong, expected in (
        (at_contact, "connection[1].offset: expected none at a contact"),
        (counted, "expected"),
    ):
        (folder / "w.toml").write_text(wrong)
        with pytest.raises(SceneError) as refusal:
            Scene.from_file(folder / "w.toml")
        assert expected in str(refusal.value)
