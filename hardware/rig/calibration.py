"""Calibrations: the conversion from the volts of a channel to m or N, with method and date."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, FiniteFloat

from vibroimpact.analysis.recording.units import measured_unit
from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.formats.labels import is_known_unit
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.toml_files import document_of, text_of
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import Problem, lines_of, read_table

Floats = NDArray[np.float64]


def _as_text(value: Any) -> Any:
    """Return a date of TOML as text."""
    return value.isoformat() if isinstance(value, date | datetime) else value


def _refused(value: Any) -> Any:
    raise ValueError("the rule of the field says what is expected")


class Calibration(BaseModel):
    """The calibration of a channel: V = sensitivity * value + offset + drift * time.

    Attributes
    ----------
    unit : str
        Unit of the value, such as N or mm.
    sensitivity : float
        V per unit; negative where the wires are swapped.
    offset : float
        Reading of the channel at value 0 at the start of the recording, V.
    drift : float
        Change of the offset, V/s.
    how, when : str
        Method and date of the measurement.
    terminal : str
        Terminal of the sensor; empty: any.

    Examples
    --------
    >>> cell = Calibration(unit="N", sensitivity=0.0218, offset=0.1, how="weights", when="2026-03-01")
    >>> cell.to_units(np.array([0.1, 2.28]), np.zeros(2)).round(9).tolist()
    [0.0, 100.0]
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    unit: Annotated[
        str,
        AfterValidator(lambda unit: unit if is_known_unit(unit) else _refused(unit)),
        Rule("a unit such as N, m, mm, m/s"),
    ]
    sensitivity: Annotated[
        FiniteFloat,
        AfterValidator(lambda number: number if abs(number) > 1e-100 else _refused(number)),
        Rule("a finite number, not 0", "V per unit"),
    ]
    offset: Annotated[FiniteFloat, Rule("a finite number", "V")] = 0.0
    drift: Annotated[FiniteFloat, Rule("a finite number", "V/s")] = 0.0
    how: Annotated[str, Rule("how it was measured, in words", hint='Write "dead weights, 0 to 2 kg".')]
    when: Annotated[str, BeforeValidator(_as_text), Rule("when it was measured", hint='Write "2026-03-01".')]
    terminal: Annotated[str, Rule("a terminal of the device", hint='Write "Dev1/ai1".')] = ""

    @property
    def cf_unit(self) -> str:
        """The unit in the form of recordings."""
        return measured_unit(self.unit).cf

    def to_units(self, volts: Floats, time: Floats) -> Floats:
        """Return values in `unit` from volts measured at instants (s from the start)."""
        return (volts - self.offset - self.drift * time) / self.sensitivity

    def attributes(self) -> dict[str, Any]:
        """Return the attributes of a calibrated channel, from which the volts can be restored."""
        return {
            "source_unit": "V",
            "calibrated_unit": self.unit,
            "sensitivity": self.sensitivity,
            "zero_offset": self.offset,
            "zero_drift": self.drift,
            "calibration": "V = sensitivity value + zero_offset + zero_drift time",
            "calibration_how": self.how,
            "calibration_when": self.when,
        }


def read_calibrations(paths: Iterable[Path], inputs: Sequence[Input]) -> dict[str, Calibration]:
    """Read files with a table for each channel, by the names of the channels.

    Parameters
    ----------
    paths : iterable of Path
    inputs : sequence of Input
        Inputs of the program: a calibration of any other channel is refused.

    Raises
    ------
    UsageError
        A file cannot be read or is wrong, or is for another channel or terminal; all its problems are listed.
    """
    found: dict[str, Calibration] = {}
    known = {each.name: each for each in inputs}
    for path in paths:
        document = document_of(text_of(path, "a calibration"), str(path))
        problems: list[Problem] = []
        for name, table in document.items():
            if name not in known:
                names = ", ".join(known)
                problems.append(Problem(name[:60], f"a channel that is measured: {names}", "another channel"))
                continue
            one = read_table(Calibration, table, (name,), problems)
            if one is None:
                continue
            if name in found:
                problems.append(Problem(name, "one calibration of each channel", "another"))
            if one.terminal not in ("", known[name].terminal):
                where = f"{known[name].terminal}, where {name} is measured"
                problems.append(Problem(f"{name}.terminal", where, one.terminal[:60]))
            found[name] = one
        if problems:
            raise UsageError("\n".join(lines_of(problems, str(path))))
    return found
