"""Numbers of modes, masses and contacts as structural parameters of FMI 3.0, set in configuration mode."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from fmpy.fmi1 import FMICallException
from fmpy.model_description import read_model_description
from fmpy.validation import validate_fmu
from support.component_fmu import ComponentFmu
from support.integrated import Integrated

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.shipped import fmu_path

STOP = {
    "contact[1].law": 1,
    "contact[1].location": 1.0,
    "contact[1].position": 1e-3,
    "contact[1].restitution": 0.7,
    "modal_velocity_start[1]": 1.0,
}
SECOND = {"contact[2].law": 1, "contact[2].location": 0.8, "contact[2].side": 2, "contact[2].position": -1e-4}
FEWER = {"modes": 4, "contacts": 1}
OUTPUTS = ["displacement", "velocity", "contact[1].count", "energy.kinetic"]


@pytest.fixture(scope="module")
def large(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("large") / "large.fmu"
    return export_fmu("beam", path, modes=16, contacts=2, starts={**STOP, **SECOND}, structural=True)


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_fmu(
        "beam", tmp_path_factory.mktemp("small") / "small.fmu", modes=4, contacts=1, starts=STOP
    )


def configured(path: Path, values: dict[str, int], **options: Any) -> ComponentFmu:
    """Return an instance whose structural parameters were set in configuration mode, and initialized."""
    fmu = ComponentFmu(path, initialize=False, **options)
    fmu.fmu.enterConfigurationMode()
    for name, value in values.items():
        fmu.set(name, value)
    fmu.fmu.exitConfigurationMode()
    fmu.initialize()
    return fmu


def run(fmu: ComponentFmu, count: int = 40) -> list[tuple[float, ...]]:
    rows = []
    for _ in range(count):
        fmu.step(1.3e-3)
        rows.append(tuple(fmu.get(name) for name in OUTPUTS))
    return rows


def test_the_description_is_valid_and_has_them_as_structural_parameters(large: Path, small: Path) -> None:
    assert validate_fmu(str(large)) == []
    variables = {v.name: v for v in read_model_description(str(large)).modelVariables}
    for name, most in (("modes", "16"), ("contacts", "2")):
        variable = variables[name]
        assert (variable.causality, variable.variability) == ("structuralParameter", "fixed")
        assert (variable.start, variable.max) == (most, most)
    plain = {v.name: v for v in read_model_description(str(small)).modelVariables}
    assert plain["modes"].causality == "parameter"
    assert "contacts" not in plain


def test_16_modes_set_to_4_and_2_contacts_to_1_are_an_export_of_them_to_the_bit(
    large: Path, small: Path
) -> None:
    with configured(large, FEWER) as one, ComponentFmu(small) as other:
        rows = run(one)
        assert rows == run(other)
        assert rows[-1][2] > 2
        assert not any("Warning" in text for text in one.messages)
    with configured(large, {}) as whole:
        assert run(whole) != rows


@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_start_values_of_fmpy_set_them_to_the_bit(large: Path, small: Path, kind: str) -> None:
    # Euler's steps do not depend on the number of states, as a norm of errors does
    options = {
        "fmi_type": kind,
        "solver": "Euler",
        "stop_time": 0.02,
        "step_size": 1e-5,
        "output_interval": 1e-4,
    }
    one = simulate_fmu(str(large), start_values=FEWER, output=OUTPUTS, **options)
    other = simulate_fmu(str(small), output=OUTPUTS, **options)
    assert one["contact[1].count"][-1] > 2
    for name in OUTPUTS:
        np.testing.assert_array_equal(one[name], other[name])


def test_in_model_exchange_unused_modes_are_states_at_rest(large: Path, small: Path) -> None:
    one, other = Integrated("Beam", "3.0", large), Integrated("Beam", "3.0", small)
    one.fmu.reset()
    one.set(FEWER)
    assert "value reference 2 is a structural parameter: expected configuration mode" in one.messages[0]
    one.fmu.enterInitializationMode()
    for it in (one, other):
        it.begin()
    assert one.fmu.getNumberOfContinuousStates() == 32
    states = 1e-3 * np.cos(np.arange(8))
    wide = np.zeros(32)
    wide[:4], wide[16:20] = states[:4], states[4:]
    one.move(0.25, *wide)
    other.move(0.25, *states)
    found, expected = np.array(one.derivatives(32)), np.array(other.derivatives(8))
    assert [*found[:4], *found[16:20]] == expected.tolist()
    assert not found[4:16].any()
    assert not found[20:].any()
    assert one.numbers("getEventIndicators", 2)[0] == other.numbers("getEventIndicators", 1)[0]
    position, force = one.references["modal_displacement[3]"], one.references["modal_acceleration[3]"]
    beyond = one.references["modal_displacement[9]"]
    narrow = [other.references[f"modal_{name}[3]"] for name in ("acceleration", "displacement")]
    assert one.fmu.getDirectionalDerivative([force], [position], [1.0], 1) == (
        other.fmu.getDirectionalDerivative(narrow[:1], narrow[1:], [1.0], 1)
    )
    assert one.fmu.getDirectionalDerivative([force], [beyond], [1.0], 1) == [0.0]


def test_saved_states_hold_them_and_a_reset_has_all_again(large: Path) -> None:
    with configured(large, FEWER) as one, ComponentFmu(large) as other:
        run(one, 10)
        kept, time = one.serialized(), one.time
        rows = run(one)
        other.restore(kept)
        other.time = time
        assert (other.get("modes"), other.get("contacts"), other.get("contact[2].law")) == (4, 1, 0)
        assert run(other) == rows
        other.fmu.reset()
        assert (other.get("modes"), other.get("contacts"), other.get("contact[2].law")) == (16, 2, 1)
        other.time = 0.0
        other.initialize()
        with configured(large, {}) as fresh:
            assert run(other) == run(fresh)


def test_each_wrong_moment_is_an_error_with_one_line(large: Path) -> None:
    fmu = ComponentFmu(large, initialize=False)
    with fmu:
        fmu.fmu.enterConfigurationMode()
        with pytest.raises(FMICallException):
            fmu.set("contact[1].position", 2e-3)
        assert "cannot be set: the instance is configuration mode" in fmu.messages[-1]
        for call in (fmu.fmu.enterConfigurationMode, fmu.fmu.enterInitializationMode):
            with pytest.raises(FMICallException):
                call()
            assert "not allowed now: the instance is configuration mode" in fmu.messages[-1]
        fmu.set("modes", 4)
        fmu.fmu.exitConfigurationMode()
        with pytest.raises(FMICallException):
            fmu.fmu.exitConfigurationMode()
        assert fmu.get("modes") == 4
        fmu.initialize()
        count = len(fmu.messages)
        for call in (fmu.fmu.enterConfigurationMode, lambda: fmu.set("modes", 5)):
            with pytest.raises(FMICallException):
                call()
        assert len(fmu.messages) == count + 2
        assert "can be set before initialization only: the instance is step mode" in fmu.messages[-1]


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("modes", 17, "1 to 16"),
        ("modes", 0, "1 to 16"),
        ("contacts", 3, "0 to 2"),
        ("contacts", -1, "0 to 2"),
    ],
)
def test_more_than_exported_are_refused(large: Path, name: str, value: int, expected: str) -> None:
    fmu = ComponentFmu(large, initialize=False)
    with fmu:
        fmu.fmu.enterConfigurationMode()
        fmu.set(name, value)
        fmu.fmu.exitConfigurationMode()
        with pytest.raises(FMICallException):
            fmu.initialize()
        assert f"{name}: expected {expected}, got {value}" in fmu.messages[-1]


def test_no_contact_is_a_free_body(large: Path, small: Path) -> None:
    none = {"modes": 4, "contacts": 0}
    with configured(large, none) as one, ComponentFmu(small, {"contact[1].law": 0}) as other:
        assert run(one) == run(other)


def test_contacts_that_are_left_out_need_no_importer_with_events(tmp_path: Path) -> None:
    starts: dict[str, float | str] = {**STOP, **SECOND, "contact[2].law": "external"}
    path = export_fmu("beam", tmp_path / "e.fmu", modes=4, starts=starts, external=True, structural=True)
    with configured(path, {"contacts": 1}) as fmu:
        assert run(fmu)[-1][2] > 2


def test_without_the_option_and_elsewhere_there_is_no_configuration(tmp_path: Path, small: Path) -> None:
    for fmu in (ComponentFmu(small, initialize=False), ComponentFmu(fmu_path("Gain"), initialize=False)):
        with fmu:
            with pytest.raises(FMICallException):
                fmu.fmu.enterConfigurationMode()
            assert "expected an FMU with structural parameters, got one without" in fmu.messages[-1]
    with pytest.raises(UsageError, match="Gain: structural: expected a body with it"):
        export_fmu("gain", tmp_path / "g.fmu", structural=True)
    with pytest.raises(
        UsageError, match=r"Beam: structural: expected FMI 3\.0 with this option, got FMI 2\.0"
    ):
        export_fmu("beam", tmp_path / "b.fmu", structural=True, fmi="2.0")
    with pytest.raises(UsageError, match="contacts: expected a variable of this description"):
        export_fmu("beam", tmp_path / "b.fmu", starts={"contacts": 1})
