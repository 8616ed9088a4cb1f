"""A recorded channel drives bodies exactly: value and slope from the Replay FMU, motion from the body's own flow."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from support.component_fmu import VERSIONS
from support.replay_records import COUNT, INTERVAL, SIGNALS, base_values, gappy_values
from support.structure import Modes, Stop, Structure

from vibroimpact.analysis.dataset import read_flat
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.core import Oscillator, flow
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.packaging.replay_fmu import build_replay
from vibroimpact.orchestrator.importer.described import kind_of
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, ConnectionSpec
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import load_scene


@pytest.fixture(scope="module", params=VERSIONS)
def fmu(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_replay(SIGNALS, tmp_path_factory.mktemp("replay") / "record.fmu", fmi=request.param)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("VIBROIMPACT_CACHE", str(tmp_path / "cache"))


BODY = {"mass": 1.0, "stiffness": 250.0**2, "damping": 2.0 * 0.02 * 250.0}
#: Position and restitution of the stop that the jump of the record throws the body against, m and 1.
PLACE, RESTITUTION = -4e-4, 0.7
STOPPED = BODY | {
    "contact[1].law": "restitution",
    "contact[1].position": PLACE,
    "contact[1].side": "lower",
    "contact[1].restitution": RESTITUTION,
}


def driven(
    fmu: Path, version: str, parameters: Mapping[str, float | str], exchange: str = "gauss_seidel"
) -> Importer:
    """Return an oscillator with a base moved by the channel `base`."""
    body = ComponentSpec("body", fmu_path("Oscillator", version), parameters)
    joined = [
        ConnectionSpec(("record", "base"), ("body", "base_acceleration")),
        ConnectionSpec(("record", "base_rate"), ("body", "base_acceleration_rate")),
    ]
    # declared first, but stepped last, since it gives an input its slope
    return Importer([ComponentSpec("record", fmu), body], joined, exchange=exchange, macro_step=INTERVAL)


def followed(importer: Importer, samples: int) -> np.ndarray:
    """Return displacement and velocity at every sample, shape (samples, 2)."""
    group = importer.components["body"].group("Float64", ["displacement", "velocity"])
    importer.begin()
    rows = []
    for index in range(samples):
        importer.advance(index * INTERVAL)
        rows.append(group.get().copy())
    return np.array(rows)


@pytest.mark.parametrize("version", ["3.0", "2.0"])
@pytest.mark.parametrize("exchange", ["gauss_seidel", "jacobi", "iterated"])
def test_a_driven_oscillator_moves_by_the_exact_response_to_straight_pieces(  # type: ignore[no-untyped-def]
    fmu: Path, version, exchange
) -> None:
    found = followed(driven(fmu, version, BODY, exchange), COUNT)
    # reference: the exact flow, sample by sample, under the inertia force of the base
    body = Oscillator(mass=1.0, stiffness=BODY["stiffness"], damping=BODY["damping"])
    state, exact = (0.0, 0.0), [(0.0, 0.0)]
    for now, then in zip(base_values()[:-1], base_values()[1:], strict=True):
        state = flow(body, state, INTERVAL, held=-now, held_rate=-(then - now) / INTERVAL)
        exact.append(state)
    assert np.abs(found - exact).max(axis=0) == pytest.approx(0.0, abs=1e-12 * np.abs(exact).max())


@pytest.mark.parametrize("version", ["3.0", "2.0"])
def test_impacts_between_samples_do_not_disturb_the_drive(fmu: Path, version) -> None:  # type: ignore[no-untyped-def]
    importer = driven(fmu, version, STOPPED)
    found = followed(importer, COUNT)
    stop = Stop([1.0], PLACE, side="lower", restitution=RESTITUTION)
    exact = [(0.0, 0.0)]
    with Structure(Modes([250.0], [0.02]), [stop], [0.0], [0.0]) as body:
        for now, then in zip(base_values()[:-1], base_values()[1:], strict=True):
            body.advance(INTERVAL, held=-now, held_rate=-(then - now) / INTERVAL)
            exact.append((float(body.displacement[0]), float(body.velocity[0])))
        impacts = len(body.impacts)
    assert impacts > 5
    component, name = importer.components["body"], "contact[1].count"
    assert int(component.group(kind_of(component.variables[name]), [name]).get()[0]) == impacts
    assert np.abs(found - exact).max() < 1e-10 * np.abs(exact).max()


def test_a_stop_that_is_an_fmu_ends_steps_between_samples_and_changes_nothing(fmu: Path) -> None:
    # equivalence: the stop inside the body, and as a separate component whose events end all steps
    fused = followed(driven(fmu, "3.0", STOPPED), COUNT)
    joined = [
        *(ConnectionSpec(("record", f"base{e}"), ("body", f"base_acceleration{e}")) for e in ("", "_rate")),
        ConnectionSpec(("body", "contact[1].displacement"), ("stop", "displacement")),
        ConnectionSpec(("body", "contact[1].velocity"), ("stop", "velocity")),
        ConnectionSpec(("stop", "applied_restitution"), ("body", "contact[1].applied_restitution")),
    ]
    components = [
        ComponentSpec("record", fmu),
        ComponentSpec("stop", fmu_path("ImpactStop", "3.0"), {"restitution": RESTITUTION}),
        ComponentSpec("body", fmu_path("Oscillator", "3.0"), STOPPED | {"contact[1].law": "external"}),
    ]
    events: list[object] = []
    coupled = Importer(components, joined, macro_step=INTERVAL)
    coupled.on_event = events.append
    found = followed(coupled, COUNT)
    assert len(events) > 3
    assert np.abs(found - fused).max() < 1e-10 * np.abs(fused).max()


SCENE = """\
[component.record]
fmu = "record.fmu"
parameters = { base_gain = 2.0 }
[component.body]
fmu = "Oscillator"
parameters = { stiffness = 62500.0, damping = 10.0 }
[[connection]]
from = "record.base"
to = "body.base_acceleration"
[[connection]]
from = "record.base_rate"
to = "body.base_acceleration_rate"
[record]
recorded_time = 0.25
variables = ["body.displacement", "record.base_valid", "record.gappy_valid"]
rate = 3000
[execution]
macro_step = 3.3333333333333335e-4
"""


def test_a_scene_plays_a_record_to_its_end_and_beyond(fmu: Path, tmp_path: Path) -> None:
    shutil.copy(fmu, tmp_path / "record.fmu")
    (tmp_path / "scene.toml").write_text(SCENE)
    run_scene(load_scene(tmp_path / "scene.toml"), tmp_path / "run.nc")
    dataset = read_flat(tmp_path / "run.nc")
    reference = 2.0 * followed(driven(fmu, "3.0", BODY), COUNT)[:, 0]
    found = dataset.body_displacement.values
    assert np.abs(found[:COUNT] - reference).max() < 1e-12 * np.abs(reference).max()
    assert dataset.record_base_valid.values.tolist() == [1.0] * COUNT + [0.0] * (len(found) - COUNT)
    missing = np.isnan(np.append(gappy_values(), np.full(len(found) - COUNT, np.nan)))
    assert (dataset.record_gappy_valid.values == ~missing).all()


def test_a_scene_refuses_a_record_in_units_of_gravity_without_a_gain(fmu: Path, tmp_path: Path) -> None:
    shutil.copy(fmu, tmp_path / "record.fmu")
    text = SCENE.replace('"record.base"', '"record.gappy"')
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(SceneError, match=r"9\.80665 m/s2"):
        load_scene(tmp_path / "scene.toml")
