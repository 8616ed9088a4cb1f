"""The Gain FMU: a number times a signal, without delay, in both versions of FMI."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from support.component_fmu import VERSIONS, ComponentFmu
from support.fmpy_checks import validate

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.check import check_fmu
from vibroimpact.fmus.packaging.description import UnitDefinition
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.fmpy_door import read_description


@pytest.mark.parametrize("version", VERSIONS)
def test_the_output_is_the_gain_times_the_input_before_and_after_a_step(version: str) -> None:
    with ComponentFmu("Gain", {"gain": -2.5, "input": 4.0}, version=version) as gain:
        assert gain.get("output") == -10.0
        gain.set("input", 0.3)
        assert gain.get("output") == -2.5 * 0.3
        gain.step(0.125)
        assert (gain.get("output"), gain.time) == (-2.5 * 0.3, 0.125)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_gain_that_is_no_number_is_refused(version: str) -> None:
    with (
        pytest.raises(Exception, match=r"[Ii]nit"),
        ComponentFmu("Gain", {"gain": math.inf}, version=version),
    ):
        pass


@pytest.mark.parametrize("version", VERSIONS)
def test_an_export_has_the_units_that_it_is_given(tmp_path: Path, version: str) -> None:
    units = {
        "input": UnitDefinition("mm", {"m": 1}, 1e-3),
        "gain": UnitDefinition("N/mm", {"kg": 1, "s": -2}, 1e3),
        "output": UnitDefinition("N", {"kg": 1, "m": 1, "s": -2}),
    }
    path = export_fmu("gain", tmp_path / "g.fmu", fmi=version, starts={"gain": 0.5}, units=units)
    found = {v.name: v.unit for v in read_description(path).modelVariables if v.name != "time"}
    assert found == {"gain": "N/mm", "input": "mm", "output": "N"}
    assert (check_fmu(path), validate(path)) == ((), ())
    with ComponentFmu(path, {"input": 6.0}, version=version) as gain:
        assert gain.get("output") == 3.0


def test_a_variable_that_a_gain_has_not_is_refused(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="stiffness: expected a parameter or an input"):
        export_fmu("gain", tmp_path / "g.fmu", starts={"stiffness": 1.0})
