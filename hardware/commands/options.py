"""The options of the command `vibroimpact import`.

What the command does is imported when it is called: `--help` loads nothing heavy.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vibroimpact.analysis.commands.shared_options import Force


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command("import")(import_files)


def import_files(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="Files of one measurement: TDMS, .lvm, text, .mat, NetCDF, HDF5, Parquet, UFF, WAV."
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Recording to write (.nc).")],
    name: Annotated[
        list[str] | None,
        typer.Option(help="Name of a column; repeat it for each, in order, without the instants."),
    ] = None,
    unit: Annotated[
        list[str] | None, typer.Option(help="Unit of a column (g, m/s^2, mV, N, ...); one is for all.")
    ] = None,
    scale: Annotated[list[float] | None, typer.Option(help="Factor on the values; one is for all.")] = None,
    offset: Annotated[list[float] | None, typer.Option(help="Added after the scale; one is for all.")] = None,
    rate: Annotated[float | None, typer.Option(help="Samples per second, whatever the file says.")] = None,
    start: Annotated[float | None, typer.Option(help="Instant of the first sample, s.")] = None,
    time_column: Annotated[
        str | None, typer.Option(help="Heading or number of the column of instants, or none.")
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(help="Columns to import, headings or numbers with commas between; 1 is the first."),
    ] = None,
    events: Annotated[
        bool | None,
        typer.Option(
            "--events/--no-events", help="The columns are instants of events, or none is; else it is found."
        ),
    ] = None,
    window: Annotated[
        str | None, typer.Option(help="Observation of the events, START:END in s.", metavar="START:END")
    ] = None,
    masked: Annotated[
        list[str] | None,
        typer.Option(
            help="Span in which nothing was measured, START:END in s; repeat it.", metavar="START:END"
        ),
    ] = None,
    delimiter: Annotated[
        str | None,
        typer.Option(help="Between cells of text: tab, comma, semicolon, bar, blank; else it is found."),
    ] = None,
    decimal: Annotated[
        str | None, typer.Option(help='Decimal sign of text, "." or ","; else it is found.')
    ] = None,
    dates: Annotated[
        str | None, typer.Option(help="Dates such as 02/03/2019: day-first or month-first; else it is found.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="The same as keys of a TOML file; without it, FILE.toml beside each file."),
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure of the channels (.png, .pdf, .svg).")] = None,
    force: Force = False,
) -> None:
    """Import measurements of one laboratory run into a recording, and say what is odd about them.

    Example: vibroimpact import base.txt board.txt --name base --name board --unit g -o a0.nc --figure a0.png
    """
    from vibroimpact.hardware.commands.import_files import import_into, span

    written = {
        "name": name,
        "unit": unit,
        "scale": scale,
        "offset": offset,
        "rate": rate,
        "start": start,
        "time_column": time_column,
        "columns": None if columns is None else [part.strip() for part in columns.split(",")],
        "events": events,
        "window": None if window is None else span(window, "window"),
        "masked": [span(text, "masked") for text in masked or ()],
        "delimiter": delimiter,
        "decimal": decimal,
        "dates": dates,
    }
    import_into(output, files, written, settings, figure, force)
