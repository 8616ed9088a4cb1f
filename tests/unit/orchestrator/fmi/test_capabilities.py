"""Declarations of FMUs: every flag of the schemas is heeded or refused, and an FMU punishes each neglect."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.coupled_parts import link, part, values
from support.fmu_factory import redescribed

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.orchestrator.fmi import eventful, instance2
from vibroimpact.orchestrator.fmi.capabilities import FLAGS, Treatment
from vibroimpact.orchestrator.fmi.instance2 import Instance2
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.importer import plain_loop
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StopContactSpec
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

VERSIONS = ("2.0", "3.0")
STATES = ' canGetAndSetFMU{0}="true" canSerializeFMU{0}="true"'
MASS = """
[scene]
units = "SI"
[component.m]
fmu = "{fmu}"
parameters = {{ v = 1.0, k = 4.0{more} }}
[record]
recorded_time = 0.4
rate = {rate}
variables = ["m.x", "m.v"]
[execution]
macro_step = {macro_step}
"""


Test = Callable[..., None]
PUNISHED: set[tuple[str, str]] = set()
"""Owner and name of each heeded flag with a test whose FMU punishes its neglect."""


def punishes(*names: str) -> Callable[[Test], Test]:
    """Note that the FMU of a test punishes the neglect of these flags."""
    PUNISHED.update((f.owner, f.name) for f in FLAGS if f.name in names and f.treatment is Treatment.heeded)
    return lambda test: test


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("capabilities")
    for fmi in VERSIONS:
        for write in (fmu_factory.mass, fmu_factory.stepped_ball, fmu_factory.faulty, fmu_factory.single):
            write(folder, fmi)
        fmu_factory.mass(folder, fmi, states=False)
    fmu_factory.clocked(folder)
    return folder


def run(text: str, folder: Path) -> RunRecord:
    runner = GeneralRunner(parse_scene(text, str(folder / "scene.toml")))
    try:
        return runner.run({})
    finally:
        runner.close()


def samples_of(record: RunRecord) -> np.ndarray:
    assert record.outcome is Outcome.ok, record.message
    assert record.samples is not None
    return record.samples


def mass_samples(
    folder: Path, fmu: str, rate: float = 100, macro_step: float = 0.01, more: str = ""
) -> np.ndarray:
    return samples_of(run(MASS.format(fmu=fmu, rate=rate, macro_step=macro_step, more=more), folder))


def exact(samples: np.ndarray) -> np.ndarray:
    """Return the motion of a mass of 1 kg on 4 N/m that leaves 0 at 1 m/s."""
    return np.column_stack([0.5 * np.sin(2.0 * samples[:, 0]), np.cos(2.0 * samples[:, 0])])


def described(folder: Path, source: str, *replacements: tuple[str, str]) -> str:
    """Return the name of an FMU of the folder with a changed description."""
    count = sum(1 for _ in folder.glob("described*.fmu"))
    return redescribed(folder / source, folder / f"described{count}.fmu", *replacements).name


# ---- a step is never taken back behind its start ----


@pytest.mark.parametrize("steps_in_c", [True, False])
@pytest.mark.parametrize("states", [True, False])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_no_step_is_said_to_be_taken_back(folder: Path, fmi: str, states: bool, steps_in_c: bool) -> None:
    # an FMU that is told otherwise repeats the previous step
    name = "Mass" if states else "StatelessMass"
    importer = Importer([part("m", folder / f"{name}.fmi{fmi[0]}.fmu", v=1.0, k=4.0)], macro_step=0.01)
    importer.steps_in_c = steps_in_c
    importer.begin()
    importer.advance(0.4)
    moved = values(importer, "m", "x", "v")
    importer.free()
    np.testing.assert_allclose(moved, [0.5 * np.sin(0.8), np.cos(0.8)], rtol=1e-12)


@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_fmu_that_is_told_otherwise_begins_its_last_step_again(
    folder: Path, fmi: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (instance2, eventful, plain_loop):
        monkeypatch.setattr(module, "NO_STATE_PRIOR_TO_POINT", False)
    importer = Importer([part("m", folder / f"Mass.fmi{fmi[0]}.fmu", v=1.0, k=4.0)], macro_step=0.01)
    importer.begin()
    importer.advance(0.4)
    moved = values(importer, "m", "x")
    importer.free()
    assert abs(moved[0]) < 0.03


@pytest.mark.parametrize("fmi", VERSIONS)
def test_no_state_is_set_of_before_a_point_that_was_passed_for_good(folder: Path, fmi: str) -> None:
    # samples, a contact with a foreign stop and its trial steps go back often; the FMU refuses to go too far
    mass = part("m", folder / f"Mass.fmi{fmi[0]}.fmu", v=1.0, k=4.0)
    stop = part("s", fmu_factory.buffer(folder, fmi), k=1e3, gap=0.1)
    contact = StopContactSpec("m", "x", "v", "f", "s", None, "d", "u", "push", "upper")
    importer = Importer([mass, stop], contacts=[contact], macro_step=0.05)
    importer.begin()
    importer.advance(1.0)
    velocity = values(importer, "m", "v")[0]
    importer.free()
    assert velocity < 0.0


# ---- heeded: sizes of steps ----


ONE_SIZE = ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"')


@pytest.mark.parametrize("macro_step", [0.01, 1.0 / 300.0])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_steps_of_one_size_are_kept_and_read_where_they_end(
    folder: Path, fmi: str, macro_step: float
) -> None:
    fmu = described(folder, f"Mass.fmi{fmi[0]}.fmu", ONE_SIZE)
    samples = mass_samples(folder, fmu, 1.0 / macro_step, macro_step, ", scheme = 5.0")
    np.testing.assert_allclose(samples[:, 1:], exact(samples), atol=1e-12)


@punishes("canHandleVariableCommunicationStepSize")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_step_of_another_size_is_wrong_without_a_word_of_the_fmu(folder: Path, fmi: str) -> None:
    # the FMU declares steps of any size
    samples = mass_samples(folder, f"Mass.fmi{fmi[0]}.fmu", 300.0, 0.01, ", scheme = 5.0")
    assert np.max(np.abs(samples[:, 1:] - exact(samples))) > 1e-3


@punishes("fixedInternalStepSize")
def test_a_solver_of_fixed_steps_may_end_a_step_short_of_its_end(folder: Path) -> None:
    declared = part("ball", folder / "SteppedBall.fmi3.fmu")
    silent = folder / described(folder, "SteppedBall.fmi3.fmu", (' fixedInternalStepSize="1e-3"', ""))
    importer = Importer([declared], macro_step=0.0105)
    importer.begin()
    importer.advance(0.3)
    importer.free()
    refused = Importer([part("ball", silent)], macro_step=0.0105)
    refused.begin()
    with pytest.raises(
        ComponentError, match=r"has ended at time .* \(lastSuccessfulTime\), expected the end of the step"
    ):
        refused.advance(0.3)
    refused.free()


# ---- heeded: states, event mode, early return ----


@punishes("canGetAndSetFMUstate", "canGetAndSetFMUState")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_fmu_without_states_is_asked_for_none(folder: Path, fmi: str) -> None:
    fmu = f"StatelessMass.fmi{fmi[0]}.fmu"
    samples = mass_samples(folder, fmu)
    np.testing.assert_allclose(samples[:, 1:], exact(samples), atol=1e-12)
    word = "state" if fmi == "2.0" else "State"
    lies = described(folder, fmu, (f'canGetAndSetFMU{word}="false"', f'canGetAndSetFMU{word}="true"'))
    with pytest.raises(ComponentError, match=r"m: fmi\dGetFMU[sS]tate returned error"):
        mass_samples(folder, lies, 300.0)


def bounces(fmu: Path) -> list[float]:
    """Return the first bounces of a ball, to the end of the step in which it comes to rest, s."""
    found: list[float] = []
    importer = Importer([part("ball", fmu)], macro_step=0.01)
    importer.on_event = lambda event: found.append(event.time)
    importer.begin()
    importer.advance(1.0)
    importer.free()
    return found


@punishes("hasEventMode")
def test_event_mode_is_entered_where_it_is_declared_alone(folder: Path) -> None:
    ball = folder / "SteppedBall.fmi3.fmu"
    without = folder / described(folder, ball.name, ('hasEventMode="true"', 'hasEventMode="false"'))
    found = bounces(ball)
    assert len(found) >= 1
    assert found[0] == pytest.approx(0.453, abs=1e-9)
    assert bounces(without) == []  # its bounces lie inside steps, unseen
    # an FMU without event mode makes no instance with it
    with pytest.raises(ComponentError, match="InstantiateCoSimulation made no instance"):
        Instance3(unpack(folder / "Mass.fmi3.fmu"), "m", event_mode=True)


@punishes("mightReturnEarlyFromDoStep")
def test_an_early_return_counts_whether_it_was_announced_or_not(folder: Path) -> None:
    ball = folder / "SteppedBall.fmi3.fmu"
    silent = folder / described(folder, ball.name, (' mightReturnEarlyFromDoStep="true"', ""))
    assert bounces(silent) == bounces(ball)
    importer = Importer([part("ball", ball)], macro_step=0.01)
    importer.steps_in_c = False
    importer.begin()
    instance = importer.components["ball"].instance
    assert isinstance(instance, Instance3)
    instance.may_return_early = False  # the neglect: its early return is no end
    with pytest.raises(ComponentError, match="since early return was not allowed"):
        importer.advance(1.0)
    importer.free()


# ---- heeded: instances ----


@punishes("canBeInstantiatedOnlyOncePerProcess")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_process_has_one_instance_of_an_fmu_that_allows_no_more(folder: Path, fmi: str) -> None:
    fmu = folder / f"Single.fmi{fmi[0]}.fmu"
    for _ in range(2):  # one after the other
        importer = Importer([part("a", fmu)], macro_step=0.1)
        importer.begin()
        importer.advance(1.0)
        assert values(importer, "a", "y")[0] == pytest.approx(1.0)
        importer.free()
    with pytest.raises(
        ComponentError, match=r"b: expected the only instance of Single.*canBeInstantiatedOnlyOncePerProcess"
    ):
        Importer([part("a", fmu), part("b", fmu)], macro_step=0.1)
    text = '[component.a]\nfmu = "{0}"\n[component.b]\nfmu = "{0}"\n[record]\nrecorded_time = 1.0\n'
    with pytest.raises(
        SceneError, match=r"component.b.fmu: expected another FMU, got .*canBeInstantiatedOnlyOncePerProcess"
    ):
        parse_scene(text.format(fmu.name), str(folder / "scene.toml"))
    flag = ' canBeInstantiatedOnlyOncePerProcess="true"'
    lies = folder / described(folder, fmu.name, (flag, ""))
    both = Importer([part("a", lies), part("b", lies)], macro_step=0.1)
    both.begin()
    both.advance(1.0)
    assert values(both, "a", "y")[0] == pytest.approx(2.0)  # they add to one sum
    both.free()


@punishes("needsExecutionTool")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_the_tool_of_an_fmu_is_named_where_it_makes_no_instance(
    folder: Path, fmi: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    fmu = described(
        folder, f"Faulty.fmi{fmi[0]}.fmu", ("<CoSimulation ", '<CoSimulation needsExecutionTool="true" ')
    )
    monkeypatch.setenv("VIBROIMPACT_FAULTY_INSTANTIATE", "14")  # refuse
    with pytest.raises(
        ComponentError, match=r"a: fmi\dInstantiate.*needs Faulty on this machine \(needsExecutionTool\)"
    ):
        Importer([part("a", folder / fmu)])
    with pytest.raises(ComponentError) as without:
        Importer([part("a", folder / f"Faulty.fmi{fmi[0]}.fmu")])
    assert "needsExecutionTool" not in str(without.value)


@punishes("canNotUseMemoryManagementFunctions")
def test_memory_functions_are_given_to_every_fmu(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mass = folder / "Mass.fmi2.fmu"
    Instance2(unpack(mass), "m").free()
    monkeypatch.setattr(instance2, "callback", lambda name: ctypes.c_void_p())
    with pytest.raises(ComponentError, match="fmi2Instantiate made no instance"):
        Instance2(unpack(mass), "m")


@punishes(
    "providesIntermediateUpdate",
    "canReturnEarlyAfterIntermediateUpdate",
    "recommendedIntermediateInputSmoothness",
)
@pytest.mark.parametrize("steps_in_c", [True, False])
def test_an_fmu_that_calls_back_within_steps_gets_a_callback_that_asks_for_nothing(
    folder: Path, steps_in_c: bool
) -> None:
    # it ends its step where the callback leaves its answers as they are, and refuses a step without one
    fmu = fmu_factory.updating_mass(folder)
    silent = described(folder, fmu.name, ('providesIntermediateUpdate="true"', ""))
    importer = Importer([part("m", fmu, v=1.0, k=4.0)], macro_step=0.01)
    importer.steps_in_c = steps_in_c
    importer.begin()
    importer.advance(0.4)
    assert values(importer, "m", "x")[0] == pytest.approx(0.5 * np.sin(0.8), abs=1e-12)
    importer.free()
    without = Importer([part("m", folder / silent)], macro_step=0.01)
    without.begin()
    with pytest.raises(ComponentError, match="no callback for intermediate updates"):
        without.advance(0.4)
    without.free()
    with pytest.raises(ComponentError, match="made no instance"):  # an FMU without updates gets none
        Instance3(unpack(folder / "Mass.fmi3.fmu"), "m", updates=True)


# ---- heeded: what is offered and never used ----

#: The function that an importer calls where a flag offers it, by the flag.
OFFERED = {
    ("2.0", "canInterpolateInputs"): "SetRealInputDerivatives",
    ("2.0", "maxOutputDerivativeOrder"): "GetRealOutputDerivatives",
    ("2.0", "canSerializeFMUstate"): "SerializedFMUstateSize",
    ("2.0", "providesDirectionalDerivative"): "GetDirectionalDerivative",
    ("3.0", "maxOutputDerivativeOrder"): "GetOutputDerivatives",
    ("3.0", "canSerializeFMUState"): "SerializedFMUStateSize",
    ("3.0", "providesDirectionalDerivatives"): "GetDirectionalDerivative",
    ("3.0", "providesAdjointDerivatives"): "GetAdjointDerivative",
    ("3.0", "providesPerElementDependencies"): "GetVariableDependencies",
    ("3.0", "providesEvaluateDiscreteStates"): "EvaluateDiscreteStates",
}


@punishes(*(flag for _, flag in OFFERED))
@pytest.mark.parametrize(("fmi", "flag"), OFFERED)
def test_what_is_offered_and_not_needed_is_not_called(folder: Path, fmi: str, flag: str) -> None:
    fmu = f"StatelessMass.fmi{fmi[0]}.fmu"
    text = (folder_text := unpack(folder / fmu).folder / "modelDescription.xml").read_text(encoding="utf-8")
    assert folder_text.exists()
    value = "1" if flag.startswith("max") else "true"
    old = f' {flag}="false"' if f' {flag}="false"' in text else " modelIdentifier"
    new = f' {flag}="{value}"' + ("" if old.endswith('"') else old)
    samples = mass_samples(folder, described(folder, fmu, (old, new)))
    np.testing.assert_array_equal(samples, mass_samples(folder, fmu))
    instance = (Instance2 if fmi == "2.0" else Instance3)(unpack(folder / fmu), "m")
    size = ctypes.c_size_t()
    answer = instance._function(OFFERED[fmi, flag])(instance.pointer, None, ctypes.byref(size))
    assert answer == 3  # this FMU's answer to an importer that calls it
    instance.free()


# ---- heeded: steps that go on by themselves ----


@punishes("canRunAsynchronuously")
@pytest.mark.parametrize("steps_in_c", [True, False])
def test_a_step_that_goes_on_by_itself_is_waited_for(folder: Path, steps_in_c: bool) -> None:
    flag = ("<CoSimulation ", '<CoSimulation canRunAsynchronuously="true" ')
    fmu = folder / described(folder, "Faulty.fmi2.fmu", flag)
    importer = Importer([part("a", fmu, fault="pending", fault_time=0.35)], macro_step=0.1)
    importer.steps_in_c = steps_in_c
    importer.begin()
    importer.advance(1.0)  # until its end the FMU refuses all other calls
    assert values(importer, "a", "y")[0] == pytest.approx(1.0)
    importer.free()
    silent = Importer(
        [part("a", folder / "Faulty.fmi2.fmu", fault="pending", fault_time=0.35)], macro_step=0.1
    )
    silent.begin()
    with pytest.raises(ComponentError, match=r"fmi2DoStep returned pending, .*without canRunAsynchronuously"):
        silent.advance(1.0)
    silent.free()


def test_a_step_that_never_ends_is_the_time_out_of_its_component(folder: Path) -> None:
    flag = ("<CoSimulation ", '<CoSimulation canRunAsynchronuously="true" ')
    fmu = described(folder, "Faulty.fmi2.fmu", flag)
    text = (
        f'[component.a]\nfmu = "{fmu}"\nparameters = {{ fault = "pending", fault_time = 0.35, says_early = 1 }}\n'
        "[record]\nrecorded_time = 1.0\n[execution]\nmacro_step = 0.1\nguard = true\ndeadline = 0.5\n"
    )
    runner = open_scene(parse_scene(text, str(folder / "scene.toml")))
    record = runner.run({})
    runner.close()
    assert record.outcome is Outcome.timeout
    assert record.message.startswith("a: fmi2DoStep at time 0.3")


# ---- refused ----


DISCRETE = 'variability="discrete"'
CONSTANT = 'intervalVariability="constant" intervalDecimal="0.2"'


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        (f'input" {DISCRETE} {CONSTANT}', f'output" {DISCRETE} {CONSTANT}', "constant output clock tick"),
        ('intervalDecimal="0.2"', 'intervalDecimal="0"', "input clock tick without an interval > 0"),
        ('intervalDecimal="0.2"', 'intervalDecimal="NaN"', "input clock tick without an interval > 0"),
        ('intervalDecimal="0.2"', "", "input clock tick without an interval > 0"),
        ('intervalDecimal="0.2"', 'intervalDecimal="1" shiftDecimal="-1"', "input clock tick without an interval > 0"),
        ('hasEventMode="true"', 'hasEventMode="false"', "clock tick, late and hasEventMode = false"),
    ],
)  # fmt: skip
def test_other_clocks_are_refused_by_their_names(folder: Path, old: str, new: str, named: str) -> None:
    fmu = described(folder, "Clocked.fmi3.fmu", (old, new))
    text = f'[scene]\nunits = "SI"\n[component.c]\nfmu = "{fmu}"\n[record]\nrecorded_time = 1.0\n'
    with pytest.raises(
        SceneError, match=rf"component.c.fmu: expected clocks as FMI defines them, .*got the {named}"
    ):
        parse_scene(text, str(folder / "scene.toml"))
    with pytest.raises(ComponentError, match=named):
        Component(ComponentSpec("c", folder / fmu))


# ---- heeded: model exchange ----


@punishes("needsCompletedIntegratorStep", "completedIntegratorStepNotNeeded")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_completed_steps_are_told_only_where_the_fmu_wants_them(folder: Path, fmi: str) -> None:
    wanted = ' needsCompletedIntegratorStep="true"'
    change = (
        (wanted, "")
        if fmi == "3.0"
        else ("<ModelExchange", '<ModelExchange completedIntegratorStepNotNeeded="true"')
    )
    silent = redescribed(fmu_factory.exchanged(folder, fmi), folder / f"silent{fmi[0]}.fmu", change)
    told = []
    for fmu in (silent, folder / f"Exchanged.fmi{fmi[0]}.fmu"):
        importer = Importer([part("m", fmu)], macro_step=0.1)
        importer.begin()
        importer.advance(1.0)
        told += values(importer, "m", "steps")
        importer.free()
    assert told[0] == 0.0
    assert told[1] >= 10.0


@punishes("canBeInstantiatedOnlyOncePerProcess", "needsExecutionTool")
@pytest.mark.parametrize("fmi", VERSIONS)
def test_model_exchange_has_the_limits_of_instances_too(folder: Path, fmi: str) -> None:
    flags = 'canBeInstantiatedOnlyOncePerProcess="true" needsExecutionTool="true"'
    exchanged = fmu_factory.exchanged(folder, fmi)
    once = redescribed(exchanged, folder / f"once{fmi[0]}.fmu", ("<ModelExchange", f"<ModelExchange {flags}"))
    with pytest.raises(ComponentError, match=r"b: expected the only instance of .*OnlyOncePerProcess"):
        Importer([part("a", once), part("b", once)])
    token = "instantiationToken" if fmi == "3.0" else "guid"
    wrong = redescribed(once, folder / f"wrong{fmi[0]}.fmu", (f'{token}="{{', f'{token}="{{0'))
    with pytest.raises(ComponentError, match=r"It needs Exchanged on this machine \(needsExecutionTool\)"):
        Importer([part("a", wrong)])


@punishes("canHandleMultipleSetPerTimeInstant")
def test_an_input_that_is_set_once_at_an_instant_is_refused_in_a_loop(folder: Path) -> None:
    once = 'valueReference="3" canHandleMultipleSetPerTimeInstant="false"'
    exchanged = fmu_factory.exchanged(folder, "2.0")
    fmu = redescribed(exchanged, folder / "setonce.fmu", ('valueReference="3"', once))
    gain = part("g", fmu_factory.gain(folder), k=0.5)
    Importer([part("m", fmu), gain], [link("g.y", "m.u")], macro_step=0.1).free()  # no loop
    loop = [link("g.y", "m.u"), link("m.x", "g.u")]
    lists = redescribed(fmu, folder / "loop.fmu", ('index="1" dependencies=""', 'index="1" dependencies="3"'))
    with pytest.raises(
        ComponentError, match=r"m.u: expected an input .*canHandleMultipleSetPerTimeInstant = false"
    ):
        Importer([part("m", lists), gain], loop, macro_step=0.1)


# ---- heeded: clocks ----


CLOCKED = """
[scene]
units = "SI"
[component.y]
fmu = "Faulty.fmi{major}.fmu"
[component.c]
fmu = "{fmu}"
parameters = {{ interval = 0.25, shift = 0.125 }}
[[connection]]
from = "y.y"
to = "c.u"
[record]
recorded_time = 1.0
rate = 1000
variables = ["c.y", "c.ticks", "c.late_ticks", "c.sum"]
[execution]
macro_step = {macro_step}
exchange = "{exchange}"
"""


@pytest.mark.parametrize("exchange", ["gauss_seidel", "jacobi", "iterated"])
@pytest.mark.parametrize(("macro_step", "major"), [(0.03, "3"), (0.2, "2"), (1.0, "3")])
def test_input_clocks_tick_at_their_instants(
    folder: Path, macro_step: float, major: str, exchange: str
) -> None:
    text = CLOCKED.format(fmu="Clocked.fmi3.fmu", macro_step=macro_step, major=major, exchange=exchange)
    samples = samples_of(run(text, folder))
    time, y, ticks, late, total = samples.T
    # a sample at a tick has the value before the tick, except the first
    count = np.where(time == 0.0, 1.0, np.ceil(np.round(time / 0.2, 9)))
    late_count = np.ceil(np.round((time - 0.125) / 0.25, 9)).clip(0.0)
    np.testing.assert_array_equal(ticks, count)
    np.testing.assert_array_equal(late, late_count)
    np.testing.assert_allclose(y, 10.0 * count + 0.2 * (count - 1.0), rtol=0, atol=1e-12)
    exact_sum = sum((time - at).clip(0.0) for at in (*np.arange(6) * 0.2, *(0.125 + 0.25 * np.arange(4))))
    np.testing.assert_allclose(total, exact_sum, rtol=0, atol=1e-9)


@punishes("intervalVariability", "canBeDeactivated")
def test_a_clock_that_nobody_ticks_counts_nothing(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = CLOCKED.format(fmu="Clocked.fmi3.fmu", macro_step=0.1, major="3", exchange="jacobi")
    monkeypatch.setattr("vibroimpact.orchestrator.importer.ticks.Ticks.are_due", lambda *_: False)
    monkeypatch.setattr("vibroimpact.orchestrator.importer.ticks.Ticks._find_next", lambda _: None)
    monkeypatch.setattr("vibroimpact.orchestrator.importer.ticks.Ticks.set", lambda *_: None)
    samples = samples_of(run(text, folder))
    assert not samples[:, 2:].any()


@punishes("supportsFraction")
def test_the_interval_of_a_clock_may_be_a_fraction(folder: Path) -> None:
    # its functions for fractions return an error
    fraction = 'supportsFraction="true" canBeDeactivated="true" resolution="3" intervalCounter="1"'
    fmu = described(folder, "Clocked.fmi3.fmu", ('intervalDecimal="0.2"', fraction))
    text = CLOCKED.format(fmu=fmu, macro_step=0.1, major="3", exchange="jacobi")
    ticks = samples_of(run(text, folder))[:, 2]
    assert ticks[-1] == 3.0  # at 0, 1/3, 2/3; the tick at 1 comes after the last sample
    assert int(np.argmax(ticks == 2.0)) == 334


def test_a_fixed_interval_that_the_fmu_does_not_know_is_an_error_with_the_clock(folder: Path) -> None:
    for parameters in ({"interval": 0.0}, {"shift": -1.0}):
        importer = Importer([part("c", folder / "Clocked.fmi3.fmu", **parameters)], macro_step=0.1)
        with pytest.raises(
            ComponentError, match="c: clock late: expected an interval > 0 and a shift >= 0, got"
        ):
            importer.begin()
        importer.free()


def test_clocked_components_feed_each_other_at_one_tick(folder: Path) -> None:
    fmu = folder / "Clocked.fmi3.fmu"
    importer = Importer([part("b", fmu), part("a", fmu)], [link("a.y", "b.u")], macro_step=0.07)
    outputs = [importer.components[name].group("Float64", ["y"]) for name in "ab"]
    importer.begin()
    importer.advance(0.5)
    assert [group.get()[0] for group in outputs] == [30.0, 60.0]  # at the tick at .4: 10 ticks, and a.y
    with pytest.raises(ComponentError, match=r"a: fmi3GetFloat64 returned error"):
        values(importer, "a", "y")  # a value without a reader is not kept
    importer.free()


# ---- all of them ----


def test_every_heeded_flag_has_an_fmu_that_punishes_its_neglect() -> None:
    heeded = {(flag.owner, flag.name) for flag in FLAGS if flag.treatment is Treatment.heeded}
    assert heeded == PUNISHED
