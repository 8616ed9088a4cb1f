"""Components with restricted steps: contacts, watched events and clocks that need others are refused by attribute."""

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
parameters = {{ {more} }}
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
    own = ('Variability="fixed"', 'Variability="fixed" intervalDecimal=".25"')
    redescribed(fmu_factory.clocked(folder), folder / "Fixed.fmu", own, ONE_SIZE)
    return folder


def read(
    folder: Path,
    fmu: str = "OneSize.fmu",
    record: str = "recorded_time = 0.3\nrate = 100",
    execution: str = "macro_step = 0.001",
    variables: str = '"m.x", "m.v"',
    more: str = "x = -0.1, v = 2.0",
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


WATCH = '[[event]]\nwatch = "m.x"\ndirection = "rising"\n'
ANY_SIZE = "expected components whose communication steps may have any size, got"


@pytest.mark.parametrize(
    ("options", "line"),
    [
        ({"parts": CONTACT}, f"contact[1]: {ANY_SIZE} {OF_2}"),
        ({"fmu": "Grid.fmu", "parts": CONTACT}, f"contact[1]: {ANY_SIZE} {OF_3}"),
        ({"parts": WATCH}, f"event[1].watch: {ANY_SIZE} {OF_2}"),
        (
            {"execution": ""},
            f"execution.macro_step: expected the size of the steps of {OF_2}, got none. Add macro_step = ...",
        ),
        (
            {
                "fmu": "Fixed.fmu",
                "more": "",
                "execution": "macro_step = 0.1",
                "variables": "",
                "record": "recorded_time = 1.0",
            },
            "component.m.fmu: expected clocks that tick at multiples of 0.1 s, its only step",
        ),
    ],
)
def test_what_needs_other_steps_is_refused_by_the_attribute(
    folder: Path, options: dict[str, str], line: str
) -> None:
    assert line in refusal(folder, **options)


def test_a_contact_of_others_may_cut_the_steps_of_all(folder: Path) -> None:
    parts = CONTACT.replace('"m"', '"other"') + '[component.other]\nfmu = "Mass.fmi2.fmu"\n'
    for fmu in ("OneSize.fmu", "Grid.fmu"):
        read(folder, fmu=fmu, parts=parts)


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
    scene = read(
        folder, fmu="Mass.fmi2.fmu", more="x = -0.1, v = 2.0, scheme = 5.0, inner_step = 0.0083", parts=parts
    )
    runner = GeneralRunner(scene)
    with pytest.raises(ComponentError) as refused:
        runner.run({})
    runner.close()
    message = str(refused.value)
    assert "got the same change over " in message
    assert "canHandleVariableCommunicationStepSize" in message
    assert "kg" not in message
