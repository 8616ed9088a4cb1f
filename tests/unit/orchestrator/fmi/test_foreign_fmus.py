"""Foreign FMUs: ends of steps, requests for the end, watched variables, and FMUs that this importer refuses."""

import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest
from support import fmu_factory
from support.places import EXAMPLES

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError, ComponentFileError, SceneError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.orchestrator.fmi import rounding
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.running import open_scene
from vibroimpact.orchestrator.scene import parse_scene

EXAMPLE = EXAMPLES / "bouncing_ball.toml"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("foreign")
    for fmi in ("2.0", "3.0"):
        fmu_factory.faulty(folder, fmi)
        fmu_factory.stepped_ball(folder, fmi)
        fmu_factory.bouncing_ball(folder, fmi)
    fmu_factory.gain(folder)
    return folder


def run(text: str, folder: Path) -> RunRecord:
    runner = GeneralRunner(parse_scene(text, str(folder / "scene.toml")))
    try:
        return runner.run({})
    finally:
        runner.close()


# ---- the bouncing ball of the Reference-FMUs ----


def bounces_of_the_rule(restitution: float, end: float) -> list[float]:
    """Bounces by the rule of the Reference-FMU: Euler steps of 1 ms."""
    h, v, g, found = 1.0, 0.0, -9.81, []
    for k in range(1, round(end / 1e-3) + 1):
        h, v = h + 1e-3 * v, v + 1e-3 * g
        if h <= 0.0 and v < 0.0:
            h, v = np.finfo(float).tiny, -restitution * v
            found.append(k * 1e-3)
            if v < 0.1:
                v = g = 0.0
    return found


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_every_bounce_inside_a_step_of_the_example_is_found_at_its_instant(
    folder: Path, tmp_path: Path, fmi: str
) -> None:
    shutil.copy(folder / f"SteppedBall.fmi{fmi[0]}.fmu", tmp_path / "BouncingBall.fmu")
    scene = parse_scene(EXAMPLE.read_text(encoding="utf-8"), str(tmp_path / "ball.toml"))
    runner = GeneralRunner(scene)
    try:
        for restitution in (0.6, 0.7, 0.8):
            record = runner.run({"ball.e": restitution})
            assert (record.outcome, record.message) == (Outcome.ok, "")
            assert record.events is not None
            expected = bounces_of_the_rule(restitution, 3.0)
            assert len(expected) > 3
            # the solver's step is less than 1e-5 s from the communication point at which the FMU makes it
            np.testing.assert_allclose(record.events[:, 0], expected, rtol=0, atol=1.1e-5)
    finally:
        runner.close()


def test_the_same_ball_unwatched_has_its_events_in_event_mode(folder: Path) -> None:
    text = """
[scene]
units = "SI"
[component.ball]
fmu = "SteppedBall.fmi3.fmu"
[record]
recorded_time = 2.0
[execution]
macro_step = 0.01
"""
    record = run(text, folder)
    assert record.events is not None
    np.testing.assert_allclose(record.events[:, 0], bounces_of_the_rule(0.7, 2.0), rtol=0, atol=1e-9)


def test_an_fmu_that_refuses_the_event_mode_it_declares_runs_without_and_says_so(
    folder: Path, tmp_path: Path
) -> None:
    # Roberts of the Reference-FMUs refuses it
    declared = tmp_path / "Declared.fmu"
    with zipfile.ZipFile(folder / "BouncingBall.fmi3.fmu") as archive, zipfile.ZipFile(declared, "w") as copy:
        for member in archive.namelist():
            content = archive.read(member)
            if member == "modelDescription.xml":
                assert content.count(b'hasEventMode="false"') == 1
                content = content.replace(b'hasEventMode="false"', b'hasEventMode="true"')
            copy.writestr(archive.getinfo(member), content)
    text = """
[scene]
units = "SI"
[component.ball]
fmu = "{}"
[record]
recorded_time = 0.4
variables = ["ball.h"]
rate = 100
[execution]
macro_step = 0.01
"""
    plain = run(text.format("BouncingBall.fmi3.fmu"), folder)
    record = run(text.format(declared), folder)
    assert record.message == "ball made no instance with the event mode that it declares, and ran without"
    assert record.outcome is Outcome.ok
    np.testing.assert_array_equal(record.samples, plain.samples)


def test_a_watch_on_a_body_whose_contact_another_component_answers_is_refused_with_the_reason(
    folder: Path,
) -> None:
    text = """
[scene]
units = "SI"
[component.body]
fmu = "Oscillator"
parameters = { "contact[1].law" = "external", "contact[1].position" = 0.5 }
[component.stop]
fmu = "ImpactStop"
[[connection]]
from = "body.contact[1].velocity"
to = "stop.velocity"
[[connection]]
from = "stop.applied_restitution"
to = "body.contact[1].applied_restitution"
[[event]]
watch = "body.displacement"
direction = "rising"
[record]
recorded_time = 1.0
[execution]
macro_step = 0.1
"""
    with pytest.raises(SceneError) as refused:
        parse_scene(text, str(folder / "scene.toml"))
    (problem,) = refused.value.problems
    assert (
        "event[1].watch: expected a component without a contact, got one that stop.applied_restitution"
        in problem
    )
    assert "runs without event mode and early return" in problem
    with_its_own_law = text.replace('"external"', '"restitution"')
    with_its_own_law = (
        with_its_own_law.split("[component.stop]")[0] + "[[event]]" + text.split("[[event]]")[1]
    )
    assert run(with_its_own_law.replace('"external"', '"restitution"'), folder).outcome is Outcome.ok


# ---- the end of a step ----

LIES = """
[scene]
units = "SI"
[component.before]
fmu = "Gain.fmi2.fmu"
[component.culprit]
fmu = "Faulty.fmi{major}.fmu"
parameters = {{ fault = "{fault}", fault_time = 0.35, says_early = {early} }}
[record]
recorded_time = 1.0
{record}
[execution]
macro_step = 0.1
"""


@pytest.mark.parametrize("early", [0, 1])
@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("says_nan", "nan"),
        ("says_infinite", "inf"),
        ("says_beyond", "360000"),
        ("says_start", "0.3"),
        ("says_past", "-1000000000"),
    ],
)
@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_a_step_that_lies_about_its_end_is_an_error_that_names_what_was_said(
    folder: Path, fmi: str, fault: str, told: str, early: int
) -> None:
    text = LIES.format(major=fmi[0], fault=fault, early=early, record="")
    if fault == "says_start" and (fmi == "2.0" or early):
        # FMI 2.0: no lie, the run ends there; FMI 3.0: the FMU has gone on, and refuses to step from the reported time
        if fmi == "2.0":
            assert run(text, folder).message.startswith("a component asked for the end at time 0.3")
        else:
            with pytest.raises(
                ComponentError,
                match=r"culprit: fmi3DoStep returned error at time 0\.3.*: wrong communication point",
            ):
                run(text, folder)
        return
    with pytest.raises(ComponentError) as failure:
        run(text, folder)
    message = str(failure.value)
    assert message.startswith(f"culprit: fmi{fmi[0]}DoStep said that a step of 0.1 s has ended at")
    assert f"has ended at time {told}" in message
    assert failure.value.instance == "culprit"
    assert failure.value.time == pytest.approx(0.3)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
@pytest.mark.parametrize("record", ["", 'variables = ["culprit.y", "before.y"]\nrate = 100'])
def test_a_component_that_asks_for_the_end_inside_a_step_ends_the_run_there(
    folder: Path, fmi: str, record: str
) -> None:
    found = run(LIES.format(major=fmi[0], fault="end_short", early=0, record=record), folder)
    assert found.outcome is Outcome.ok
    assert found.message.startswith("a component asked for the end at time 0.34999999999999998")
    if found.samples is not None:
        assert found.samples[-1, 0] == pytest.approx(0.35)
        np.testing.assert_allclose(found.samples[:, 1], found.samples[:, 0], rtol=0, atol=1e-12)  # y' = 1


def test_a_component_that_ends_a_repeated_step_early_is_an_error_and_no_wrong_sample(folder: Path) -> None:
    # it counts calls in the process, not in its state: sampled inside a step, it would end short of the sample
    text = LIES.format(major="3", fault="end_short", early=0, record='variables = ["culprit.y"]\nrate = 100')
    text = text.replace("says_early = 0", "fault_after = 1").replace(
        "macro_step = 0.1", "macro_step = 0.1\nguard = true"
    )
    runner = open_scene(parse_scene(text, str(folder / "scene.toml")))
    try:
        with pytest.raises(
            ComponentError, match=r"culprit: fmi3DoStep: expected .* at time 0\.3 .*as before"
        ):
            runner.run({})
    finally:
        runner.close()


def test_two_components_end_together_where_the_second_asks_for_the_end(folder: Path) -> None:
    text = LIES.format(
        major="2", fault="end_short", early=0, record='variables = ["culprit.y", "before.y"]\nrate = 100'
    ).replace('fmu = "Gain.fmi2.fmu"', 'fmu = "Faulty.fmi2.fmu"')
    found = run(text, folder)
    assert found.message.startswith("a component asked for the end at time 0.34999999999999998")
    assert "others" not in found.message  # the other component went back to that time
    assert found.samples is not None
    np.testing.assert_allclose(found.samples[:, 2], found.samples[:, 0], rtol=0, atol=1e-12)
    found = run(text.replace('variables = ["culprit.y", "before.y"]\nrate = 100', ""), folder)
    assert "others, which could not be taken back, had been stepped to 0.4" in found.message


# ---- the rounding mode ----


@pytest.mark.parametrize("place", ["step", "exit_initialization", "instantiate"])
@pytest.mark.parametrize("fault", ["round_upward", "flush_to_zero"])
def test_a_component_that_changes_the_rounding_is_named_and_changes_no_other_component(
    folder: Path, monkeypatch: pytest.MonkeyPatch, fault: str, place: str
) -> None:
    def one(told: str, where: str) -> RunRecord:
        text = LIES.format(
            major="3", fault=told, early=0, record='variables = ["after.displacement"]\nrate = 100'
        )
        text = text.replace("says_early = 0", f'fault_place = "{where}"')
        after = '[component.after]\nfmu = "Oscillator"\nparameters = { displacement_start = 1.0 }\n[record]'
        return run(text.replace("[record]", after), folder)

    usual = one("none", "step")
    if place == "instantiate":
        monkeypatch.setenv(
            "VIBROIMPACT_FAULTY_INSTANTIATE", {"round_upward": "23", "flush_to_zero": "24"}[fault]
        )
    found = one(fault, "step" if place == "instantiate" else place)
    monkeypatch.undo()
    assert rounding.is_usual()
    assert usual.samples is not None
    assert found.samples is not None
    np.testing.assert_array_equal(found.samples, usual.samples)  # bit for bit
    assert "culprit changed the rounding of numbers in its process" in found.message


# ---- what this importer does not import ----


def test_fmi_1_is_called_by_its_name(folder: Path, tmp_path: Path) -> None:
    old = fmu_factory.redescribed(
        folder / "Faulty.fmi2.fmu", tmp_path / "old.fmu", ('fmiVersion="2.0"', 'fmiVersion="1.0"')
    )
    with pytest.raises(ComponentFileError, match=r"old\.fmu: modelDescription\.xml: .*got FMI 1\.0\. "):
        unpack(old)


def test_scheduled_execution_is_called_by_its_name(folder: Path, tmp_path: Path) -> None:
    fmu_factory.redescribed(
        folder / "SteppedBall.fmi3.fmu",
        tmp_path / "clocks.fmu",
        ("<CoSimulation", "<ScheduledExecution"),
        (' hasEventMode="true" mightReturnEarlyFromDoStep="true" fixedInternalStepSize="1e-3"', ""),
        (' canHandleVariableCommunicationStepSize="true"', ""),
    )
    text = '[scene]\nunits = "SI"\n[component.a]\nfmu = "clocks.fmu"\n[record]\nrecorded_time = 1.0\n'
    with pytest.raises(SceneError, match=r"clocks\.fmu for scheduled execution only"):
        parse_scene(text, str(tmp_path / "scene.toml"))


# ---- texts ----

LABELLED = """
[scene]
units = "SI"
[component.ball]
fmu = "BouncingBall.fmi{major}.fmu"
parameters = {{ label = "{label}" }}
[record]
recorded_time = 0.2
variables = ["ball.label_length"]
rate = 10
[execution]
how = "coupled"
macro_step = 0.1
guard = {guard}
"""


@pytest.mark.parametrize("guard", ["true", "false"])
@pytest.mark.parametrize("label", ["", "Grüße", "x" * 5000])
@pytest.mark.parametrize("major", ["2", "3"])
def test_a_component_gets_the_texts_of_its_scene(folder: Path, major: str, label: str, guard: str) -> None:
    scene = parse_scene(LABELLED.format(major=major, label=label, guard=guard), str(folder / "scene.toml"))
    runner = open_scene(scene)
    try:
        for _ in range(2):  # the second time after a reset
            found = runner.run({})
            assert found.samples is not None, found.message
            # FMI 3.0's Int64 keeps its type
            lengths = found.formed_samples[0] if found.formed_samples else found.samples[:, 1]
            np.testing.assert_array_equal(lengths, [len(label.encode())] * 3)
    finally:
        runner.close()


def test_a_text_ends_where_it_is_written_to_end(folder: Path) -> None:
    text = LABELLED.format(major="3", label="a\\u0000b", guard="false")
    with pytest.raises(SceneError, match=r"label: expected text without null characters, got"):
        parse_scene(text, str(folder / "scene.toml"))


# ---- the tolerance of a solver inside an FMU ----

TOLERANT = """
[scene]
units = "SI"
[component.ball]
fmu = "BouncingBall.fmi{major}.fmu"
{tolerance}
[record]
recorded_time = 0.2
variables = ["ball.tolerance"]
rate = 10
[execution]
how = "coupled"
macro_step = 0.1
guard = {guard}
"""


@pytest.mark.parametrize("guard", ["true", "false"])
@pytest.mark.parametrize(("line", "given"), [("", 0.0), ("tolerance = 1e-9", 1e-9)])
@pytest.mark.parametrize("major", ["2", "3"])
def test_a_component_is_set_up_with_the_tolerance_of_its_table(
    folder: Path, major: str, line: str, given: float, guard: str
) -> None:
    text = TOLERANT.format(major=major, tolerance=line, guard=guard)
    runner = open_scene(parse_scene(text, str(folder / "scene.toml")))
    try:
        for _ in range(2):  # the second time after a reset
            found = runner.run({})
            assert found.samples is not None, found.message
            np.testing.assert_array_equal(found.samples[:, 1], given)
    finally:
        runner.close()


@pytest.mark.parametrize("value", ["0.0", "-1e-6", "1.5", "nan", '"fine"'])
def test_a_tolerance_that_is_none_is_refused(folder: Path, value: str) -> None:
    text = TOLERANT.format(major="3", tolerance=f"tolerance = {value}", guard="false")
    with pytest.raises(SceneError, match=r"component\.ball\.tolerance: expected .*got"):
        parse_scene(text, str(folder / "scene.toml"))


# ---- FMUs without functions of states ----

LACKING = """
[component.g]
fmu = "lacking.fmu"
parameters = { gain = 3.0, input = 2.0 }
[record]
recorded_time = 1.0
rate = 10
variables = ["g.output"]
[execution]
guard = false
"""


@pytest.mark.parametrize("declared", [True, False])
def test_an_fmu_without_functions_of_states_runs_unless_it_declares_states(
    tmp_path: Path, declared: bool
) -> None:
    """HIFSuite's FMUs lack these functions, and their descriptions say so."""
    flag = b'canGetAndSetFMUstate="%s"'
    with (
        zipfile.ZipFile(fmu_path("Gain", "2.0")) as source,
        zipfile.ZipFile(tmp_path / "lacking.fmu", "w") as lacking,
    ):
        for name in source.namelist():
            content = source.read(name).replace(b"\0fmi2GetFMUstate\0", b"\0fmi2GetFMUstatx\0")
            if name == "modelDescription.xml":
                assert flag % b"true" in content
                content = content.replace(flag % b"true", flag % (b"true" if declared else b"false"))
            lacking.writestr(name, content)
    if declared:
        with pytest.raises(ComponentFileError, match="exports fmi2GetFMUstate, got one without it"):
            run(LACKING, tmp_path)
    else:
        assert run(LACKING, tmp_path).samples[-1, 1] == 6.0
