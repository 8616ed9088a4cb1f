"""Modes of the Structure FMU that grow: the end of the motion, energies, and damping of any sign."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from scipy.linalg import expm
from support.component_fmu import ComponentFmu, stop
from support.modal_fmu import structure_fmu

from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.structure_file import structure_file

FALLING: dict[str, Any] = {
    "mode.angular_frequency": [-1.0],
    "mode.contact_shape": [[1.0]],
    "mode.observed_shape": [1.0],
    "mode.displacement_start": [0.5],
}


def test_a_motion_that_grows_asks_for_the_end_of_the_simulation_at_its_limit() -> None:
    with structure_fmu(FALLING, {"displacement_limit": 50.0}, early_return=True) as fmu:
        _, terminates, _, reached = fmu.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=10.0)
        assert terminates
        assert reached == pytest.approx(math.acosh(100.0), rel=1e-15)
        assert fmu.get("displacement") == pytest.approx(50.0, rel=1e-14)
        assert "unbounded: a displacement passed displacement_limit, 50 m, at time" in fmu.messages[-1]


def test_a_motion_that_leaves_its_only_stop_goes_on_unless_it_is_to_end() -> None:
    for ends, reached in ((False, 4.0), (True, 0.0)):
        arrays = {**FALLING, "mode.displacement_start": [-0.5]}
        with structure_fmu(arrays, {**stop(1.0), "ends_unbounded": ends}, early_return=True) as fmu:
            _, terminates, _, time = fmu.fmu.doStep(currentCommunicationPoint=0.0, communicationStepSize=4.0)
            assert (terminates, time) == (ends, reached)


def test_a_step_that_must_not_end_early_is_discarded() -> None:
    with (
        structure_fmu(FALLING, {"displacement_limit": 50.0}) as fmu,
        pytest.raises(FMICallException, match="discard"),
    ):
        fmu.step(10.0)


def test_an_export_of_fmi_2_ends_the_simulation_in_its_way(tmp_path: Path) -> None:
    table = export_fmu(
        "Structure",
        tmp_path / "falls.fmu",
        fmi="2.0",
        starts={"displacement_limit": 50.0},
        structure=structure_file({name: np.array(value) for name, value in FALLING.items()}, coupled=False),
    )
    with ComponentFmu(table, version="2.0") as fmu:
        with pytest.raises(FMICallException, match="fmi2DoStep"):
            fmu.step(10.0)
        assert "displacement_limit, 50 m" in fmu.messages[-1]


def test_potential_energy_of_a_negative_stiffness_is_negative() -> None:
    with structure_fmu(FALLING) as fmu:
        assert fmu.get("energy.potential") == -0.125
        fmu.step(1.0)
        assert fmu.get("energy.potential") + fmu.get("energy.kinetic") == pytest.approx(-0.125, rel=1e-14)


def test_damping_of_any_sign_that_couples_modes_is_taken() -> None:
    matrix = np.array([[-0.2, 0.3], [0.3, 0.1]])
    arrays = {**FALLING, "mode.angular_frequency": [-1.0, 2.0], "mode.damping": matrix}
    with structure_fmu({**arrays, "mode.observed_shape": [1.0, 1.0]}, coupled=True) as fmu:
        fmu.step(2.0)
        system = np.zeros((4, 4))
        system[:2, 2:], system[2:, :2], system[2:, 2:] = np.eye(2), np.diag([1.0, -4.0]), -matrix
        exact = expm(2.0 * system) @ [0.5, 0.0, 0.0, 0.0]
        assert fmu.get("displacement") == pytest.approx(exact[0] + exact[1], rel=1e-13)
