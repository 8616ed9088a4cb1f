"""An FMU with only a description, and general scenes with it and their problems."""

from __future__ import annotations

import zipfile
from pathlib import Path

from support.component_mistakes import COUPLED
from support.scenes import problems_of

UNITS = """
<Unit name="m"><BaseUnit m="1"/></Unit>
<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>
<Unit name="metre"><BaseUnit m="1"/></Unit>
<Unit name="m/s"><BaseUnit m="1" s="-1"/></Unit>
<Unit name="length"/>
"""
BALL = """
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="h" valueReference="1" causality="output" variability="continuous" initial="exact"
 declaredType="Height" start="1"/>
<Float64 name="v" valueReference="2" causality="output" variability="continuous" initial="exact" unit="m/s"
 start="0"/>
<Float64 name="e" valueReference="3" causality="parameter" variability="tunable" initial="exact" start="0.7"
 min="0.5" max="1"/>
<Float64 name="v_min" valueReference="4" causality="local" variability="constant" initial="exact"
 start="0.1"/>
<Float64 name="in_metre" valueReference="5" causality="input" unit="metre" start="0">
 <Alias name="in"/></Float64>
<Float64 name="in_mm" valueReference="6" causality="input" unit="mm" start="0"/>
<Float64 name="in_length" valueReference="7" causality="input" unit="length" start="0"/>
<Float64 name="in_bare" valueReference="8" causality="input" start="0"/>
<Boolean name="up" valueReference="9" causality="output"/>
<Boolean name="hold" valueReference="10" causality="input" start="false"/>
<UInt8 name="bits" valueReference="11" causality="parameter" start="0"/>
<String name="label" valueReference="12" causality="parameter" variability="fixed"><Start value="x"/></String>
"""
FREE_BALL = """\
[component.ball]
fmu = "ball.fmu"
[record]
recorded_time = 3.0
"""


def write_fmu(
    path: Path, *, interface: str = "CoSimulation", restorable: bool = True, variables: str = BALL
) -> Path:
    """Write an FMU with only a description, which is enough for all messages before a run."""
    outputs = "".join(f'<Output valueReference="{r}"/>' for r in (1, 2, 9))
    steps = ' canHandleVariableCommunicationStepSize="true"' if interface == "CoSimulation" else ""
    description = (
        '<?xml version="1.0" encoding="UTF-8"?>'
        '<fmiModelDescription fmiVersion="3.0" modelName="Ball" instantiationToken="{ball}">'
        f'<{interface} modelIdentifier="ball" canGetAndSetFMUState="{str(restorable).lower()}"{steps}/>'
        f"<UnitDefinitions>{UNITS}</UnitDefinitions>"
        '<TypeDefinitions><Float64Type name="Height" unit="m"/></TypeDefinitions>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure>{outputs}</ModelStructure>"
        "</fmiModelDescription>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description)
    return path


def coupled(old: str, new: str) -> str:
    """Return the scene of two coupled components with another text in a place."""
    assert old in COUPLED
    return COUPLED.replace(old, new)


def ball_problems(folder: Path, *lines: str) -> list[str]:
    """Return the problems of a scene of the ball with these lines."""
    write_fmu(folder / "ball.fmu")
    return problems_of("\n".join([FREE_BALL, *lines]), folder / "s.toml")
