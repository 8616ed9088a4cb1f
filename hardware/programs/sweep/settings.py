"""The file of a sweep: output, inputs and frequencies."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vibroimpact.analysis.dataset import Direction
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.programs.sweep.frequencies import frequencies_of
from vibroimpact.hardware.recordings.naming import channel_name
from vibroimpact.hardware.rig.inputs import MOST_INPUTS, Input
from vibroimpact.hardware.toml_files import document_of, text_of
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import (
    Problem,
    lines_of,
    quoted,
    read_table,
    unknown_key,
)

_MOST_BYTES = 2**18
"""Largest size of the file, bytes: it may list the frequency of each step."""
_STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
MOST_STEPS = 10_000
LONGEST = 7 * 86_400.0
"""Longest sweep, s."""
MOST_VALUES = 5 * 10**7
"""Most samples of a step, of all inputs, which are kept until its end; also most recorded values of a sweep."""
FEWEST_SAMPLES = 20
"""Fewest samples of a forcing period; with fewer its extrema lie between samples."""

Positive = Annotated[FiniteFloat, Field(gt=0.0)]
Terminal = Annotated[str, Field(pattern=r"^[A-Za-z][\w-]*/[\w/]+$")]
Role = Literal["displacement", "load_cell", "drive"]


class OutputTable(BaseModel):
    """`[output]`: the driving voltage and its limits."""

    model_config = _STRICT

    terminal: Annotated[Terminal, Rule("an analog output such as Dev1/ao0")]
    amplitude: Annotated[Positive, Rule("a number > 0", "V")]
    rate: Annotated[Positive, Rule("samples per second, > 0; of the inputs too", "Hz")]
    highest: Annotated[Positive, Rule("the largest voltage that may go out, > 0", "V")]
    slew: Annotated[Positive, Rule("the fastest change that may go out, > 0", "V/s")]
    ramp_periods: Annotated[
        int, Field(ge=1, le=100_000), Rule("periods in which the amplitude rises and falls, 1 to 100000")
    ] = 20


class SweepTable(BaseModel):
    """`[sweep]` without its frequencies."""

    model_config = _STRICT

    path: Annotated[Literal["up", "down", "up-down"], Rule('"up", "down" or "up-down"')] = "up-down"
    transient_periods: Annotated[int, Field(ge=0, le=10**6), Rule("a whole number, 0 to 1000000")] = 100
    recorded_periods: Annotated[int, Field(ge=1, le=10**5), Rule("a whole number, 1 to 100000")] = 10
    average_periods: Annotated[
        int, Field(ge=1, le=10**4), Rule("periods of which each recorded value is the mean, 1 to 10000")
    ] = 1
    resume_periods: Annotated[
        int, Field(ge=1, le=10**5), Rule("periods at each finished step when it goes on, 1 to 100000")
    ] = 20
    drift: Annotated[
        Positive, Rule("change of the range within a step, over the range, from which on it is flagged")
    ] = 0.01


class InputTable(BaseModel):
    """`[[input]]`: a measured input."""

    model_config = _STRICT

    name: Annotated[str, Rule("a name of letters, digits and _")]
    terminal: Annotated[Terminal, Rule("an analog input such as Dev1/ai0")]
    range: Annotated[Positive, Rule("the range to both sides of 0, > 0", "V")]
    role: Annotated[Role | None, Rule('"displacement", "load_cell" or "drive"')] = None
    threshold: Annotated[Positive | None, Rule("of a load cell: an impact is above it, > 0", "V")] = None
    dead_time: Annotated[
        Positive, Rule("of a load cell: what comes within it after an impact is its ringing", "s")
    ] = 0.005


@dataclass(frozen=True, slots=True)
class SweepSettings:
    """A checked sweep from its file."""

    source: str
    text: str
    """The file is `source`, its content `text`."""
    rig: str | None
    """Used without `--rig`."""
    output: OutputTable
    sweep: SweepTable
    frequencies: tuple[float, ...]
    """Hz, ascending."""
    inputs: tuple[InputTable, ...]
    calibration: str | dict[str, Any]
    """The file of the calibration, or its tables."""

    @property
    def steps(self) -> tuple[tuple[Direction, float], ...]:
        """Direction and frequency (Hz) of each step, in the order of the path."""
        up = [(Direction.up, f) for f in self.frequencies]
        down = [(Direction.down, f) for f in reversed(self.frequencies)]
        return tuple({"up": up, "down": down, "up-down": up + down}[self.sweep.path])

    @property
    def step_periods(self) -> int:
        """Forcing periods of a step."""
        return self.sweep.transient_periods + self.sweep.recorded_periods * self.sweep.average_periods

    @property
    def measured(self) -> list[Input]:
        """The inputs in the form of an acquisition."""
        return [Input(each.name, each.terminal, each.range) for each in self.inputs]

    def place_of(self, role: Role) -> int | None:
        """Return the index of the input with a role; None without one."""
        return next((place for place, each in enumerate(self.inputs) if each.role == role), None)

    @property
    def content(self) -> dict[str, Any]:
        """All keys that affect the measurement; layout and comments do not count."""
        tables = {
            "output": self.output.model_dump(),
            "sweep": {**self.sweep.model_dump(exclude={"resume_periods"}), "frequency": self.frequencies},
            **{f"input.{each.name}": each.model_dump() for each in self.inputs},
        }
        return {f"{table}.{key}": value for table, keys in tables.items() for key, value in keys.items()}

    @property
    def digest(self) -> str:
        """SHA-256 of the content."""
        return hashlib.sha256(json.dumps(self.content).encode()).hexdigest()


def read_sweep(path: Path) -> SweepSettings:
    """Read the file of a sweep.

    UsageError has all problems, a line for each: the file cannot be read, is no TOML, or describes no sweep.
    """
    return parse_sweep(text_of(path, "the file of a sweep", _MOST_BYTES), str(path))


def parse_sweep(text: str, source: str) -> SweepSettings:
    """Return the sweep of a TOML text; `source` is its name in messages.

    UsageError has all problems, a line for each.
    """
    problems: list[Problem] = []
    settings = _settings(document_of(text, source), text, source, problems)
    if settings is not None and not problems:
        problems += _misfits(settings)
    if problems or settings is None:
        raise UsageError("\n".join(lines_of(problems, source)))
    return settings


def _settings(
    document: dict[str, Any], text: str, source: str, problems: list[Problem]
) -> SweepSettings | None:
    known = ("rig", "output", "sweep", "input", "calibration")
    problems += [unknown_key((key,), known) for key in document if key not in known]
    rig, calibration = document.get("rig"), document.get("calibration", {})
    if not isinstance(rig, str | None):
        problems.append(Problem("rig", "a rig as --rig takes it", quoted(rig)))
    if not isinstance(calibration, str | dict):
        problems.append(
            Problem("calibration", "the file of a calibration, or its tables", quoted(calibration))
        )
    output = read_table(OutputTable, document.get("output"), ("output",), problems)
    raw = document.get("sweep")
    frequencies: tuple[float, ...] | None = None
    if isinstance(raw, dict):
        frequencies = frequencies_of(raw.get("frequency"), problems, MOST_STEPS)
        raw = {key: value for key, value in raw.items() if key != "frequency"}
    sweep = read_table(SweepTable, raw, ("sweep",), problems)
    inputs = _inputs(document.get("input", []), problems)
    if problems or output is None or sweep is None or frequencies is None:
        return None
    return SweepSettings(source, text, rig, output, sweep, frequencies, tuple(inputs), calibration)


def _inputs(listed: Any, problems: list[Problem]) -> list[InputTable]:
    if not isinstance(listed, list) or not 1 <= len(listed) <= MOST_INPUTS:
        problems.append(
            Problem("input", f"1 to {MOST_INPUTS} inputs", quoted(listed), "Write [[input]] for each.")
        )
        return []
    read = [read_table(InputTable, each, ("input", place), problems) for place, each in enumerate(listed)]
    taken: dict[str, set[str]] = {"name": set(), "terminal": set(), "role": set()}
    for place, each in enumerate(read):
        if each is None:
            continue
        where = f"input[{place + 1}]"
        if each.name != channel_name(each.name, set()):
            problems.append(Problem(f"{where}.name", "a name of letters, digits and _", quoted(each.name)))
        for key, seen in taken.items():
            value = getattr(each, key)
            if value in seen:
                problems.append(Problem(f"{where}.{key}", "each once", f"{quoted(value)} again"))
            elif value is not None:
                seen.add(value)
        if (each.role == "load_cell") != (each.threshold is not None):
            got = "none" if each.threshold is None else "one of another input"
            problems.append(Problem(f"{where}.threshold", "the threshold (V) of a load cell", got))
    if all(each is not None for each in read) and "displacement" not in taken["role"]:
        hint = 'Write role = "displacement" in one of them.'
        problems.append(Problem("input", "one that measures the displacement", "none", hint))
    return [each for each in read if each is not None]


def _misfits(settings: SweepSettings) -> Sequence[Problem]:
    """Return the contradictions between keys of a sweep that are each valid."""
    output, fastest, slowest = settings.output, settings.frequencies[-1], settings.frequencies[0]
    problems = []
    if output.amplitude > output.highest:
        problems.append(
            Problem(
                "output.amplitude", f"at most output.highest, {output.highest:g} V", f"{output.amplitude:g}"
            )
        )
    # the amplitude changes along half a cosine
    slew = output.amplitude * fastest * (2.0 * np.pi + np.pi / (2.0 * output.ramp_periods))
    if slew > output.slew:
        problems.append(
            Problem(
                "sweep.frequency",
                f"a drive within output.slew, {output.slew:g} V/s",
                f"{slew:.4g} V/s at {fastest:g} Hz",
                "Drive less, slower, or raise the limit.",
            )
        )
    if output.rate < FEWEST_SAMPLES * fastest:
        problems.append(
            Problem(
                "output.rate",
                f"{FEWEST_SAMPLES} samples of a period at least, {FEWEST_SAMPLES * fastest:g} Hz",
                f"{output.rate:g}",
            )
        )
    samples = settings.step_periods / slowest * output.rate * len(settings.inputs)
    if samples > MOST_VALUES:
        problems.append(
            Problem("sweep", f"at most {MOST_VALUES:g} samples of a step, of all inputs", f"{samples:.3g}")
        )
    values = len(settings.steps) * settings.sweep.recorded_periods
    if values > MOST_VALUES:
        hint = "average_periods makes one value of several periods."
        problems.append(
            Problem("sweep.recorded_periods", f"at most {MOST_VALUES:g} values", f"{values:g}", hint)
        )
    duration = len(settings.steps) * settings.step_periods / slowest
    if duration > LONGEST:
        problems.append(
            Problem("sweep", f"a sweep of {LONGEST:g} s at most", f"one of up to {duration:.3g} s")
        )
    return problems
