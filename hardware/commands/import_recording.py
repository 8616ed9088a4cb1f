"""The command `vibroimpact import`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vibroimpact.analysis.dataset.outputs import FORCE_HELP, refuse_outputs, refuse_overwriting, writing
from vibroimpact.fmus.errors import UsageError

if TYPE_CHECKING:
    from vibroimpact.analysis.recording import Recording

# Reading files and drawing need numpy, netCDF4 and more: `vibroimpact --help` does not pay for them.


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
    settings: Annotated[
        Path | None,
        typer.Option(help="The same as keys of a TOML file; without it, FILE.toml beside each file."),
    ] = None,
    figure: Annotated[Path | None, typer.Option(help="Figure of the channels (.png, .pdf, .svg).")] = None,
    force: Annotated[bool, typer.Option("--force", help=FORCE_HELP)] = False,
) -> None:
    """Import measurements of one laboratory run into a recording, and say what is odd about them.

    Example: vibroimpact import base.txt board.txt --name base --name board --unit g -o a0.nc --figure a0.png
    """
    from vibroimpact.hardware.commands.table import show_recording
    from vibroimpact.hardware.recordings import import_recording, read_settings
    from vibroimpact.hardware.recordings.settings import checked

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
        "window": None if window is None else _span(window, "window"),
        "masked": [_span(text, "masked") for text in masked or ()],
        "delimiter": delimiter,
        "decimal": decimal,
    }
    given = checked({key: value for key, value in written.items() if value not in (None, [])}, "command line")
    common = None if settings is None else read_settings(settings)
    refuse_outputs(files, output, figure)
    recording = import_recording(files, given, common)
    sources = recording.attrs.get("source_sha256")
    refuse_overwriting(output, force, lambda there: there.get("source_sha256", "") == sources)
    _write(recording, output, figure)
    show_recording(recording, output, figure)


def _span(text: str, option: str) -> list[float]:
    """Return start and end of a span of time, s."""
    parts = text.split(":")
    try:
        begin, end = (float(part) for part in parts)
    except ValueError:
        raise UsageError(
            f"--{option}: expected START:END in s, got {text[:60]!r}. For example 0:30."
        ) from None
    return [begin, end]


def _write(recording: Recording, output: Path, figure: Path | None) -> None:
    from vibroimpact.analysis.recording import write_recording

    targets: dict[Path, Any] = {output: lambda: write_recording(recording, output)}
    if figure is not None:
        targets[figure] = lambda: _draw(recording, figure)
    for target, write in targets.items():
        with writing(target):
            write()


def _draw(recording: Recording, path: Path) -> None:
    from vibroimpact.analysis import figures
    from vibroimpact.analysis.figures.recordings import draw_recording

    figures.save(draw_recording(recording), path)
