"""Components with restricted steps: settings that would cut their steps are refused by the FMI attribute."""

from __future__ import annotations

from pathlib import Path

import pytest
from support import fmu_factory
from support.fmu_factory import redescribed

from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import Scene, parse_scene

ONE_SIZE = ('canHandleVariableCommunicationStepSize="true"', 'canHandleVariableCommunicationStepSize="false"')
OF_2 = "OneSize.fmu (canHandleVariableCommunicationStepSize = false)"
OF_3 = "Grid.fmu (fixedInternalStepSize = 0.001)"
SCENE = """
[scene]
units = "SI"
[component.m]
fmu = "{fmu}"
parameters = {{ x = -0.1, v = 2.0{more} }}
[record]
{record}
variables = [{variables}]
[execution]
{execution}
"""
CONTACT = """
[component.s]
fmu = "ImpactStop"
parameters = { law = "kelvin_voigt", stiffness = 1e4 }
[[contact]]
body = "m"
displacement = "x"
velocity = "v"
force = "f"
stop = "s"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("steps")
    mass2, mass3 = (fmu_factory.mass(folder, fmi) for fmi in ("2.0", "3.0"))
    stateless = fmu_factory.mass(folder, "2.0", states=False)
    redescribed(mass2, folder / "OneSize.fmu", ONE_SIZE)
    redescribed(stateless, folder / "OneSizeStateless.fmu", ONE_SIZE)
    redescribed(mass3, folder / "Grid.fmu", ("<CoSimulation ", '<CoSimulation fixedInternalStepSize="1e-3" '))
    redescribed(
        fmu_factory.clocked(folder),
        folder / "Fixed.fmu",
        ('Variability="fixed"', 'Variability="fixed" intervalDecimal=".25"'),
    )
    return folder


def read(
    folder: Path,
    fmu: str = "OneSize.fmu",
    record: str = "recorded_time = 0.3\nrate = 100",
    execution: str = "macro_step = 0.001",
    variables: str = '"m.x", "m.v"',
    more: str = "",
    parts: str = "",
) -> Scene:
    text = SCENE.format(fmu=fmu, record=record, execution=execution, variables=variables, more=more) + parts
    return parse_scene(text, str(folder / "scene.toml"))


def refusal(folder: Path, **options: str) -> str:
    with pytest.raises(SceneError) as refused:
        read(folder, **options)
    return str(refused.value)


def test_what_falls_on_the_steps_is_taken(folder: Path) -> None:
    for options in (
        {},
        {"record": "recorded_time = 0.3\ntransient_time = 0.1\nrate = 1000"},
        {"record": "recorded_time = 0.7\nrate = 10", "execution": "macro_step = 0.1"},
        {"fmu": "OneSizeStateless.fmu", "record": "recorded_time = 0.3\nrate = 300"},  # interpolated
        {"fmu": "Grid.fmu", "record": "recorded_time = 0.2505\nrate = 250"},
    ):
        scene = read(folder, **options)
        assert scene.execution.macro_step == float(options.get("execution", "= 0.001").split("=")[1])


EVERY_50_US, EVERY_3333_US = "recorded_time = 0.3\nrate = 20000", "recorded_time = 0.3\nrate = 300"
WATCH = '[[event]]\nwatch = "m.x"\ndirection = "rising"\n'
SWEEP = '[sweep]\n"execution.macro_step" = { values = [0.001, 0.0007] }\n'
CLOCK = {
    "parts": '[component.c]\nfmu = "Fixed.fmu"\n',
    "execution": "macro_step = 0.1",
    "record": "recorded_time = 0.3\nrate = 10",
}
SAMPLES = "expected samples at multiples of 0.001 s, the step of"
ANY_SIZE = "expected components whose communication steps may have any size, got"
ONLY_STEP = "expected a multiple of macro_step = 0.001 s, the only step of"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (
            {"record": EVERY_3333_US},
            f"record.rate: {SAMPLES} {OF_2}, got 300 from 0 s on. Use a rate of 1000",
        ),
        ({"record": EVERY_50_US}, f"record.rate: {SAMPLES} {OF_2}"),
        ({"record": "recorded_time = 0.3005"}, f"record.recorded_time: {ONLY_STEP} {OF_2}, got 0.3005"),
        (
            {"record": "transient_time = 0.0002\nrecorded_time = 0.3"},
            f"record.transient_time: {ONLY_STEP} {OF_2}, got 0.0002",
        ),
        ({"parts": CONTACT}, f"contact[1]: {ANY_SIZE} {OF_2}"),
        ({"parts": WATCH}, f"event[1].watch: {ANY_SIZE} {OF_2}"),
        ({"parts": SWEEP, "execution": ""}, f"record.rate: {SAMPLES.replace('1', '07')} {OF_2}"),
        (CLOCK, f"component.c.fmu: expected clocks that tick at multiples of 0.1 s, the only step of {OF_2}"),
        ({"fmu": "Grid.fmu", "record": EVERY_3333_US}, f"record.rate: {SAMPLES} {OF_3}"),
        (
            {"fmu": "Grid.fmu", "execution": "macro_step = 0.0015"},
            f"execution.macro_step: expected a multiple of 0.001 s, the step of {OF_3}, got 0.0015",
        ),
        ({"fmu": "Grid.fmu", "parts": CONTACT}, f"contact[1]: {ANY_SIZE} {OF_3}"),
    ],
)
def test_what_cuts_a_step_is_refused_by_the_attribute(
    folder: Path, options: dict[str, str], line: str
) -> None:
    if "rate" not in options.get("record", "rate"):
        options = {**options, "variables": ""}
    assert line in refusal(folder, **options)


def test_a_step_that_is_off_by_a_rounding_is_told_with_the_digits_that_differ(folder: Path) -> None:
    # for example a difference of two times
    almost = "0.00099999999999997877"
    grid = refusal(folder, fmu="Grid.fmu", execution=f"macro_step = {almost}")
    only = refusal(folder, record="recorded_time = 0.3000000000001", variables="")
    rate = refusal(folder, record="recorded_time = 0.3\nrate = 1000.0000001")
    assert f"a multiple of 0.001 s, the step of {OF_3}, got 0.0009999999999999788" in grid
    assert f"{ONLY_STEP} {OF_2}, got 0.3000000000001" in only
    assert "got 1000.0000001 from 0 s on" in rate


def test_a_contact_of_others_beside_steps_of_one_size_is_refused_too(folder: Path) -> None:
    # a contact ends the steps of all components
    parts = CONTACT.replace('"m"', '"other"') + '[component.other]\nfmu = "Mass.fmi2.fmu"\n'
    assert "OneSize.fmu" in refusal(folder, parts=parts)
    read(folder, fmu="Grid.fmu", parts=parts)


def test_bodies_that_hit_each_other_are_refused_like_a_stop(folder: Path) -> None:
    point = '{ displacement = "x", velocity = "v", force = "f", mass = 1.0 }'
    pair = f"""
[component.other]
fmu = "Mass.fmi2.fmu"
[[contact]]
between = ["m", "other"]
restitution = 0.8
bodies = {{ m = {point}, other = {point} }}
"""
    for fmu in ("OneSize.fmu", "Grid.fmu"):
        assert (
            f"contact[1]: expected components whose communication steps may have any size, got {fmu}"
            in refusal(folder, fmu=fmu, parts=pair)
        )


@pytest.mark.parametrize("given", ["mass = 1.0\n", ""])
def test_a_body_that_hides_its_own_step_is_told_of_it_and_not_of_its_mass(folder: Path, given: str) -> None:
    parts = CONTACT + given
    scene = read(folder, fmu="Mass.fmi2.fmu", more=", scheme = 5.0, inner_step = 0.0083", parts=parts)
    runner = GeneralRunner(scene)
    with pytest.raises(ComponentError) as refused:
        runner.run({})
    runner.close()
    message = str(refused.value)
    assert "got the same change over " in message
    assert "canHandleVariableCommunicationStepSize" in message
    assert "kg" not in message


def test_lengths_beyond_all_numbers_are_refused_and_not_computed_with(folder: Path) -> None:
    record = "recorded_time = 1e308\nrate = 1e-300"
    assert "macro_step" in refusal(folder, record=record, execution="macro_step = 1e-300")
