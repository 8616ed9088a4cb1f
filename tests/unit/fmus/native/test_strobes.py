"""The strobes of an export as an output clock: it ticks at each instant of forcing phase zero, and only there."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi3 import FMU3Model, FMU3Slave
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.component_fmu import ComponentFmu

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.export import export_fmu

DRIVE = {"damping": 0.1, "forcing.amplitude": 0.5, "forcing.angular_frequency": 1.0}
STOP = {"contact[1].law": 1, "contact[1].position": 0.3, "contact[1].restitution": 0.7}
GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0


@pytest.fixture(scope="module")
def strobed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("strobes") / "o.fmu"
    return export_fmu("oscillator", path, starts={**DRIVE, **STOP}, strobes=True)


def instants(frequency: float, phase: float, first: int, count: int) -> list[float]:
    """Return exact instants of phase zero, to the nearest double: (2 pi k - phase) / frequency, 50 digits."""
    with mp.workdps(50):
        return [float((2 * mp.pi * k - mpf(phase)) / mpf(frequency)) for k in range(first, first + count)]


def instance(kind: Any, path: Path, folder: Path) -> Any:
    """Return an instance of FMPy that is not made yet."""
    token = read_model_description(path).instantiationToken
    return kind(
        guid=token,
        unzipDirectory=extract(path, folder),
        modelIdentifier="Oscillator",
        instanceName="instance",
    )


def resolve(fmu: ComponentFmu) -> tuple[bool, float]:
    """Pass event mode; return whether the clock ticks, and the time of the next event."""
    ticks = bool(fmu.fmu.getClock([fmu.reference("phase_zero")])[0])
    answers = fmu.fmu.updateDiscreteStates()
    assert not fmu.fmu.getClock([fmu.reference("phase_zero")])[0]
    fmu.fmu.enterStepMode()
    return ticks, answers[-1]


def begun(path: Path, start: float = 0.0, **changes: float) -> tuple[ComponentFmu, list[float], float]:
    """Return an instance with event mode at its start, its ticks so far, and the time of the next one, s."""
    names = {"frequency": "forcing.angular_frequency", "phase": "forcing.phase"}
    parameters = {names.get(name, name): value for name, value in changes.items()}
    fmu = ComponentFmu(path, parameters, event_mode=True, start_time=start, initialize=False)
    fmu.initialize(start)
    ticks, following = resolve(fmu)
    return fmu, [start] if ticks else [], following


def ticks_of(fmu: ComponentFmu, ticks: list[float], step: float, end: float) -> list[float]:
    """Return the instants of all ticks up to `end`, with steps of this size and no look at the next event time."""
    while fmu.time < end:
        fmu.step(min(step, end - fmu.time))
        if fmu.needs_event:
            fmu.fmu.enterEventMode()
            ticked, _ = resolve(fmu)
            ticks += [fmu.time] * ticked
    return ticks


def test_ten_thousand_ticks_come_at_their_instants_across_impacts(strobed: Path) -> None:
    fmu, ticks, _ = begun(strobed)
    with fmu:
        found = ticks_of(fmu, ticks, 20.0 * GOLDEN, 62832.0)
        assert fmu.get("contact[1].count") > 5000
    exact = instants(1.0, 0.0, 0, 10_001)
    assert len(found) == len(exact)
    np.testing.assert_allclose(found[1:], exact[1:], rtol=1e-15)


@settings(max_examples=40, deadline=None)
@given(
    frequency=st.floats(0.05, 400.0),
    phase=st.floats(-50.0, 50.0),
    step=st.floats(0.01, 9.0),
    start=st.floats(-1e3, 1e6) | st.just(0.0),
)
def test_any_forcing_ticks_at_its_phase_zero(
    strobed: Path, frequency: float, phase: float, step: float, start: float
) -> None:
    period = 2.0 * math.pi / frequency
    fmu, ticks, _ = begun(strobed, start, frequency=frequency, phase=phase, displacement_start=0.0)
    with fmu:
        found = ticks_of(fmu, ticks, step * period, start + 20.5 * period)
    room = 1e-12 * (abs(start) + 50.0 * period + abs(phase) * period)
    first = math.floor((start * frequency + phase) / (2.0 * math.pi))
    exact = [t for t in instants(frequency, phase, first - 2, 30) if start - room <= t <= found[-1] + room]
    np.testing.assert_allclose(found, exact[len(exact) - len(found) :], atol=room, rtol=0.0)
    assert 20 <= len(found) <= 21


def test_a_step_may_end_at_the_announced_strobe(strobed: Path) -> None:
    fmu, ticks, following = begun(strobed)
    with fmu:
        while len(ticks) < 50:
            fmu.step(following - fmu.time)
            assert fmu.needs_event
            assert not fmu.returned_early
            fmu.fmu.enterEventMode()
            ticked, following = resolve(fmu)
            assert ticked
            ticks.append(fmu.time)
    np.testing.assert_allclose(ticks[1:], instants(1.0, 0.0, 1, 49), rtol=1e-15)


def test_the_clocked_values_are_those_of_the_strobe_and_stay_until_the_next(strobed: Path) -> None:
    with ComponentFmu(strobed) as plain:
        assert plain.get("strobe.displacement") == plain.get("displacement")
        expected = [(plain.get("displacement"), plain.get("velocity"))]
        for time in instants(1.0, 0.0, 1, 5):
            plain.advance(time)
            assert not plain.needs_event
            expected.append((plain.get("displacement"), plain.get("velocity")))
        assert plain.get("strobe.displacement") == expected[0][0]
        assert not plain.fmu.getClock([plain.reference("phase_zero")])[0]
    fmu, _, _ = begun(strobed)
    with fmu:
        for x, v in expected[1:]:
            fmu.advance_to_event()
            assert fmu.get("strobe.displacement") == fmu.get("displacement") == pytest.approx(x, abs=1e-12)
            assert fmu.get("strobe.velocity") == pytest.approx(v, abs=1e-12)
            resolve(fmu)
            fmu.needs_event = False
            fmu.step(1.0)
            assert fmu.get("strobe.displacement") == pytest.approx(x, abs=1e-12)
            assert fmu.get("displacement") != fmu.get("strobe.displacement")


def test_a_tuned_frequency_moves_the_next_tick(strobed: Path) -> None:
    fmu, ticks, _ = begun(strobed)
    with fmu:
        ticks_of(fmu, ticks, 0.3, 7.0)
        fmu.fmu.enterEventMode()
        fmu.set("forcing.angular_frequency", 4.0)
        ticked, following = resolve(fmu)
        assert not ticked
        turned = 7.0 - 2.0 * math.pi  # rad since the last strobe
        assert following == pytest.approx(7.0 + (2.0 * math.pi - turned) / 4.0, rel=1e-14)
        found = ticks_of(fmu, [], 5.0, 12.0)
    gaps = [following + k * math.pi / 2.0 for k in range(len(found))]
    assert len(found) == 3
    np.testing.assert_allclose(found, gaps, rtol=1e-14)


def test_a_restored_state_ticks_again_and_only_what_lies_ahead(strobed: Path) -> None:
    fmu, ticks, _ = begun(strobed)
    with fmu:
        ticks_of(fmu, ticks, 1.0, 20.0)
        kept, time = fmu.serialized(), fmu.time
        first = ticks_of(fmu, [], 1.0, 60.0)
        fmu.restore(kept)
        fmu.time = time
        assert ticks_of(fmu, [], 1.0, 60.0) == first
        fmu.fmu.reset()
        fmu.initialize()
        fmu.time = 0.0
        assert resolve(fmu)[0]
        assert ticks_of(fmu, [0.0], 1.0, 20.0) == ticks


def test_a_force_without_a_phase_never_ticks(strobed: Path) -> None:
    fmu, ticks, following = begun(strobed, frequency=0.0, displacement_start=0.0)
    with fmu:
        assert ticks_of(fmu, ticks, 1.0, 50.0) == []
        assert following == 0.0  # no event is announced


def test_without_early_return_the_clock_ticks_at_ends_of_steps_alone_and_a_warning_says_so(
    strobed: Path, tmp_path: Path
) -> None:
    messages: list[str] = []
    fmu = instance(FMU3Slave, strobed, tmp_path)
    fmu.instantiate(
        eventModeUsed=True,
        earlyReturnAllowed=False,
        logMessage=lambda _, __, ___, text: messages.append(text.decode()),
    )
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    assert (
        "earlyReturnAllowed = false: the clock ticks only where a step ends at nextEventTime" in messages[-1]
    )
    *_, time = fmu.updateDiscreteStates()
    fmu.enterStepMode()
    assert fmu.doStep(0.0, time)[0]
    fmu.enterEventMode()
    fmu.updateDiscreteStates()
    fmu.enterStepMode()
    event, _, early, reached = fmu.doStep(time, 30.0)
    assert (event, early, reached) == (False, False, time + 30.0)
    fmu.freeInstance()


def test_an_importer_without_event_mode_runs_as_without_the_clock(strobed: Path, tmp_path: Path) -> None:
    plain = export_fmu("oscillator", tmp_path / "p.fmu", starts={**DRIVE, **STOP})
    with ComponentFmu(plain) as one, ComponentFmu(strobed, early_return=True) as other:
        for _ in range(50):
            one.step(1.7)
            other.step(1.7)
            assert not other.needs_event
            assert not other.returned_early
            assert one.state() == other.state()


def test_in_model_exchange_the_clock_ticks_at_the_next_event_time(strobed: Path, tmp_path: Path) -> None:
    variables = read_model_description(strobed).modelVariables
    reference = next(v.valueReference for v in variables if v.name == "phase_zero")
    model = instance(FMU3Model, strobed, tmp_path)
    messages: list[str] = []
    model.instantiate(logMessage=lambda _, __, ___, text: messages.append(text.decode()))
    model.enterInitializationMode()
    model.exitInitializationMode()
    ticks = []
    time = 0.0
    for _ in range(2000):
        assert model.getClock([reference])[0]
        ticks.append(time)
        *_, defined, time = model.updateDiscreteStates()
        assert defined
        model.enterContinuousTimeMode()
        model.setTime(time - 1e-3)
        model.enterEventMode()
        assert not model.getClock([reference])[0]
        *_, again = model.updateDiscreteStates()
        assert again == time
        model.enterContinuousTimeMode()
        model.setTime(time)
        model.enterEventMode()
    np.testing.assert_allclose(ticks[1:], instants(1.0, 0.0, 1, 1999), rtol=1e-15)
    assert messages == []
    model.updateDiscreteStates()
    model.enterContinuousTimeMode()
    model.setTime(time + 7.0)
    model.enterEventMode()
    assert model.getClock([reference])[0]
    assert "s later: the clock ticks now" in messages[-1]
    model.freeInstance()


@pytest.mark.parametrize("body", ["Chain", "Structure"])
def test_every_body_has_the_clock(tmp_path: Path, body: str) -> None:
    drive = {"forcing.angular_frequency": 3.0}
    path = export_fmu(body, tmp_path / "b.fmu", starts=drive, strobes=True, contacts=0)
    fmu, ticks, _ = begun(path)
    with fmu:
        found = ticks_of(fmu, ticks, 0.5, 20.0)
    np.testing.assert_allclose(found, instants(3.0, 0.0, 0, len(found)), rtol=1e-15)
    assert len(found) == 10


def test_what_has_no_strobes_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="Gain: strobes: expected a body with it"):
        export_fmu("gain", tmp_path / "g.fmu", strobes=True)
    with pytest.raises(
        UsageError, match=r"Oscillator: strobes: expected FMI 3\.0 with this option, got FMI 2\.0"
    ):
        export_fmu("oscillator", tmp_path / "o.fmu", strobes=True, fmi="2.0")
