"""`[wiring]` of a rig file: the output that drives the plant, and the signal on each input."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, FiniteFloat

from vibroimpact.hardware.virtual_rig.profiles import PROFILES
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS, DRIVE
from vibroimpact.orchestrator.scene.problems import Problem, nearest, quoted, read_table

EXCITER = "exciter"
_TERMINAL = re.compile(r"(ai|ao)(\d{1,3})", re.ASCII)
_HINT = 'Write ao0 = "exciter", ai0 = "sensor.displacement", or ai2 = "ao0".'


class WireTable(BaseModel):
    """`ai1 = { signal = ..., amplification = ... }`."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    signal: Annotated[str, Rule("the name of a signal, in quotes")]
    amplification: Annotated[
        FiniteFloat | None, Rule("a finite number", hint="V for a unit of the signal.")
    ] = None


@dataclass(frozen=True, slots=True)
class Wire:
    """The source of an input."""

    signal: str
    """Channel of the plant; empty: an output."""
    amplification: float | None = None
    """V for a unit of the signal; None: not given."""
    output: int | None = None
    """The output that it is wired to."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """All connections of a rig."""

    driver: int | None = None
    """The output that drives the exciter."""
    inputs: dict[int, Wire] = field(default_factory=dict)
    """Wires by the number of the input."""

    @property
    def signals(self) -> list[str]:
        """Channels of the plant on at least one input, each once."""
        return list(dict.fromkeys(wire.signal for wire in self.inputs.values() if wire.output is None))


def wiring_of(raw: object, device: str, played: bool, problems: list[Problem]) -> Wiring | None:
    """Return the wiring of a document's `wiring`; if it is wrong, None, with its problems added to the list.

    The device is one of `PROFILES`. The channels of a recording (`played`) are not known here, and no output drives
    it.
    """
    if not isinstance(raw, dict):
        problems.append(Problem("wiring", "a table", quoted(raw), "Write [wiring]."))
        return None
    before = len(problems)
    drivers: list[int] = []
    inputs: dict[int, Wire] = {}
    for terminal, what in raw.items():
        where, found = f"wiring.{terminal}", _number(terminal, device)
        if found is None:
            problems.append(_no_terminal(terminal, device))
        elif found[0] == "ao":
            problems += _driver_problems(where, what, played, drivers)
            drivers.append(found[1])
        else:
            wire = _wire(where, what, device, played, problems)
            if wire is not None:
                inputs[found[1]] = wire
    if len(problems) > before:
        return None
    if not inputs and not drivers:
        problems.append(Problem("wiring", "at least one terminal", "none", _HINT))
        return None
    driver = drivers[0] if drivers else None
    undriven = [
        number for number, wire in inputs.items() if wire.signal == DRIVE and driver is None and not played
    ]
    if undriven:
        hint = 'Write ao0 = "exciter".'
        problems.append(
            Problem(f"wiring.ai{undriven[0]}", "an output at the exciter for the drive", "none", hint)
        )
        return None
    # the driving voltage is an output like others
    inputs = {
        number: Wire("", wire.amplification, driver) if wire.signal == DRIVE and not played else wire
        for number, wire in inputs.items()
    }
    return Wiring(driver, inputs)


def _number(terminal: str, device: str) -> tuple[str, int] | None:
    """Return the direction and the number of a terminal of the device."""
    found, profile = _TERMINAL.fullmatch(terminal), PROFILES[device]
    if found is None:
        return None
    word, number = found[1], int(found[2])
    there = number < (profile.inputs if word == "ai" else profile.outputs)
    return (word, number) if there and terminal == f"{word}{number}" else None


def _no_terminal(terminal: str, device: str) -> Problem:
    profile = PROFILES[device]
    expected = f"ai0 to ai{profile.inputs - 1}, ao0 to ao{profile.outputs - 1} of {device}"
    return Problem("wiring", expected, quoted(terminal), _HINT)


def _driver_problems(where: str, what: object, played: bool, drivers: list[int]) -> list[Problem]:
    if played:
        hint = "A recording is not driven: remove it. A loopback is written at its input."
        return [Problem(where, "no wired output beside a recording", quoted(what), hint)]
    if what != EXCITER:
        return [Problem(where, f'"{EXCITER}"', quoted(what), "A loopback is written at its input.")]
    if drivers:
        return [Problem(where, f"one output at the exciter, ao{drivers[0]}", "another", "Remove one.")]
    return []


def _wire(where: str, what: object, device: str, played: bool, problems: list[Problem]) -> Wire | None:
    raw: Any = {"signal": what} if isinstance(what, str) else what
    if not isinstance(raw, dict):
        problems.append(Problem(where, "a signal, or a table", quoted(what), _HINT))
        return None
    table = read_table(WireTable, raw, ("wiring", where.partition(".")[2]), problems)
    if table is None:
        return None
    found = _number(table.signal, device)
    if found is not None and found[0] == "ao":
        return Wire("", table.amplification, found[1])
    if not played and table.signal not in CHANNELS:
        hint = partial(nearest, table.signal, [*CHANNELS, "ao0"])
        problems.append(Problem(where, "a channel of the scene, or an output", quoted(table.signal), hint))
        return None
    return Wire(table.signal, table.amplification)
