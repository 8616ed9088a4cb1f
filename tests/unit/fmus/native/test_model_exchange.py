"""Model exchange: FMPy's CVode integrates our bodies, and finds the exact results of co-simulation."""

import math
from collections.abc import Mapping
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_void_p
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from support.integrated import Integrated

from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.shipped import fmu_path

VERSIONS = ("2.0", "3.0")
RESTITUTION, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY, EXTERNAL = 1, 2, 3, 4, 5
DISCARD = 2
OUTPUTS = ["displacement", "velocity", "energy.kinetic", "energy.potential"]
CONTACT = ["count", "last_time", "last_velocity", "stuck", "stick_start", "stick_end", "force"]


def stop(number: int = 1, **values: float) -> dict[str, float]:
    return {f"contact[{number}].{name}": value for name, value in values.items()}


def simulate(
    component: str, start: Mapping[str, float], stop_time: float, kind: str = "ModelExchange", **options: Any
) -> Any:
    chosen: dict[str, Any] = {"version": "3.0", "relative_tolerance": 1e-9, "contacts": 1, **options}
    recorded = [f"contact[{k}].{name}" for k in range(1, chosen.pop("contacts") + 1) for name in CONTACT]
    return fmpy.simulate_fmu(
        str(fmu_path(component, chosen.pop("version"))),
        fmi_type=kind,
        solver="CVode",
        start_values=dict(start),
        stop_time=stop_time,
        output_interval=stop_time / 100.0,
        output=OUTPUTS + recorded,
        timeout=60.0,
        **chosen,
    )


def impacts(result: Any) -> tuple[Any, Any]:
    """Return times and speeds of the impacts at contact 1, each recorded after the impact."""
    after = np.flatnonzero(np.diff(result["contact[1].count"])) + 1
    return result["contact[1].last_time"][after], result["contact[1].last_velocity"][after]


# ---- impacts of closed form ----

#: x = -0.01 cos t meets its stop at 0.005 when t = 2 pi / 3.
FREE = {"displacement_start": -0.01, **stop(law=RESTITUTION, restitution=0.8, position=0.005)}


@pytest.mark.parametrize("version", VERSIONS)
def test_an_impact_is_found_to_the_tolerance_of_the_integrator(version: str) -> None:
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        found = simulate("Oscillator", FREE, 3.0, version=version, relative_tolerance=tolerance)
        times, speeds = impacts(found)
        assert speeds == pytest.approx([0.01 * math.sin(2.0 * math.pi / 3.0)], rel=1e3 * tolerance)
        errors.append(abs(times[0] - 2.0 * math.pi / 3.0))
        assert errors[-1] < 1e3 * tolerance
    assert errors[2] < errors[1] < errors[0]


def test_an_elastic_stop_keeps_the_energy_over_twelve_impacts() -> None:
    found = simulate("Oscillator", {**FREE, **stop(restitution=1.0)}, 50.0)
    energy = found["energy.kinetic"] + found["energy.potential"]
    assert found["contact[1].count"][-1] == 12
    assert energy == pytest.approx(energy[0], rel=1e-6)


def test_the_orbit_of_one_impact_a_period_stays_what_it_is() -> None:
    frequency, restitution, amplitude, clearance = 2.4, 0.7, 1.0, 0.1
    # between impacts at t = 0 and T: x = a cos t + b sin t + p cos(w t + phase), x = clearance at both, v(0) = -r v(T)
    period, p = 2.0 * math.pi / frequency, amplitude / (1.0 - frequency**2)
    cosine, sine = math.cos(period), math.sin(period)
    # with u = p cos(phase), y = -p w sin(phase): a = clearance - u, b = a (1 - cosine) / sine
    #   b + y = -r (b cosine - a sine + y)
    slope = (1.0 - cosine) / sine
    factor = -(slope + restitution * (slope * cosine - sine)) / (1.0 + restitution)
    # y = factor (clearance - u) and (y / w)^2 + u^2 = p^2
    k = (factor / frequency) ** 2
    roots = np.roots([1.0 + k, -2.0 * k * clearance, k * clearance**2 - p**2])
    orbits = []
    for u in roots.real:
        y = factor * (clearance - u)
        velocity = (clearance - u) * slope + y
        if velocity < 0.0:
            orbits.append((math.atan2(-y / frequency / p, u / p), velocity))
    ((phase, velocity),) = orbits
    start = {
        "displacement_start": clearance,
        "velocity_start": velocity,
        "forcing.amplitude": amplitude,
        "forcing.angular_frequency": frequency,
        "forcing.phase": phase,
        **stop(law=RESTITUTION, restitution=restitution, position=clearance),
    }
    times, speeds = impacts(simulate("Oscillator", start, 4.5 * period))
    assert times == pytest.approx(period * np.arange(1, 5), abs=1e-6)
    assert speeds == pytest.approx(-velocity / restitution, rel=1e-6)


# ---- against co-simulation ----

DRIVEN = {
    "displacement_start": -0.01,
    "damping": 0.05,
    "forcing.amplitude": 0.02,
    "forcing.angular_frequency": 0.7,
}
YIELDING = {
    "kelvin_voigt": stop(law=KELVIN_VOIGT, stiffness=100.0, damping=3.0, position=0.002),
    "hertz": stop(law=HERTZ, stiffness=5000.0, position=0.002),
    "hunt_crossley": stop(law=HUNT_CROSSLEY, stiffness=5000.0, damping=20.0, position=0.002),
}
SCENES: dict[str, tuple[str, dict[str, float], float]] = {
    **{law: ("Oscillator", {**DRIVEN, **values}, 40.0) for law, values in YIELDING.items()},
    "two stops": (
        "Oscillator",
        {
            **DRIVEN,
            **stop(1, law=RESTITUTION, restitution=0.6, position=0.01),
            **stop(2, law=RESTITUTION, restitution=0.6, position=-0.012, side=2),
        },
        30.0,
    ),
    "chain of three": (
        "Chain",
        {
            "masses": 3,
            "displacement_start[1]": -0.01,
            "damping[1]": 0.1,
            "forcing.amplitude[1]": 0.02,
            "forcing.angular_frequency": 0.5,
            **stop(1, law=RESTITUTION, restitution=0.6, position=0.01, mass_number=3),
            **stop(2, law=RESTITUTION, restitution=0.9, position=-0.03, side=2, mass_number=2),
        },
        30.0,
    ),
    "structure of one mode": (
        "Structure",
        {
            "forcing.amplitude": 0.02,
            "forcing.angular_frequency": 0.7,
            **stop(1, law=RESTITUTION, restitution=0.6, position=0.01),
            **stop(2, law=KELVIN_VOIGT, stiffness=100.0, damping=3.0, position=-0.012, side=2),
        },
        30.0,
    ),
    "beam of four modes": (
        "Beam",
        {
            "modes": 4,
            "forcing.amplitude": 2.0,
            "forcing.angular_frequency": 200.0,
            **stop(law=KELVIN_VOIGT, stiffness=1e5, damping=10.0, position=0.001, location=1.0),
        },
        0.03,
    ),
}


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize("version", VERSIONS)
def test_the_motion_is_that_of_co_simulation(scene: str, version: str) -> None:
    component, start, end = SCENES[scene]
    exact = simulate(component, start, end, "CoSimulation", version=version, contacts=2)
    found = simulate(component, start, end, version=version, contacts=2)
    rows = np.searchsorted(found["time"], exact["time"] - 1e-9 * end)
    size = float(np.ptp(exact["displacement"]))
    assert found["displacement"][rows] == pytest.approx(exact["displacement"], abs=1e-4 * size)
    for k in (1, 2):
        assert found[f"contact[{k}].count"][-1] == exact[f"contact[{k}].count"][-1]
    assert exact["contact[1].count"][-1] > 0


#: The force presses the mass against its stop during a part of each period.
PRESSED = {**DRIVEN, "forcing.angular_frequency": 0.3, **stop(law=RESTITUTION, restitution=0.7, position=0.0)}


def test_chatter_ends_at_rest_until_the_force_lets_go() -> None:
    exact = simulate("Oscillator", PRESSED, 40.0, "CoSimulation")
    found = simulate("Oscillator", PRESSED, 40.0, relative_tolerance=1e-8)
    assert found["contact[1].stick_end"][-1] == pytest.approx(exact["contact[1].stick_end"][-1], abs=1e-7)
    assert found["contact[1].stick_start"][-1] == pytest.approx(exact["contact[1].stick_start"][-1], abs=5e-3)
    assert found["displacement"][-1] == pytest.approx(exact["displacement"][-1], abs=1e-7)
    held = found["contact[1].stuck"] > 0
    assert held.any()
    assert not held.all()
    assert np.ptp(found["displacement"][held]) < 1e-12
    assert (found["contact[1].force"][held][1:-1] > 0.0).all()


def test_an_integrator_too_coarse_for_the_last_bounces_still_comes_to_rest() -> None:
    times = []
    for tolerance in (1e-3, 1e-5, 1e-8):
        found = simulate("Oscillator", PRESSED, 24.0, relative_tolerance=tolerance)
        assert found["contact[1].stuck"][-1]
        times.append(found["contact[1].stick_start"][-1])
    exact = simulate("Oscillator", PRESSED, 24.0, "CoSimulation")["contact[1].stick_start"][-1]
    errors = np.abs(np.array(times) - exact)
    assert errors[2] < errors[1] < errors[0]


def test_a_plastic_stop_holds_at_once() -> None:
    start = {**PRESSED, **stop(restitution=0.0)}
    exact = simulate("Oscillator", start, 40.0, "CoSimulation")
    found = simulate("Oscillator", start, 40.0)
    assert found["contact[1].count"][-1] == exact["contact[1].count"][-1] == 3
    assert found["contact[1].stick_start"][-1] == pytest.approx(exact["contact[1].stick_start"][-1], abs=1e-5)


def test_impact_limit_ends_the_simulation() -> None:
    found = simulate("Oscillator", {**FREE, "impact_limit": 1}, 10.0)
    assert found["time"][-1] < 3.0
    assert found["contact[1].count"][-1] <= 1


# ---- the interface ----


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("component", ["Oscillator", "Chain", "Beam", "Structure", "ImpactStop"])
def test_the_binary_has_the_states_that_its_description_counts(
    component: str, version: str, tmp_path: Path
) -> None:
    counts: dict[str, Any] = {
        **{"Chain": {"masses": 3}, "Beam": {"modes": 4}},
        "Structure": {"modes": 5, "model_exchange": True},
    }
    name = {"ImpactStop": "impact_stop"}.get(component, component.lower())
    it = Integrated(
        component,
        version,
        export_fmu(name, tmp_path / "it.fmu", fmi=version, platform=None, **counts.get(component, {})),
    )
    it.fmu.exitInitializationMode()
    states = {"Oscillator": 2, "Chain": 6, "Beam": 8, "Structure": 10, "ImpactStop": 0}[component]
    indicators = 0 if component == "ImpactStop" else 2
    assert it.description.numberOfContinuousStates == states
    assert it.description.numberOfEventIndicators == indicators
    if it.new:
        assert it.fmu.getNumberOfContinuousStates() == states
        assert it.fmu.getNumberOfEventIndicators() == indicators
    it.numbers("getContinuousStates", states)
    nominals = it.numbers("getNominalsOfContinuousStates", states)
    assert all(nominal > 0.0 for nominal in nominals)
    it.numbers("getEventIndicators", indicators)
    assert f"expected {states} values" in it.message(it.numbers, "getContinuousStates", states + 1)


@pytest.mark.parametrize("version", VERSIONS)
def test_states_and_derivatives_are_variables_too(version: str) -> None:
    it = Integrated("Oscillator", version)
    it.set({"mass": 2.0, "damping": 0.5, "stiffness": 3.0, "force": 7.0, "base_acceleration": 0.25})
    it.set(stop(law=RESTITUTION, position=1.0))
    it.begin()
    it.move(0.5, 0.1, -0.2)
    acceleration = (7.0 - 3.0 * 0.1 + 0.5 * 0.2) / 2.0 - 0.25
    assert it.numbers("getContinuousStates", 2) == pytest.approx([0.1, -0.2])
    assert it.derivatives(2) == pytest.approx([-0.2, acceleration])
    assert it.get("displacement") == pytest.approx(0.1)
    assert it.get("relative_acceleration") == pytest.approx(acceleration)
    assert it.get("acceleration") == pytest.approx(acceleration + 0.25)
    assert it.numbers("getEventIndicators", 2)[0] == pytest.approx(0.9)
    assert it.get("contact[1].event_indicator") == pytest.approx(0.9) if version == "3.0" else True
    it.set({"force": 9.0})
    assert it.derivatives(2)[1] == pytest.approx(acceleration + 1.0)


NOT_FINITE = [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf), (1e300, 0.0)]


@pytest.mark.parametrize("states", NOT_FINITE)
@pytest.mark.parametrize("version", VERSIONS)
def test_states_that_are_not_finite_are_discarded_so_that_an_integrator_halves_its_step(
    version: str, states: tuple[float, float]
) -> None:
    it = Integrated("Oscillator", version)
    it.set({"stiffness": 1e20, **stop(law=RESTITUTION, restitution=0.5, position=1.0)})
    it.begin()
    it.move(0.1, *states)
    calls = {"derivatives": lambda: it.derivatives(2)}
    if not np.isfinite(states).all():  # 1e300 has an indicator, and an infinite acceleration
        calls["indicators"] = lambda: it.numbers("getEventIndicators", 2)
    for call in calls.values():
        with pytest.raises(FMICallException) as caught:
            call()
        assert caught.value.status == DISCARD
        assert "Try a shorter step" in it.messages[-1]
    # the instance is unchanged: it takes the shorter step
    it.move(0.05, 0.1, 0.2)
    assert it.derivatives(2) == pytest.approx([0.2, -1e19])
    assert it.numbers("getEventIndicators", 2)[0] == pytest.approx(0.9)


@pytest.mark.parametrize("component", ["Chain", "Beam"])
def test_one_state_of_many_that_is_not_finite_is_discarded(component: str) -> None:
    it = Integrated(component, "3.0")
    it.begin()
    count = it.fmu.getNumberOfContinuousStates()
    used = {"Chain": 2, "Beam": 1}[component]
    it.move(0.1, *[0.0] * (count // 2 + used - 1), math.nan, *[0.0] * (count // 2 - used))
    with pytest.raises(FMICallException) as caught:
        it.derivatives(count)
    assert caught.value.status == DISCARD


@pytest.mark.parametrize("version", VERSIONS)
def test_an_event_of_states_that_are_not_finite_is_an_error(version: str) -> None:
    it = Integrated("Oscillator", version)
    it.begin()
    it.move(0.1, math.nan, 0.0)
    it.fmu.enterEventMode()
    assert "expected finite states" in it.message(it.update)


@pytest.mark.parametrize("version", VERSIONS)
def test_an_impact_turns_the_velocity_at_its_event_and_not_before(version: str) -> None:
    it = Integrated("Oscillator", version)
    it.set({"displacement_start": -0.1, **stop(law=RESTITUTION, restitution=0.5, position=0.0)})
    it.begin()
    it.move(0.1, 1e-9, 0.4)
    assert it.numbers("getEventIndicators", 2)[0] < 0.0
    assert it.derivatives(2)[0] == pytest.approx(0.4)
    it.fmu.enterEventMode()
    values_changed = it.update()[3]
    assert values_changed
    assert it.numbers("getContinuousStates", 2) == pytest.approx([0.0, -0.2], abs=1e-15)
    it.fmu.enterContinuousTimeMode()
    assert it.numbers("getEventIndicators", 2)[0] > 0.0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_saved_state_brings_back_time_states_and_contacts(version: str) -> None:
    it = Integrated("Oscillator", version)
    it.set({"displacement_start": -0.1, **stop(law=RESTITUTION, restitution=0.5, position=0.0)})
    it.begin()
    it.move(0.1, 1e-9, 0.4)
    it.fmu.enterEventMode()
    it.update()
    save, load = ("getFMUState", "setFMUState") if it.new else ("getFMUstate", "setFMUstate")
    saved = getattr(it.fmu, save)()
    it.fmu.enterContinuousTimeMode()
    it.move(0.2, -0.3, -0.1)
    getattr(it.fmu, load)(saved)
    assert it.numbers("getContinuousStates", 2) == pytest.approx([0.0, -0.2], abs=1e-15)
    assert it.get("contact[1].last_time") == pytest.approx(0.1)
    other = Integrated("Oscillator", version, kind="CoSimulation")
    assert "expected a state of an instance of co-simulation" in other.message(
        getattr(other.fmu, load), saved
    )


@pytest.mark.parametrize("version", VERSIONS)
def test_each_kind_refuses_the_calls_of_the_other(version: str) -> None:
    stepped = Integrated("Oscillator", version, kind="CoSimulation")
    integrated = Integrated("Oscillator", version)
    stepped.fmu.exitInitializationMode()
    integrated.begin()
    library = stepped.fmu.dll
    step = library.fmi3DoStep if stepped.new else library.fmi2DoStep
    set_states = library.fmi3SetContinuousStates if stepped.new else library.fmi2SetContinuousStates
    stepped.messages.clear()
    set_states(c_void_p(stepped.fmu.component), (c_double * 2)(), c_size_t(2))
    assert "made for co-simulation" in stepped.messages[-1]
    integrated.messages.clear()
    flags = [byref(c_bool()) for _ in range(3)] + [byref(c_double())] if stepped.new else []
    step(c_void_p(integrated.fmu.component), c_double(0.0), c_double(0.1), c_int(0), *flags)
    assert "made for model exchange" in integrated.messages[-1]


REFUSED: dict[str, tuple[str, dict[str, float]]] = {
    "contact[1].law": ("Oscillator", stop(law=EXTERNAL)),
    "contact[1].relaxation_time": (
        "Chain",
        stop(law=KELVIN_VOIGT, stiffness=1.0, relaxation_time=0.5, position=1.0),
    ),
    "amplitude": ("Oscillator", {"amplitude.damping_slope": 0.1}),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_an_integrator_cannot_follow_is_refused_with_the_way_out(name: str) -> None:
    component, values = REFUSED[name]
    it = Integrated(component, "3.0")
    it.set(values)
    message = it.message(it.fmu.exitInitializationMode)
    assert name in message
    assert "use this component by co-simulation" in message


@pytest.mark.parametrize("version", VERSIONS)
def test_forcing_that_is_tuned_at_an_event_goes_on_at_its_phase(version: str) -> None:
    body = Integrated("Oscillator", version)
    body.set({"forcing.amplitude": 1.0, "forcing.angular_frequency": 2.0})
    body.begin()
    body.move(0.3, 0.1, 0.2)
    body.fmu.enterEventMode()
    body.set({"forcing.amplitude": 3.0, "forcing.angular_frequency": 5.0})
    body.update()
    body.fmu.enterContinuousTimeMode()
    assert body.derivatives(2) == pytest.approx([0.2, 3.0 * math.cos(0.6) - 0.1], rel=1e-14)
    body.move(0.5, 0.1, 0.2)
    assert body.derivatives(2)[1] == pytest.approx(3.0 * math.cos(0.6 + 5.0 * 0.2) - 0.1, rel=1e-14)
    body.fmu.freeInstance()
