"""The command `vibroimpact import`: reads files, writes the recording and its figure, prints a summary."""

from __future__ import annotations

from dataclasses import replace

from vibroimpact.analysis.dataset.outputs import refuse_outputs, refuse_overwriting, writing
from vibroimpact.analysis.recording import write_recording
from vibroimpact.analysis.recording.table import print_recording
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import spelled, typed
from vibroimpact.fmus.terminal import wide_terminal
from vibroimpact.hardware.operations.import_files import ImportFiles
from vibroimpact.hardware.recordings import ImportSettings, import_recording, read_settings
from vibroimpact.hardware.recordings.settings import checked


def import_into(options: ImportFiles) -> None:
    """Import files according to the options and the settings."""
    output, figure = options.output, options.figure
    given = _settings_of(options)
    common = None if options.settings is None else read_settings(options.settings)
    refuse_outputs(options.files, output, figure)
    recording = import_recording(options.files, given, common)
    recording = replace(recording, attrs=spelled(recording.attrs, typed))
    sources = recording.attrs.get("source_sha256")
    refuse_overwriting(output, options.force, lambda there: there.get("source_sha256", "") == sources)
    with writing(output):
        write_recording(recording, output)
    if figure is not None:
        # matplotlib takes half a second to import, and an import without a figure does not need it
        from vibroimpact.analysis import figures
        from vibroimpact.analysis.figures.measured.recordings import draw_recording

        with writing(figure):
            figures.save(draw_recording(recording), figure)
    console = wide_terminal()
    print_recording(console, recording)
    drawn = f" Figure: {figure}." if figure else ""
    console.print(f"Recording written to {output}.{drawn}", soft_wrap=True)


def _settings_of(options: ImportFiles) -> ImportSettings:
    """Return the options on columns as settings, which have the keys of a settings file; None or empty: not given."""
    written = {key: getattr(options, key) for key in ImportSettings.model_fields}
    if options.columns is not None:
        written["columns"] = [part.strip() for part in options.columns.split(",")]
    if options.window is not None:
        written["window"] = _span(options.window, "window")
    written["masked"] = [_span(text, "masked") for text in options.masked or ()]
    return checked({key: value for key, value in written.items() if value not in (None, [])}, "command line")


def _span(text: str, option: str) -> list[float]:
    """Return start and end of a span of time START:END, s; another text raises UsageError."""
    try:
        begin, end = map(float, text.split(":"))
    except ValueError:
        raise UsageError(
            f"--{option}: expected START:END in s, got {text[:60]!r}. For example 0:30."
        ) from None
    return [begin, end]
