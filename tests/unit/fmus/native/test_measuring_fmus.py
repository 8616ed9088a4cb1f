"""The FMUs of the measuring chain, by FMPy in both versions of FMI: the numbers of the Python door, at any steps."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest
from numpy.typing import NDArray
from support.component_fmu import VERSIONS, ComponentFmu, simulate

from vibroimpact.fmus.core.measuring import LoadCell, digitised, exciter_force, gaussian, sensor_reading

Array = NDArray[np.float64]
CELL = {
    "sensitivity": 0.02,
    "natural_frequency": 800.0,
    "damping_ratio": 0.05,
    "offset": 0.1,
    "drift": 0.01,
    "contact_duration": 2e-3,
}


def followed(fmu: ComponentFmu, times: Array, inputs: Mapping[str, Array], output: str = "output") -> Array:
    """Return an output at the ends of steps; each step has the inputs of its end."""
    found = []
    for k, time in enumerate(times):
        for name, values in inputs.items():
            fmu.set(name, float(values[k]))
        if time > fmu.time:
            fmu.step(time - fmu.time)
            fmu.time = time
        found.append(fmu.get(output))
    return np.array(found)


def contact_signals() -> tuple[Array, dict[str, Array], Array, Array]:
    """Return instants, a force and impacts as a body outputs them, and a list of the impacts."""
    times = np.sort(np.concatenate([np.arange(60) * 1e-3, 0.03 * np.arange(1, 40) / 41.0]))
    forces = 5.0 * np.maximum(0.0, np.sin(150.0 * times))
    hits, impulses = np.array([4.3e-3, 5.1e-3, 21.0e-3, 40.4e-3]), np.array([2e-3, 1e-3, 3e-3, 5e-4])
    last = np.searchsorted(hits, times, side="right") - 1
    total = np.concatenate([[0.0], np.cumsum(impulses)])[last + 1]
    at = np.where(last >= 0, hits[last], np.nan)
    return times, {"force": forces, "impulse": total, "impact_time": at}, hits, impulses


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("natural", [0.0, 800.0, 250.0])
def test_a_load_cell_says_what_the_door_says(version: str, natural: float) -> None:
    times, inputs, hits, impulses = contact_signals()
    cell = CELL | {"natural_frequency": natural}
    with ComponentFmu("LoadCell", cell, version=version) as fmu:
        found = followed(fmu, times, inputs)
    expected = LoadCell(**cell).follow(times, inputs["force"], hits, impulses)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("version", VERSIONS)
def test_a_load_cell_goes_back_to_a_saved_state_with_its_half_sines(version: str) -> None:
    times, inputs, _, _ = contact_signals()
    half = int(np.searchsorted(times, 5.5e-3))  # during two half sines
    rest = {name: values[half:] for name, values in inputs.items()}
    with ComponentFmu("LoadCell", CELL, version=version) as fmu:
        followed(fmu, times[:half], {name: values[:half] for name, values in inputs.items()})
        saved, time = fmu.serialized(), fmu.time
        first = followed(fmu, times[half:], rest, "load")
        again = followed_from(fmu, saved, time, times[half:], rest)
        assert np.array_equal(first, again)
    assert len(saved) < 1000, "a state holds the half sines that are under way, not room for all"


def followed_from(
    fmu: ComponentFmu, saved: bytes, time: float, times: Array, inputs: Mapping[str, Array]
) -> Array:
    fmu.restore(saved)
    fmu.time = time
    return followed(fmu, times, inputs, "load")


@pytest.mark.parametrize("version", VERSIONS)
def test_an_impact_without_a_time_begins_with_the_step(version: str) -> None:
    with ComponentFmu("LoadCell", {"contact_duration": 1e-3}, version=version) as fmu:
        fmu.step(1.0)
        fmu.set("impulse", 2e-3 / np.pi)
        fmu.step(0.25e-3)
        assert fmu.get("output") == pytest.approx(math.sqrt(0.5), rel=1e-9)
        assert fmu.get("load") == fmu.get("output")


@pytest.mark.parametrize("version", VERSIONS)
def test_a_load_cell_without_a_duration_refuses_an_impact(version: str) -> None:
    with ComponentFmu("LoadCell", {}, version=version) as fmu:
        fmu.set("impulse", 1.0)
        with pytest.raises(Exception, match="DoStep failed"):
            fmu.step(1e-3)
        assert "contact_duration: expected a number > 0 where impacts come, got 0" in fmu.messages[-1]


@pytest.mark.parametrize("version", VERSIONS)
def test_too_many_half_sines_are_an_error_that_says_so(version: str) -> None:
    with ComponentFmu("LoadCell", {"contact_duration": 1.0}, version=version) as fmu:
        for k in range(2048):
            fmu.set("impulse", float(k + 1))
            fmu.step(1e-4)
        fmu.set("impulse", 3000.0)
        with pytest.raises(Exception, match="DoStep failed"):
            fmu.step(1e-4)
        assert "expected at most 2048 impacts within one contact_duration (1 s)" in fmu.messages[-1]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_sensor_says_what_the_door_says(version: str) -> None:
    values = np.linspace(-0.02, 0.02, 41)
    parameters = {"gain": 1000.0, "offset": 0.5, "range": 10.0}
    with ComponentFmu("Sensor", parameters, version=version) as fmu:
        found = followed(fmu, 0.01 * np.arange(41), {"input": values})
    assert np.array_equal(found, sensor_reading(values, 1000.0, 0.5, 10.0))
    assert np.count_nonzero(found == 10.0) > 1


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_an_exciter_says_what_the_door_says(version: str, side: str) -> None:
    volts, places = np.linspace(-2.0, 2.0, 11), np.linspace(-2e-3, 3e-3, 11)
    parameters = {"gain": 0.5, "offset": 0.1, "distance": 4e-3, "side": 1 if side == "lower" else 2}
    with ComponentFmu("Exciter", parameters, version=version) as fmu:
        found = followed(fmu, 0.1 * np.arange(11), {"input": volts, "displacement": places}, "force")
        fmu.set("displacement", -4e-3 if side == "lower" else 4e-3)
        with pytest.raises(Exception, match="DoStep failed"):
            fmu.step(0.1)
        assert "displacement: expected a body that does not touch the exciter" in fmu.messages[-1]
    assert np.array_equal(found, exciter_force(volts, places, 0.5, 0.1, 4e-3, side))


@pytest.mark.parametrize("version", VERSIONS)
def test_noise_is_that_of_the_door_at_any_steps(version: str) -> None:
    parameters = {"rms": 0.25, "rate": 1e3, "seed": 7, "channel": 3}
    times = np.sort(np.concatenate([1e-3 * np.arange(20), 1e-3 * (np.arange(20) + 0.7)]))
    values = np.cos(300.0 * times)
    with ComponentFmu("Noise", parameters, version=version) as fmu:
        found = followed(fmu, times, {"input": values})
    numbers = gaussian(7, 3, 0, 20)[np.floor(times * 1e3 + 1e-6).astype(int)]
    assert np.array_equal(found, values + 0.25 * numbers)


@pytest.mark.parametrize("version", VERSIONS)
def test_noise_without_a_size_is_the_signal_to_the_last_bit(version: str) -> None:
    with ComponentFmu("Noise", {"rate": 10.0, "input": 0.1}, version=version) as fmu:
        fmu.step(0.7)
        assert fmu.get("output") == 0.1


CONVERTER = {"rate": 1000.0, "bits": 8, "range": 5.0, "skew": 2e-4, "clock_error": 5e4}


def test_an_analog_input_ends_steps_at_its_edges_and_samples_there() -> None:
    found, instants = [], []
    with ComponentFmu("AnalogInput", CONVERTER, event_mode=True) as fmu:
        assert (fmu.get("sample"), fmu.get("output")) == (-1, 0.0)
        while fmu.time < 0.02:
            fmu.step(min(3.3e-3, 0.02 - fmu.time))
            if fmu.needs_event:
                fmu.fmu.enterEventMode()
                instants.append(fmu.time)
                fmu.set("input", 6.0 * math.sin(700.0 * fmu.time))
                fmu.fmu.updateDiscreteStates()
                fmu.fmu.enterStepMode()
                fmu.set("input", 99.0)
                found.append(fmu.get("output"))
                assert fmu.get("sample") == len(found) - 1
    edges = np.arange(len(instants)) / 1050.0 + 2e-4
    np.testing.assert_allclose(instants, edges, rtol=1e-14)
    assert len(edges) == 21
    assert np.array_equal(found, digitised(6.0 * np.sin(700.0 * np.array(instants)), 5.0, 8))


@pytest.mark.parametrize("version", VERSIONS)
def test_an_analog_input_without_events_samples_the_input_of_its_step(version: str) -> None:
    times = np.linspace(0.0, 0.02, 47)
    values = 6.0 * np.sin(700.0 * times)
    with ComponentFmu("AnalogInput", CONVERTER, version=version) as fmu:
        found = followed(fmu, times, {"input": values})
        assert fmu.get("sample") == 20
    edges = np.arange(21) / 1050.0 + 2e-4
    step = np.searchsorted(times, edges - 1e-12)  # the first end at or after the edge
    held = np.concatenate([[0.0], digitised(values, 5.0, 8)[step]])
    assert np.array_equal(found, held[np.searchsorted(edges, times + 1e-12, side="right")])


def test_an_edge_at_the_start_is_the_first_sample() -> None:
    with ComponentFmu("AnalogInput", {"input": 1.0, "rate": 10.0, "bits": 16}, start_time=0.0) as fmu:
        assert (fmu.get("sample"), fmu.get("output")) == (0, digitised(1.0, 10.0, 16)[0])
    with ComponentFmu("AnalogInput", {"input": 1.0, "rate": 10.0}, start_time=0.75) as fmu:
        assert fmu.get("sample") == -1
        fmu.step(0.05)
        assert fmu.get("sample") == 8


@pytest.mark.parametrize(
    ("component", "parameters", "message"),
    [
        ("Sensor", {"gain": math.nan}, "gain: expected a finite number, got"),
        ("Sensor", {"range": -1.0}, "range: expected a finite number >= 0, got -1"),
        ("LoadCell", {"damping_ratio": -0.1}, "damping_ratio: expected 0 to 1000, got -0.1"),
        ("LoadCell", {"natural_frequency": math.inf}, "natural_frequency: expected 0 or 1e-09 to 10000000, got inf"),
        ("Exciter", {"side": 3}, "side: expected 1 (lower) or 2 (upper), got 3"),
        ("Exciter", {"distance": 1.0, "displacement": -1.0}, "displacement: expected a body that does not touch"),
        ("Noise", {"rate": 0.0}, "rate: expected a finite number > 0, got 0"),
        ("Noise", {"seed": -1}, "seed: expected a number >= 0, got -1"),
        ("AnalogInput", {"bits": 33}, "bits: expected 1 to 32, got 33"),
        ("AnalogInput", {"rate": 0.0, "range": 0.0}, "rate: expected a finite number > 0, got 0; range: expected"),
        ("AnalogInput", {"clock_error": -1e6}, "clock_error: expected a number > -1e6, got -1000000"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("version", VERSIONS)
def test_parameters_that_mean_nothing_are_refused_by_name(
    component: str, parameters: dict[str, float], message: str, version: str
) -> None:
    fmu = ComponentFmu(component, parameters, version=version, initialize=False)
    try:
        with pytest.raises(Exception, match="Initialization"):
            fmu.initialize()
        assert message in fmu.messages[-1]
    finally:
        fmu.free()


@pytest.mark.parametrize("version", VERSIONS)
def test_fmpy_runs_each_alone(version: str) -> None:
    result = simulate("Noise", {"rms": 1.0, "seed": 5}, ["output"], 0.05, 1e-3, version=version)
    assert np.array_equal(result["output"], gaussian(5, 0, 0, len(result)))
    result = simulate("LoadCell", CELL | {"drift": 1.0}, ["output"], 0.05, 1e-2, version=version)
    np.testing.assert_allclose(result["output"], 0.1 + result["time"], rtol=1e-14)
