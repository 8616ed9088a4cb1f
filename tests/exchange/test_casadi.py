"""CasADi integrates our bodies, and differentiates their flights: it accepts all variables, and can set states."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest

from exchange._stiff import MASSES, MOST_STEPS, STARTS, STOP_TIME, TOLERANCE
from exchange._tools import CASADI, TOOLS, Tool, steps_of
from vibroimpact.fmus.packaging.export import export_fmu

VERSIONS = ("2.0", "3.0")
MASS, STIFFNESS, DAMPING, DISPLACED = 2.0, 8.0, 0.4, 0.1
FLIGHT = 3.0
"""End of the flight, s: the stops are far from it."""


def exact_flow(time: float) -> np.ndarray:
    """Return the matrix of free flight over a time, acting on displacement and velocity."""
    decay = DAMPING / (2.0 * MASS)
    ringing = np.sqrt(STIFFNESS / MASS - decay**2)
    c, s = np.cos(ringing * time), np.sin(ringing * time) / ringing
    return np.exp(-decay * time) * np.array([[c + decay * s, s], [-STIFFNESS / MASS * s, c - decay * s]])


@pytest.mark.parametrize("version", VERSIONS)
def test_a_flight_and_its_gradient_are_ours(tmp_path: Path, version: str) -> None:
    ca = pytest.importorskip("casadi")
    starts = {"mass": MASS, "stiffness": STIFFNESS, "damping": DAMPING, "displacement_start": DISPLACED}
    starts |= {"contact[1].position": 10.0, "contact[1].law": 1, "contact[1].restitution": 0.8}
    path = export_fmu("oscillator", tmp_path / "o.fmu", fmi=version, starts=starts)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    dae = ca.DaeBuilder("body", str(tmp_path / "unpacked"))
    assert sorted(dae.x()) == ["displacement", "velocity"]
    # CasADi stopped at a variable that was a state, a derivative and an output; it misreads truth values as numbers
    assert {"displacement", "velocity"} < set(dae.y())
    dae.set_y(["displacement", "velocity", "acceleration"])
    ode, y = dae.create("both", ["x", "u"], ["ode", "y"])([DISPLACED, 0.5], dae.start(dae.u()))
    pushed = -(STIFFNESS * DISPLACED + DAMPING * 0.5) / MASS
    assert np.array(ode).ravel() == pytest.approx([0.5, pushed])
    assert np.array(y).ravel() == pytest.approx([DISPLACED, 0.5, pushed])
    dynamics = dae.create("dynamics", ["x"], ["ode"])
    x, x0 = ca.MX.sym("x", 2), ca.MX.sym("x0", 2)
    # CasADi's own differences: its integrator's sensitivities need second derivatives, which an FMU lacks
    differences = {
        "enable_forward": False,
        "enable_reverse": False,
        "enable_jacobian": False,
        "enable_fd": True,
    }
    options = {"reltol": 1e-9, "abstol": 1e-12, **differences}
    flight = ca.integrator("flight", "cvodes", {"x": x, "ode": dynamics(x)}, 0.0, FLIGHT, options)
    end = flight(x0=x0)["xf"]
    landed = np.array(ca.Function("end", [x0], [end])([DISPLACED, 0.0])).ravel()
    expected = exact_flow(FLIGHT) @ [DISPLACED, 0.0]
    assert np.abs(landed - expected).max() < 1e-6 * DISPLACED
    gradient = ca.Function("gradient", [x0], [ca.jacobian(end, x0)])([DISPLACED, 0.0])
    assert np.abs(np.array(gradient) - exact_flow(FLIGHT)).max() < 1e-5


@pytest.mark.parametrize("version", VERSIONS)
def test_its_jacobian_is_exact_forward_and_in_reverse(tmp_path: Path, version: str) -> None:
    ca = pytest.importorskip("casadi")
    path = export_fmu(
        "oscillator", tmp_path / "o.fmu", fmi=version, starts={"mass": MASS, "stiffness": STIFFNESS}
    )
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    dae = ca.DaeBuilder("body", str(tmp_path / "unpacked"))
    dae.set_y(["acceleration"])
    body = dae.create("body", ["x", "u"], ["ode", "y"])
    at = [DISPLACED, 0.5], dae.start(dae.u())
    over = body.factory("over", ["x", "u"], ["jac:ode:x", "jac:y:u"])(*at)
    force = [name == "force" for name in dae.u()]
    # to the last digit: CasADi's differences would be off by 1e-8
    assert np.array_equal(np.array(over[0]), [[0.0, 1.0], [-STIFFNESS / MASS, 0.0]])
    assert np.array(over[1]).ravel()[force] == pytest.approx([1.0 / MASS], rel=1e-15)
    reverse = body.factory("reverse", ["x", "u", "adj:ode", "adj:y"], ["adj:x", "adj:u"])
    states, inputs = (np.array(one).ravel() for one in reverse(*at, [1.0, 2.0], [3.0]))
    assert np.array_equal(states, [-5.0 * STIFFNESS / MASS, 1.0])
    assert inputs[force] == pytest.approx(5.0 / MASS)


STEPPED = [*(tool for tool in TOOLS if tool.name == "FMPy"), CASADI]


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("tool", STEPPED, ids=[tool.name for tool in STEPPED])
def test_a_stiff_chain_of_12_masses_takes_as_many_steps_as_with_its_jacobian(
    tmp_path: Path, tool: Tool, version: str
) -> None:
    if reason := tool.missing():
        pytest.skip(reason)
    path = export_fmu("chain", tmp_path / "c.fmu", masses=MASSES, fmi=version, starts=STARTS)
    assert 0 < steps_of(tool, path, tmp_path, STOP_TIME, TOLERANCE) <= MOST_STEPS
