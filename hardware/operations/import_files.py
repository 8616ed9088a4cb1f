"""Operation `import`: files of instruments into a recording."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

from vibroimpact.fmus.operations import Door, Force, Operation, Option, Positional, operation

Setting = partial(Option, python="")
"""Options on columns are one argument in Python: `settings`."""


@operation(
    "hardware.commands.import_files:import_into",
    Door("import_recording", also=("settings: ImportSettings | Mapping[str, Any] | None = None",)),
)
class ImportFiles(Operation):
    """Import measurements of one laboratory run as a recording, and report gaps, clipping and unit doubts.

    Example: vibroimpact import base.txt board.txt --name base --name board --unit g -o a0.nc --figure a0.png
    """

    files: Annotated[
        list[Path],
        Positional(
            help="Files of one measurement: TDMS, .lvm, text, .mat, NetCDF, HDF5, Parquet, UFF, WAV.",
            python="files: PathLike | Sequence[PathLike]",
        ),
    ]
    output: Annotated[Path, Option("--output", "-o", help="Recording to write (.nc).", python="")]
    name: Annotated[
        list[str] | None,
        Setting(help="Name of a column; repeat it for each column in order, except the instants."),
    ] = None
    unit: Annotated[
        list[str] | None,
        Setting(help="Unit of a column (g, m/s^2, mV, N, ...); a single one holds for all."),
    ] = None
    scale: Annotated[
        list[float] | None, Setting(help="Factor on the values; a single one holds for all columns.")
    ] = None
    offset: Annotated[
        list[float] | None, Setting(help="Offset added after the scale; a single one holds for all columns.")
    ] = None
    rate: Annotated[float | None, Setting(help="Samples per second, in place of the file's rate.")] = None
    start: Annotated[float | None, Setting(help="Instant of the first sample, s.")] = None
    time_column: Annotated[
        str | None, Setting(help="Heading or number of the column of instants, or none.")
    ] = None
    columns: Annotated[
        str | None,
        Setting(help="Columns to import: headings or numbers, separated by commas; 1 is the first."),
    ] = None
    events: Annotated[
        bool | None,
        Setting(
            "--events/--no-events",
            help="Treat all columns as instants of events, or none; by default detected.",
        ),
    ] = None
    window: Annotated[
        str | None,
        Setting(help="Observation window of the events, START:END in s.", metavar="START:END"),
    ] = None
    masked: Annotated[
        list[str] | None,
        Setting(help="Span without measurement, START:END in s; may be repeated.", metavar="START:END"),
    ] = None
    delimiter: Annotated[
        str | None,
        Setting(help="Delimiter of text: tab, comma, semicolon, bar, blank; by default detected."),
    ] = None
    decimal: Annotated[str | None, Setting(help='Decimal sign of text, "." or ","; by default detected.')] = (
        None
    )
    dates: Annotated[
        str | None,
        Setting(help="Dates such as 02/03/2019: day-first or month-first; by default detected."),
    ] = None
    settings: Annotated[
        Path | None,
        Option(
            help="TOML file with these options as keys; by default FILE.toml beside each file.",
            python="common: ImportSettings | None = None",
        ),
    ] = None
    figure: Annotated[Path | None, Option(help="Figure of the channels (.png, .pdf, .svg).", python="")] = (
        None
    )
    force: Force = False
