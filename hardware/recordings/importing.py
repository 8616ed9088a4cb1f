"""Import of files of any format as one recording."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroimpact.analysis.recording import Recording, open_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.fmus.messages import Argument, joined, message, reworded
from vibroimpact.hardware.formats.choosing import check_file, holds_recording
from vibroimpact.hardware.recordings.building import Parts
from vibroimpact.hardware.recordings.gaps import AGREEMENT
from vibroimpact.hardware.recordings.settings import ImportSettings, checked
from vibroimpact.hardware.recordings.sources import Source, naming, read_source, spread

PathLike = str | os.PathLike[str]


def import_recording(
    files: PathLike | Sequence[PathLike],
    settings: ImportSettings | Mapping[str, Any] | None = None,
    common: ImportSettings | None = None,
) -> Recording:
    """Return files of any format as one recording.

    Parameters
    ----------
    files : path or sequence of path
        Several files become one recording; each has its own trigger, and so its own time axis.
    settings : ImportSettings, mapping or None
        For all columns of all files together (the command line); it overrides the others.
    common : ImportSettings or None
        For each file, in place of its own settings file.

    Returns
    -------
    Recording
        With provenance, and with remarks in `attrs["remarks"]`, a line for each.

    Raises
    ------
    DatasetError
        A file is damaged, of an unknown format, or self-contradictory; the message has its name.
    UsageError
        The settings do not fit the files.
    """
    given = settings if isinstance(settings, ImportSettings) else checked(settings or {}, "settings")
    paths = [Path(one) for one in ([files] if isinstance(files, str | os.PathLike) else files)]
    if not paths:
        raise UsageError("files: expected one or more, got none.")
    for path in paths:
        with naming(path):
            check_file(path)
            is_ours = holds_recording(path)
        if is_ours:
            return _passed_on(paths, given)
    sources = [read_source(path, given, common) for path in paths]
    spread(sources, given)
    parts = Parts()
    for source in sources:
        parts.add(source, title=source.path.name if len(sources) > 1 else "")
    if not parts.channels and not parts.events:
        left_out = [line for line in parts.remarks if "left out" in line]
        besides = (" Besides, ", joined("; ", left_out[:3]), ".") if left_out else ()
        raise DatasetError(
            message(
                f"{paths[0]}: expected channels of two samples or more, or instants of events, got none.",
                *besides,
            )
        )
    parts.remark(_of_the_whole(parts))
    return Recording(parts.channels, parts.events, parts.scalars, _provenance(sources, parts))


def _passed_on(files: Sequence[Path], given: ImportSettings) -> Recording:
    """Return an existing recording unchanged; UsageError for options, which would change an imported recording."""
    if len(files) > 1:
        raise UsageError(
            f"{files[0]}: expected one recording, or files of other formats, got {len(files)} files."
        )
    if given.model_fields_set:
        keys = ", ".join(sorted(given.model_fields_set))
        raise UsageError(f"{files[0]}: expected no options for what is a recording already, got {keys}.")
    return open_recording(files[0])


def _of_the_whole(parts: Parts) -> list[str]:
    """Return remarks on all channels together."""
    remarks: list[str] = []
    plain = [name for name, channel in parts.channels.items() if channel.unit == "1"]
    if plain:
        known = f"no unit is known for {', '.join(plain)}: pure numbers ("
        remarks.append(message(known, Argument("unit"), ")"))
    axes = {id(channel.axis): channel.axis for channel in parts.channels.values()}.values()
    triggers = list(dict.fromkeys(axis.trigger for axis in axes))
    if len(triggers) > 1:
        remarks.append(
            f"{len(triggers)} triggers: the lag between their time axes is not known, and must be estimated"
        )
    rates = sorted(axis.rate for axis in axes if axis.interval is not None)
    if rates and rates[-1] - rates[0] > AGREEMENT * rates[0]:
        remarks.append(f"the channels are sampled at different rates, {rates[0]:.7g} to {rates[-1]:.7g} Hz")
    return remarks


def _provenance(sources: Sequence[Source], parts: Parts) -> dict[str, Any]:
    """Return the sources of a recording: names of files, without their folders."""
    attrs: dict[str, Any] = {}
    for source in sources:
        attrs = attrs | source.raw.attrs | attrs  # the first file's value wins
    settings = {
        source.path.name: source.settings.model_dump(exclude_unset=True, mode="json") for source in sources
    }
    return {
        "source_file": ", ".join(source.path.name for source in sources),
        "source_sha256": ", ".join(_hash(source.path) for source in sources),
        "source_format": ", ".join(dict.fromkeys(source.raw.source_format for source in sources)),
        "import_settings": json.dumps(settings, sort_keys=True),
        **attrs,
        "remarks": joined("\n", (reworded(line, _on_one_line) for line in parts.remarks)),
    }


def _on_one_line(text: str) -> str:
    return " ".join(text.split())


def _hash(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
