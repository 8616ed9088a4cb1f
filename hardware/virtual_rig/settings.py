"""The file of a virtual rig: which scene is its plant, which device measures it, what is wired to what."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.hardware.virtual_rig.profiles import PROFILES
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import (
    Problem,
    lines_of,
    read_table,
    syntax_problem,
    unknown_key,
)

_LARGEST = 2**16
_STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
SENSED = ("displacement", "velocity", "contact_force", "output")
"""What an input can see: the plant in SI units; `output`: the voltage of the output that drives it."""

Quantity = Literal["displacement", "velocity", "contact_force", "output"]
_NUMBER = Field(ge=0, le=31)


class RigTable(BaseModel):
    """`[rig]`: plant and device."""

    model_config = _STRICT

    scene: Annotated[str, Rule("the file of a scene, beside this file", hint='Write "../beam.toml".')]
    device: Annotated[Literal["labpc+", "xseries"], Rule('"labpc+" or "xseries"')]
    name: Annotated[
        str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"), Rule("a letter, then letters and digits")
    ] = "Dev1"
    speed: Annotated[
        FiniteFloat, Field(gt=0.0, le=1000.0), Rule("seconds of the rig in a second, > 0 and <= 1000")
    ] = 1.0


class ExciterTable(BaseModel):
    """`[exciter]`: the output that drives the force."""

    model_config = _STRICT

    output: Annotated[int, _NUMBER, Rule("the number of an analog output, from 0")]
    gain: Annotated[FiniteFloat, Rule("a finite number", "N/V")]


class SensorTable(BaseModel):
    """`[[sensor]]`: what an input sees."""

    model_config = _STRICT

    input: Annotated[int, _NUMBER, Rule("the number of an analog input, from 0")]
    quantity: Annotated[Quantity, Rule(", ".join(SENSED))]
    gain: Annotated[FiniteFloat, Rule("a finite number", "V per SI unit")]


@dataclass(frozen=True, slots=True)
class Wire:
    """What an input is wired to.

    Attributes
    ----------
    signal : str
        Of the plant.
    amplification : float
        V for a unit of the signal.
    output : int or None
        The output that it is wired to, instead.
    """

    signal: str
    amplification: float = 1.0
    output: int | None = None


class RigSettings(BaseModel):
    """A virtual rig."""

    model_config = ConfigDict(frozen=True)

    source: str
    rig: RigTable
    exciter: ExciterTable
    sensors: tuple[SensorTable, ...]

    @property
    def wires(self) -> dict[int, Wire]:
        """What the inputs are wired to, by their numbers."""
        return {
            each.input: Wire(
                each.quantity, each.gain, self.exciter.output if each.quantity == "output" else None
            )
            for each in self.sensors
        }

    @property
    def scene(self) -> Path:
        """The file of the plant."""
        return Path(self.source).parent / self.rig.scene


def read_rig(path: Path) -> RigSettings:
    """Read the file of a rig.

    Raises
    ------
    UsageError
        It cannot be read, is no TOML, or describes no rig: all problems, a line for each.
    """
    try:
        with path.open("rb") as file:
            text = file.read(_LARGEST).decode("utf-8-sig")
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or "it is no UTF-8 text"
        raise UsageError(f"{path}: expected the file of a rig (TOML), got none: {reason}.") from problem
    try:
        document = parse_toml(text)
    except ValueError as problem:
        raise UsageError(syntax_problem(problem, text).line(str(path))) from None
    problems: list[Problem] = []
    found = _tables(document, problems)
    if problems or found is None:
        raise UsageError("\n".join(lines_of(problems, str(path))))
    rig, exciter, sensors = found
    return RigSettings(source=str(path), rig=rig, exciter=exciter, sensors=sensors)


def _tables(
    document: dict[str, Any], problems: list[Problem]
) -> tuple[RigTable, ExciterTable, tuple[SensorTable, ...]] | None:
    known = ("rig", "exciter", "sensor")
    problems += [unknown_key((key,), known) for key in document if key not in known]
    rig = read_table(RigTable, document.get("rig"), ("rig",), problems)
    exciter = read_table(ExciterTable, document.get("exciter"), ("exciter",), problems)
    listed = document.get("sensor", [])
    if not isinstance(listed, list) or not listed:
        problems.append(Problem("sensor", "at least one sensor", "none", "Write [[sensor]]."))
        return None
    read = [read_table(SensorTable, each, ("sensor", place), problems) for place, each in enumerate(listed)]
    sensors = tuple(each for each in read if each is not None)
    if rig is not None and exciter is not None and len(sensors) == len(read):
        problems += _wiring_problems(rig, exciter, sensors)
        return rig, exciter, sensors
    return None


def _wiring_problems(rig: RigTable, exciter: ExciterTable, sensors: tuple[SensorTable, ...]) -> list[Problem]:
    profile = PROFILES[rig.device]
    found = []
    if exciter.output >= profile.outputs:
        found.append(
            Problem(
                "exciter.output", f"0 to {profile.outputs - 1}, those of {rig.device}", str(exciter.output)
            )
        )
    taken: set[int] = set()
    for place, sensor in enumerate(sensors):
        where = f"sensor[{place + 1}].input"
        if sensor.input >= profile.inputs:
            found.append(
                Problem(where, f"0 to {profile.inputs - 1}, those of {rig.device}", str(sensor.input))
            )
        if sensor.input in taken:
            found.append(Problem(where, "an input of its own", f"{sensor.input} again"))
        taken.add(sensor.input)
    return found
