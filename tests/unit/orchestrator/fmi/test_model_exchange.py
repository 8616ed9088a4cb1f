"""FMUs for model exchange in the importer: events and faults, each by an FMU that refuses calls in a wrong mode."""

from __future__ import annotations

import math
import shutil
from ctypes import c_void_p
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import values

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.errors import ComponentError, ComponentFileError, SceneError
from vibroimpact.orchestrator.fmi import cvode
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.events import Event
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import (
    BodyPoint,
    ComponentSpec,
    ConnectionSpec,
    PairSpec,
    StopContactSpec,
)
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.run.summary import contacts, engine
from vibroimpact.orchestrator.scene import parse_scene

VERSIONS = ("2.0", "3.0")
KINDS = (
    *("spring", "ball", "stairs", "stepped", "ends_at_event", "ends_at_step", "short_rates", "short_states"),
    *(
        "nan_rates",
        "short_indicators",
        "rescaled",
        "endless",
        "rates_fail",
        "rates_end",
        "stuck",
        "rates_fatal",
    ),
)
TOLERANCE = 1e-9


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("exchange")
    for fmi in VERSIONS:
        fmu_factory.exchanged(folder, fmi)
    fmu_factory.faulty(folder, "3.0")
    fmu_factory.mass(folder, "3.0")
    return folder


def spec(folder: Path, fmi: str, kind: str = "spring", name: str = "m", **start: float) -> ComponentSpec:
    parameters = {"kind": float(KINDS.index(kind)), **start}
    return ComponentSpec(name, folder / f"Exchanged.fmi{fmi[0]}.fmu", parameters, TOLERANCE)


def importer_of(folder: Path, fmi: str, kind: str, **start: float) -> Importer:
    importer = Importer([spec(folder, fmi, kind, **start)], macro_step=0.1)
    importer.begin()
    return importer


def run(folder: Path, fmi: str, kind: str, end: float = 1.0, **start: float) -> tuple[Importer, list[Event]]:
    importer = importer_of(folder, fmi, kind, **start)
    events: list[Event] = []
    importer.on_event = events.append
    importer.advance(end)
    return importer, events


@pytest.mark.parametrize("in_c", [True, False])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_spring_follows_its_cosine(folder: Path, fmi: str, in_c: bool) -> None:
    importer = importer_of(folder, fmi, "spring")
    importer.steps_in_c = in_c
    importer.advance(10.0)
    assert importer.components["m"].kind == "model_exchange"
    assert values(importer, "m", "x", "v") == pytest.approx([math.cos(10.0), -math.sin(10.0)], abs=1e-6)
    assert values(importer, "m", "steps")[0] >= 100  # each step of the integration is told
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_ball_bounces_at_the_instants_of_its_state_events(folder: Path, fmi: str) -> None:
    importer, events = run(folder, fmi, "ball")
    first = math.sqrt(2.0 / 9.81)
    assert [event.time for event in events] == pytest.approx([first], abs=1e-7)
    speed, flight = 0.8 * 9.81 * first, 1.0 - first
    assert values(importer, "m", "x", "v") == pytest.approx(
        [speed * flight - 4.905 * flight**2, speed - 9.81 * flight], abs=1e-6
    )
    assert values(importer, "m", "count") == [1.0]
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_time_events_are_at_their_instants(folder: Path, fmi: str) -> None:
    importer, events = run(folder, fmi, "stairs", at=0.3, end=1.0)
    assert [event.time for event in events] == pytest.approx([0.3, 0.6, 0.9], rel=0.0, abs=2e-16)
    assert values(importer, "m", "x", "v") == pytest.approx([1.0 + 0.3 + 0.6 + 3 * 0.1, 3.0], abs=1e-9)
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_step_event_is_where_a_completed_step_asks_for_it(folder: Path, fmi: str) -> None:
    importer, events = run(folder, fmi, "stepped", end=4.0, at=0.5, x=0.0, v=1.0)
    assert len(events) == 1
    assert math.asin(0.5) < events[0].time < math.asin(0.5) + 0.1 + 1e-9
    assert values(importer, "m", "count") == [1.0]
    importer.free()


@pytest.mark.parametrize("kind", ["ends_at_event", "ends_at_step"])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_component_ends_the_run(folder: Path, fmi: str, kind: str) -> None:
    importer, _ = run(folder, fmi, kind, at=0.33)
    assert importer.wants_to_end
    assert 0.33 <= importer.time <= 0.4 + 1e-12
    assert importer.time == 0.33 or kind == "ends_at_step"
    importer.free()


@pytest.mark.parametrize("kind", ["short_rates", "short_states", "nan_rates", "short_indicators"])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_discarded_point_makes_the_step_of_the_integration_shorter(
    folder: Path, fmi: str, kind: str
) -> None:
    importer, _ = run(folder, fmi, kind, at=2e-3)
    assert values(importer, "m", "x", "v") == pytest.approx([math.cos(1.0), -math.sin(1.0)], abs=1e-6)
    assert values(importer, "m", "steps")[0] >= 500
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_changed_nominal_values_and_states_are_read_anew(folder: Path, fmi: str) -> None:
    importer, events = run(folder, fmi, "rescaled", at=0.5)
    assert [event.time for event in events] == [0.5]
    assert values(importer, "m", "nominals") == [2.0]
    assert values(importer, "m", "x", "v") == pytest.approx(
        [1e6 * math.cos(1.0), -1e6 * math.sin(1.0)], rel=1e-6
    )
    importer.free()


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("rates_fail", "m: fmi{n}Get{d}Derivatives returned error at time 0.[12].*: the model fails"),
        ("rates_fatal", "m: fmi{n}Get{d}Derivatives returned fatal at time 0.[12]"),
        (
            "rates_end",
            "m: CVode: expected steps from time 0.2.* to 0.3.*, got steps below the rounding of time: "
            "fmi{n}Get{d}Derivatives",
        ),
        (
            "endless",
            "fmi{n}(New|Update)DiscreteStates: expected event iteration to end, got another request after 100",
        ),
        ("stuck", "expected steps that advance, got 100 without progress at time 0.25"),
    ],
)
@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_error_names_component_function_and_time(folder: Path, fmi: str, kind: str, message: str) -> None:
    with pytest.raises(
        ComponentError, match=message.format(n=fmi[0], d="ContinuousState" if fmi == "3.0" else "")
    ):
        run(folder, fmi, kind)


@pytest.mark.parametrize("name", ["u", "d"])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_inputs_are_held_over_a_step_and_discrete_inputs_change_in_event_mode(
    folder: Path, fmi: str, name: str
) -> None:
    stairs = spec(folder, fmi, "stairs", "s", at=1.0)
    importer = Importer(
        [stairs, spec(folder, fmi, x=0.0)], [ConnectionSpec(("s", "count"), ("m", name))], macro_step=0.5
    )
    importer.begin()
    importer.advance(3.0)
    exact = (1.0 - math.cos(2.0)) + (1.0 - math.cos(1.0))
    assert values(importer, "m", "x") == pytest.approx([exact], abs=1e-6)
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_an_input_that_carries_an_indicator_to_its_other_side_is_an_event(folder: Path, fmi: str) -> None:
    stairs = spec(folder, fmi, "stairs", "s", at=1.0)
    feed = ConnectionSpec(("s", "count"), ("m", "u"), 11.0)
    importer = Importer([stairs, spec(folder, fmi)], [feed], macro_step=0.5)
    importer.begin()
    importer.advance(1.9)
    assert values(importer, "m", "count")[0] >= 1.0
    importer.free()


@given(back=st.floats(0.01, 2.0), on=st.floats(0.01, 1.0))
@pytest.mark.parametrize("kind", ["spring", "ball"])
@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_restored_state_goes_on_as_before(
    folder: Path, fmi: str, kind: str, back: float, on: float
) -> None:
    importer = importer_of(folder, fmi, kind)
    importer.advance(back)
    instance, slot = importer.components["m"].instance, c_void_p()
    instance.save(slot)
    ends = []
    for _ in range(3):
        instance.restore(slot)
        instance.step(back, on)
        ends.append([instance.time, instance.needs_event_mode, *values(importer, "m", "x", "v")])
    assert ends[1] == ends[2]  # the solver has begun anew in each
    assert ends[0] == pytest.approx(ends[1], rel=0.0, abs=0.0)
    instance.free_state(slot)
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_component_that_cannot_go_back_is_refused_where_another_cuts_its_step(
    folder: Path, fmi: str
) -> None:
    state = "state" if fmi == "2.0" else "State"
    source = folder / f"Exchanged.fmi{fmi[0]}.fmu"
    fixed = fmu_factory.redescribed(
        source, folder / f"no_state{fmi[0]}.fmu", (f' canGetAndSetFMU{state}="true"', "")
    )
    stairs = {"kind": float(KINDS.index("stairs"))}
    specs = [ComponentSpec(name, fixed, stairs | {"at": at}) for name, at in (("n", 0.45), ("m", 0.25))]
    importer = Importer(specs, macro_step=0.1)
    importer.begin()
    with pytest.raises(
        ComponentError,
        match=r"n: expected a component that goes back to time 0.25, .*\(canGetAndSetFMU[sS]tate = false\)",
    ):
        importer.advance(1.0)
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_a_run_begins_again_as_the_first_time(folder: Path, fmi: str) -> None:
    importer = importer_of(folder, fmi, "ball")
    importer.advance(2.0)
    first = values(importer, "m", "x", "v")
    importer.begin()
    importer.advance(2.0)
    assert values(importer, "m", "x", "v") == first
    importer.free()


@pytest.mark.parametrize("fmi", VERSIONS)
def test_our_oscillator_agrees_with_its_exact_co_simulation(fmi: str) -> None:
    start = {
        **{"displacement_start": 0.01, "stiffness": 40.0, "damping": 0.1, "forcing.amplitude": 1.0},
        **{"forcing.angular_frequency": 5.0, "contact[1].law": 1, "contact[1].position": 0.02},
        "contact[1].restitution": 0.8,
    }
    ends = []
    for run_as in ("co_simulation", "model_exchange"):
        one = ComponentSpec("o", fmu_path("Oscillator", fmi), start, 1e-10, run_as)  # type: ignore[arg-type]
        importer = Importer([one], macro_step=0.1)
        importer.begin()
        importer.advance(10.0)
        ends.append(values(importer, "o", "displacement", "velocity"))
        importer.free()
    assert ends[1] == pytest.approx(ends[0], abs=1e-6)


@pytest.mark.parametrize(
    ("file", "run_as", "message"),
    [
        (
            "Exchanged.fmi3.fmu",
            "co_simulation",
            "expected an FMU with co-simulation, got model-exchange only",
        ),
        ("Faulty.fmi3.fmu", "model_exchange", "expected an FMU with model-exchange, got co-simulation only"),
    ],
)
def test_a_kind_that_the_fmu_lacks_is_refused(folder: Path, file: str, run_as: str, message: str) -> None:
    with pytest.raises(ComponentFileError, match=message):
        Component(ComponentSpec("m", folder / file, run_as=run_as))  # type: ignore[arg-type]


@pytest.mark.parametrize("which", ["port", "stop"])
def test_a_stop_and_a_contact_port_need_co_simulation(folder: Path, which: str) -> None:
    ours = ComponentSpec(
        "s", fmu_path("ImpactStop" if which == "stop" else "Oscillator"), run_as="model_exchange"
    )
    contacts = [StopContactSpec("m", "x", "v", "f", "s", 1.0)] if which == "stop" else []
    pairs = [PairSpec(("s", "contact[1]"), BodyPoint("m", "x", "v", "f", 1.0))] if which == "port" else []
    with pytest.raises(
        ComponentError, match="s: expected a stop or a contact port that runs as co-simulation"
    ):
        Importer([ComponentSpec("m", folder / "Mass.fmi3.fmu"), ours], contacts=contacts, pairs=pairs)


def test_a_machine_without_the_library_gets_an_error_that_names_it(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cvode, "platform_folder", lambda: "riscv64-linux")
    cvode.cvode.cache_clear()
    with pytest.raises(ComponentError, match=r"expected CVODE of SUNDIALS 7 .*fmpy/sundials/riscv64-linux"):
        Component(spec(folder, "3.0"))
    cvode.cvode.cache_clear()


@pytest.mark.parametrize("place", ["scikit_sundae.libs", "sksundae/.dylibs"])
def test_where_fmpy_has_no_library_that_of_scikit_sundae_serves(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    fmpy = cvode.package_folder("fmpy")
    assert fmpy is not None
    wheel = tmp_path / place
    wheel.mkdir(parents=True)
    for file in (fmpy / "sundials" / cvode.platform_folder()).iterdir():
        name = file.name if file.name.startswith("lib") else f"lib{file.name}"
        shutil.copy(file, wheel / name.replace(file.suffix, f"-0a1b2c3d{file.suffix}.7.9.0"))
    places = {"fmpy": tmp_path / "fmpy", "sksundae": tmp_path / "sksundae"}
    monkeypatch.setattr(cvode, "package_folder", places.__getitem__)
    cvode.cvode.cache_clear()
    component = Component(spec(folder, "3.0"))
    cvode.cvode.cache_clear()
    assert component.name == "m"
    component.free()


SCENE = """
[scene]
units = "SI"
[component.m]
fmu = "{fmu}"
run_as = "{run_as}"
{more}
[record]
recorded_time = 1.0
rate = 10
variables = ["m.x"]
[execution]
macro_step = 0.1
"""


def test_a_run_tells_the_kind_and_the_tolerance(folder: Path) -> None:
    plain = folder / "Exchanged.fmi3.fmu"
    own = ("  <ModelVariables>", '  <DefaultExperiment tolerance="1e-4"/>\n  <ModelVariables>')
    fmu_factory.redescribed(plain, folder / "tolerance.fmu", own)
    for fmu, more, tolerance in (
        (plain.name, "", "1e-08"),
        ("tolerance.fmu", "", "0.0001"),
        ("tolerance.fmu", "tolerance = 1e-5", "1e-05"),
    ):
        text = SCENE.format(fmu=fmu, run_as="auto", more=more)
        scene = parse_scene(text, str(folder / "scene.toml"))
        assert f"m (model exchange, tolerance {tolerance})" in engine(scene)
        runner = GeneralRunner(scene)
        samples = runner.run({}).samples
        runner.close()
        assert samples is not None
        assert samples[-1, 1] == pytest.approx(math.cos(1.0), abs=100.0 * float(tolerance))


BESIDE_A_BALL = """
[component.m]
fmu = "Exchanged.fmi2.fmu"
parameters = { kind = 3.0, x = 0.1, v = 1.0 }
COMPONENT
[record]
recorded_time = 0.6
transient_time = 0.033
rate = 11.11111111111111
variables = ["m.x"]
[execution]
macro_step = 0.3
exchange = "jacobi"
guard = false
"""
BALL = """[component.ball]
fmu = "SteppedBall.fmi3.fmu"
"""


def test_the_rest_of_a_step_that_another_component_ended_keeps_no_samples_of_its_first_part(
    folder: Path,
) -> None:
    fmu_factory.stepped_ball(folder)
    records = []
    for ball in ("", BALL):
        scene = parse_scene(BESIDE_A_BALL.replace("COMPONENT", ball), str(folder / "scene.toml"))
        runner = GeneralRunner(scene)
        try:
            records.append(runner.run({}).samples)
        finally:
            runner.close()
    assert records[0] is not None
    assert records[1] == pytest.approx(records[0], abs=1e-6)


def test_a_scene_names_a_kind_that_its_fmu_lacks(folder: Path) -> None:
    text = SCENE.format(fmu="Exchanged.fmi3.fmu", run_as="co_simulation", more="")
    expected = (
        r"component.m.run_as: expected a kind .*got .*Exchanged.fmi3.fmu, which has model exchange only"
    )
    with pytest.raises(SceneError, match=expected):
        parse_scene(text, str(folder / "scene.toml"))


CONTACT = '[[contact]]\nbody = "m"\ndisplacement = "x"\nvelocity = "v"\nstop = "s"\n'
STOP = (
    '[component.s]\nfmu = "ImpactStop"\nparameters = { position = -0.5, side = "lower", restitution = 0.8 }\n'
)


def test_a_scene_with_a_contact_in_model_exchange_runs_and_records_its_impacts(folder: Path) -> None:
    text = SCENE.format(fmu="Exchanged.fmi3.fmu", run_as="auto", more=STOP).replace("= 1.0", "= 2.5")
    record = None
    for force in ("", 'force = "u"\n'):
        scene = parse_scene(text + CONTACT + force, str(folder / "scene.toml"))
        assert ("impulses and forces on its states" if force else "impacts set its velocity") in contacts(
            scene
        )["contact[1]"]
        runner = GeneralRunner(scene)
        record = runner.run({})
        runner.close()
        assert record.impacts is not None
        assert record.impacts[:, 0] == pytest.approx([math.acos(-0.5)], abs=1e-6)
        assert record.impacts[:, 2] == pytest.approx([math.sin(math.acos(-0.5))], abs=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            [('fmu = "ImpactStop"', 'fmu = "ImpactStop"\nrun_as = "model_exchange"')],
            r"contact\[1\].stop: expected a component that runs as co-simulation, got s in model exchange. ",
        ),
        (
            [("restitution = 0.8", 'law = "hertz", stiffness = 1e4')],
            r"contact\[1\].stop: expected a rigid stop, got s, which yields, for m in model exchange without force",
        ),
        (
            [("Exchanged.fmi3.fmu", "Mass.fmi3.fmu")],
            r"contact\[1\].force: expected the name of an input of the body: the force on that point, got nothing",
        ),
    ],
)
def test_a_contact_that_cannot_be_is_one_line(
    folder: Path, changes: list[tuple[str, str]], message: str
) -> None:
    text = SCENE.format(fmu="Exchanged.fmi3.fmu", run_as="auto", more=STOP) + CONTACT
    for old, new in changes:
        text = text.replace(old, new)
    with pytest.raises(SceneError, match=message):
        parse_scene(text, str(folder / "scene.toml"))


def test_a_scene_watches_a_variable_in_model_exchange(folder: Path) -> None:
    event = '[[event]]\nwatch = "m.x"\ndirection = "falling"\nlevel = 0.9\n'
    text = SCENE.format(fmu="Exchanged.fmi3.fmu", run_as="auto", more="") + event
    runner = GeneralRunner(parse_scene(text, str(folder / "scene.toml")))
    events = runner.run({}).events
    runner.close()
    assert events is not None
    assert events[:, 0] == pytest.approx([math.acos(0.9)], abs=1e-7)
