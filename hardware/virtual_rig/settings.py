"""The file of a virtual rig: its plant, its device and the wiring."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.toml_files import document_of, text_of
from vibroimpact.hardware.virtual_rig.wiring import Wiring, wiring_of
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import (
    Problem,
    lines_of,
    quoted,
    read_table,
    unknown_key,
)

TABLES = ("rig", "wiring")
WORST_CLOCK = 1e4
"""Maximum error of an input clock, ppm."""


class RigTable(BaseModel):
    """`[rig]`: plant and device."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    scene: Annotated[
        str | None, Rule("the file of a scene, beside this file", hint='Write "../beam.toml".')
    ] = None
    recording: Annotated[
        str | None, Rule("the file of a recording, beside this file", hint='Write "../tip.nc".')
    ] = None
    run: Annotated[
        int | None, Field(ge=0), Rule("a run_index of the file", hint="Leave it out where there is one run.")
    ] = None
    device: Annotated[Literal["labpc+", "xseries"], Rule('"labpc+" or "xseries"')]
    name: Annotated[
        str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,31}$"), Rule("a letter, then letters and digits")
    ] = "Dev1"
    speed: Annotated[
        FiniteFloat, Field(gt=0.0, le=1000.0), Rule("seconds of the rig in a second, > 0 and <= 1000")
    ] = 1.0
    clock_error: Annotated[
        FiniteFloat,
        Field(ge=-WORST_CLOCK, le=WORST_CLOCK),
        Rule("ppm by which the input clock is too fast, from -1e4 to 1e4"),
    ] = 0.0


class RigSettings(BaseModel):
    """A virtual rig; `source` is its file."""

    model_config = ConfigDict(frozen=True)

    source: str
    rig: RigTable
    wiring: Wiring

    def beside(self, name: str) -> Path:
        """Return the path of a file that is given relative to the rig file."""
        return Path(self.source).parent / name


def read_rig(path: Path) -> RigSettings:
    """Read the file of a rig.

    Raises
    ------
    UsageError
        It cannot be read, is no TOML, or describes no rig; every problem has a line.
    """
    document = document_of(text_of(path, "the file of a rig"), str(path))
    problems: list[Problem] = []
    rig, wiring = _tables(document, problems)
    if problems or rig is None or wiring is None:
        raise UsageError("\n".join(lines_of(problems, str(path))))
    return RigSettings(source=str(path), rig=rig, wiring=wiring)


def _tables(document: dict[str, Any], problems: list[Problem]) -> tuple[RigTable | None, Wiring | None]:
    problems += [_unknown_table(key) for key in document if key not in TABLES]
    rig = read_table(RigTable, document.get("rig"), ("rig",), problems)
    if rig is None:
        return None, None
    problems += _plant_problems(rig)
    return rig, wiring_of(document.get("wiring", {}), rig.device, rig.recording is not None, problems)


def _unknown_table(key: str) -> Problem:
    if key in ("exciter", "sensor"):
        hint = (
            f'What is wired says [wiring]; [{key}] belongs into the scene. Write ai0 = "sensor.displacement".'
        )
        return Problem(key, "[rig] and [wiring]", f"[{key}]", hint)
    return unknown_key((key,), TABLES)


def _plant_problems(rig: RigTable) -> list[Problem]:
    if (rig.scene is None) == (rig.recording is None):
        got = "neither" if rig.scene is None else "both"
        return [
            Problem("rig", "scene or recording", got, 'Write scene = "beam.toml", or recording = "tip.nc".')
        ]
    if rig.run is not None and rig.recording is None:
        return [Problem("rig.run", "none beside scene", quoted(rig.run), "It is a run of a recording.")]
    return []
