"""Derivatives over time of outputs in co-simulation: against the exact motion, 40 digits and other importers."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from ctypes import c_double, c_int32, c_uint32
from typing import Any

import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray
from support.component_fmu import (
    HUNT_CROSSLEY,
    KELVIN_VOIGT,
    RESTITUTION,
    VERSIONS,
    ComponentFmu,
    forced,
    stop,
)

from vibroimpact.fmus import fmu_path

LAWS = {"flies": 0, "rests": RESTITUTION, "presses": KELVIN_VOIGT, "presses harder": HUNT_CROSSLEY}
#: Amplitude of the forcing and input force of each body, by name.
ACTING = {
    "Oscillator": ("forcing.amplitude", "force", "force_rate"),
    "Chain": ("forcing.amplitude[1]", "force[1]", "force_rate[1]"),
    "Beam": ("forcing.amplitude", "force", "force_rate"),
    "Structure": ("forcing.amplitude", "force", "force_rate"),
}
AT = 0.05
#: Steps of the differences, s: short against the fastest mode.
STEPS = {"Beam": 2.0**-15}


def rates(it: ComponentFmu, names: Sequence[str], order: int) -> NDArray[np.float64]:
    """Return the derivatives of outputs by the functions of the standard, which FMPy binds but does not wrap."""
    n = len(names)
    references = (c_uint32 * n)(*(it._variables[name].valueReference for name in names))
    orders, values = (c_int32 * n)(*([order] * n)), (c_double * n)()
    if it.version == "3.0":
        it.fmu.fmi3GetOutputDerivatives(it.fmu.component, references, n, orders, values, n)
    else:
        it.fmu.fmi2GetRealOutputDerivatives(it.fmu.component, references, n, orders, values)
    return np.array(values[:])


def outputs_of(it: ComponentFmu) -> list[str]:
    real = (v for v in it._variables.values() if v.type in {"Real", "Float64"} and not v.dimensions)
    return [v.name for v in real if v.causality == "output" and v.variability == "continuous"]


def started(component: str, phase: str, version: str, **more: float) -> ComponentFmu:
    amplitude, force, rate = ACTING[component]
    given: dict[str, float] = {"contact[1].law": LAWS[phase], **more}
    given |= {"contact[1].position": 0.0 if phase == "rests" else -0.01}
    given |= {"contact[1].stiffness": 500.0, "contact[1].damping": 0.2, "contact[1].exponent": 1.7}
    given |= {"forcing.angular_frequency": 3.0, amplitude: 0.1, force: 5e2, rate: 40.0}
    given |= {"base_acceleration": 0.3, "base_acceleration_rate": 0.7}
    if component == "Chain":
        given |= {"contact[1].mass_number": 1}
    elif component == "Beam":
        given |= {"modes": 2}
    return ComponentFmu(component, given, version=version)


def goes_on(it: ComponentFmu) -> None:
    """Let the inputs go on along their slopes."""
    name = "force[1]" if "force[1]" in it._variables else "force"
    it.set(name, 5e2 + 40.0 * it.time)
    it.set("base_acceleration", 0.3 + 0.7 * it.time)


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("phase", LAWS)
@pytest.mark.parametrize("component", ACTING)
def test_derivatives_of_outputs_are_differences_of_the_motion(
    component: str, phase: str, version: str
) -> None:
    step = STEPS.get(component, 2.0**-13)
    with started(component, phase, version) as it:
        names = outputs_of(it)
        goes_on(it.advance(AT))
        rows: list[list[NDArray[np.float64]]] = []
        for _ in range(5):
            values = np.array([it.get(name) for name in names], dtype=float)
            rows.append([values, rates(it, names, 1), rates(it, names, 2)])
            goes_on(it.advance(it.time + step))
        assert (it.get("contact[1].force") > 0.0) == (phase != "flies")
    for order in (1, 2):
        below = [row[order - 1] for row in rows]
        expected = (below[0] - 8.0 * below[1] + 8.0 * below[3] - below[4]) / (12.0 * step)
        found, size = rows[2][order], np.abs([row[order] for row in rows]).max()
        moves = [i for i, name in enumerate(names) if np.isfinite(expected[i]) and "work" not in name]
        error = np.abs(found - expected)[moves]
        assert (error <= 1e-5 * np.maximum(np.abs(expected[moves]), 1e-3 * size)).all()
        assert np.abs(found).max() > 0.0


def test_derivatives_of_an_oscillator_are_right_to_14_digits() -> None:
    with ComponentFmu("Oscillator", {**forced(0.5, 1.3), "displacement_start": 0.2, "mass": 1.7}) as it:
        it.advance(1.0)
        names = ["displacement", "velocity", "acceleration", "energy.kinetic"]
        found = [rates(it, names, order) for order in (1, 2)]
        time, x, v = (mpmath.mpf(it.get(name)) for name in ("time", "displacement", "velocity"))
        with mpmath.workdps(40):
            m, c, w = mpmath.mpf(1.7), mpmath.mpf(0.2), mpmath.mpf(1.3)
            a = (mpmath.mpf(0.5) * mpmath.cos(w * time) - c * v - x) / m
            jerk = (-mpmath.mpf(0.5) * w * mpmath.sin(w * time) - c * a - v) / m
            snap = (-mpmath.mpf(0.5) * w**2 * mpmath.cos(w * time) - c * jerk - a) / m
            expected = [[v, a, jerk, m * v * a], [a, jerk, snap, m * (a * a + v * jerk)]]
            for row, exact in zip(found, expected, strict=True):
                assert all(abs(mpmath.mpf(one) - two) <= 1e-14 for one, two in zip(row, exact, strict=True))


def test_a_stop_follows_its_inputs_and_has_no_rates_of_its_own() -> None:
    with ComponentFmu("ImpactStop", {"law": KELVIN_VOIGT, "stiffness": 5.0, "displacement": 0.1}) as it:
        it.advance(0.1)
        assert (rates(it, ["applied_force"], 1) == 0.0).all()


@pytest.mark.parametrize("version", VERSIONS)
def test_descriptions_tell_the_order_and_others_are_refused(version: str) -> None:
    for component in (*ACTING, "ImpactStop"):
        with zipfile.ZipFile(fmu_path(component, version)) as archive:
            assert archive.read("modelDescription.xml").count(b'maxOutputDerivativeOrder="2"') == 1
    with ComponentFmu("Oscillator", stop(1.0), version=version) as it:
        for names, order, reason in (
            (["displacement"], 3, "expected an order from 1 to 2, got 3"),
            (["displacement"], 0, "expected an order from 1 to 2, got 0"),
            (["mass"], 1, "is no output here"),
        ):
            with pytest.raises(FMICallException):
                rates(it, names, order)
            assert reason in it.messages[-1]


def test_an_instant_of_rest_on_a_moving_stop_is_refused() -> None:
    given: dict[str, Any] = {"stop[1].velocity": -0.1, "contact[1].law": RESTITUTION, "force": 100.0}
    with ComponentFmu("Structure", {**given, "contact[1].restitution": 0.0}) as it:
        it.advance(0.5)
        assert it.get("contact[1].force") > 0.0
        with pytest.raises(FMICallException):
            rates(it, ["displacement"], 1)
        assert "a contact at rest on a stop that moves" in it.messages[-1]
