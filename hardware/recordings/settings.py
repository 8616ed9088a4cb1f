"""The user's settings for a file: options of `vibroimpact import`, or the same keys in a TOML file beside it."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
)

from vibroimpact.fmus.errors import UsageError
from vibroimpact.hardware.formats.labels import is_known_unit
from vibroimpact.hardware.toml_files import document_of, text_of
from vibroimpact.orchestrator.scene.fields import Rule
from vibroimpact.orchestrator.scene.problems import lines_of, problems_of


def _listed(value: Any) -> Any:
    """Return one value as a list of one."""
    return [value] if isinstance(value, str | int | float) and not isinstance(value, bool) else value


def _only(holds: Callable[[Any], bool]) -> AfterValidator:
    """Return a validator that refuses values for which a condition is false."""

    def check(value: Any) -> Any:
        if not holds(value):
            raise ValueError("the rule of the field says what is expected")
        return value

    return AfterValidator(check)


def _ascends(span: tuple[float, float] | None) -> bool:
    return span is None or span[0] < span[1]


_Item = TypeVar("_Item")
_Several = Annotated[tuple[_Item, ...], BeforeValidator(_listed), Field(strict=False)]
_Span = Annotated[tuple[FiniteFloat, FiniteFloat], Field(strict=False)]


class ImportSettings(BaseModel):
    """The user's settings for columns; None or empty values are found from the file.

    `name`, `unit`, `scale` and `offset` list the columns in order, without the column of instants. A single unit,
    scale or offset holds for all columns. A value is `scale` times the file's value, plus `offset`.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    name: Annotated[
        _Several[str], Rule("names of the columns", item="a name", hint='Write ["base", "board"].')
    ] = ()
    unit: Annotated[
        _Several[str],
        _only(lambda units: all(map(is_known_unit, units))),
        Rule(
            "units of the columns",
            item="a unit such as m/s^2, g, V, mV, N",
            hint="Write 1 for a pure number.",
        ),
    ] = ()
    scale: Annotated[
        _Several[FiniteFloat],
        _only(lambda scales: 0.0 not in scales),
        Rule("finite factors, none of them 0", item="a finite factor, not 0"),
    ] = ()
    offset: Annotated[_Several[FiniteFloat], Rule("finite numbers", item="a finite number")] = ()
    rate: Annotated[FiniteFloat | None, Field(gt=0.0), Rule("samples per second > 0", "Hz")] = None
    start: Annotated[FiniteFloat | None, Rule("the instant of the first sample", "s")] = None
    time_column: Annotated[
        str | int | None,
        Rule('the heading or the number of a column, or "none"', hint="The first column is 1."),
    ] = None
    columns: Annotated[
        _Several[str | int],
        Rule("headings or numbers of columns", item="a heading or a number", hint="The first column is 1."),
    ] = ()
    events: Annotated[bool | None, Rule("true (all columns are instants of events) or false (none is)")] = (
        None
    )
    window: Annotated[
        _Span | None,
        _only(_ascends),
        Rule(
            "start and end of the observation, the end later",
            "s",
            item="a finite number",
            hint="Write [0, 30].",
        ),
    ] = None
    masked: Annotated[
        tuple[_Span, ...],
        Field(strict=False),
        _only(lambda spans: all(map(_ascends, spans))),
        Rule(
            "pairs of start and end, each end later",
            "s",
            item="a start and a later end",
            hint="Write [[10, 12.5]].",
        ),
    ] = ()
    delimiter: Annotated[
        Literal["tab", "comma", "semicolon", "bar", "blank"] | None,
        Rule("tab, comma, semicolon, bar or blank"),
    ] = None
    decimal: Annotated[Literal[".", ","] | None, Rule('"." or ","')] = None
    dates: Annotated[
        Literal["day-first", "month-first"] | None,
        Rule("day-first or month-first", hint="02/03/2019 is 2 March with the day first."),
    ] = None


def checked(values: Mapping[str, Any], source: str) -> ImportSettings:
    """Return the settings of these values; messages begin with their source, a file or `command line`.

    Raises
    ------
    UsageError
        All problems, a line for each.
    """
    try:
        return ImportSettings.model_validate(dict(values))
    except ValidationError as error:
        problems = problems_of(error, ImportSettings, ())
        raise UsageError("\n".join(lines_of(problems, source))) from None


def settings_beside(path: Path) -> ImportSettings:
    """Return the settings in the file `NAME.toml` beside a recording; empty without it."""
    beside = path.with_name(path.name + ".toml")
    return read_settings(beside) if os.path.isfile(beside) else ImportSettings()


def read_settings(path: Path) -> ImportSettings:
    """Return the settings of a file.

    Raises
    ------
    UsageError
        The file cannot be read, is no TOML, or has wrong keys; all problems are listed.
    """
    source = str(path)
    return checked(document_of(text_of(path, "a settings file"), source), source)
