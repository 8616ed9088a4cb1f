"""Files of rigs: journals, calibrations, import settings and descriptions of virtual rigs.

Drawn content is read equal. A damaged journal gives back whole records as they were written, or is refused.
"""

from __future__ import annotations

import random
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from soak import _drawn_files as files
from soak.grammar_toml import Spelling
from soak.scenes import LINES, VALUES
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.hardware.recordings.settings import read_settings
from vibroimpact.hardware.rig.acquisition import Block
from vibroimpact.hardware.rig.calibration import read_calibrations
from vibroimpact.hardware.rig.inputs import Input
from vibroimpact.hardware.rig.journal import Journal, read_journal
from vibroimpact.hardware.virtual_rig.settings import read_rig

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

HEAD = struct.Struct("<4sIQI")


def drawn_blocks(draw: random.Random, channels: int) -> list[Block]:
    """Return blocks of samples in order, with gaps here and there."""
    first, found = draw.choice((0, 0, 100)), []
    generator = np.random.default_rng(draw.randrange(2**32))
    for _ in range(draw.randint(1, 6)):
        found.append(Block(first, generator.normal(size=(channels, draw.randint(1, 40)))))
        first = found[-1].end + draw.choice((0, 0, 5))
    return found


def _journal(draw: random.Random) -> str | None:
    path, channels = Path("a.journal"), draw.randint(1, 3)
    blocks = drawn_blocks(draw, channels)
    header = {
        "inputs": [f"c{at}" for at in range(channels)],
        "rate": 1000.0,
        "note": draw.choice(files.WORDS),
    }
    notes = [{"gap": at} for at in range(draw.randrange(3))]
    with Journal(path, header) as journal:
        for block in blocks:
            journal.append(block)
        for note in notes:
            journal.note(**note)
    if draw.random() < 0.4:
        found = read_journal(path)
        if found.header != header or found.notes != notes or found.lost_bytes:
            return f"{found.header}, {found.notes}, {found.lost_bytes} for {header}, {notes}"
        return _not_written(found.blocks, blocks, all_of_them=True)
    path.write_bytes(_odd_journal(draw, path.read_bytes(), channels))
    try:
        found = read_journal(path)
    except VibroimpactError as refusal:
        return files.badly_said(refusal, path)
    return _not_written(found.blocks, blocks, all_of_them=False)


def _odd_journal(draw: random.Random, content: bytes, channels: int) -> bytes:
    """Return a damaged journal, or one that goes on with records of odd sizes and places."""
    if draw.random() < 0.6:
        return files.damaged(draw, content)
    for _ in range(draw.choice((1, 3, 30))):
        inner = draw.choice((b"", b"{}", b"[" * 3000, b"nan", b"1", b'{"a":', bytes(8 * channels), bytes(7)))
        kind = draw.choice((b"NOTE", b"NOTE", b"SAMP"))
        first = files.bounded(files.number(draw), 64)
        if kind == b"SAMP" and inner and len(inner) % (8 * channels) == 0:
            first = 2**60  # beyond the limit: no sample is new, even below a sound checksum
        length = len(inner) if draw.random() < 0.7 else files.bounded(files.number(draw), 32)
        head = HEAD.pack(kind, length, first, 0)[:-4]
        content += head + zlib.crc32(inner, zlib.crc32(head)).to_bytes(4, "little") + inner
    return content


def _not_written(found: list[Block], written: list[Block], *, all_of_them: bool) -> str | None:
    """Return the samples that were read but never written, or written but not read."""
    known = {block.first + at: block.volts[:, at] for block in written for at in range(block.volts.shape[1])}
    read = {block.first + at: block.volts[:, at] for block in found for at in range(block.volts.shape[1])}
    for place, volts in read.items():
        if place not in known or volts.tobytes() != known[place].tobytes():
            return f"sample {place} is {volts}, not {known.get(place)}"
    return f"{len(read)} samples for {len(known)}" if all_of_them and len(read) != len(known) else None


def _calibration(draw: random.Random) -> tuple[dict[str, Any], Any]:
    table = {
        "unit": draw.choice(("N", "mm", "m/s^2", "g")),
        "sensitivity": draw.choice((0.0218, -1.5, 1e-9)),
        "offset": draw.choice((0.0, 0.25)),
        "how": draw.choice(("dead weights", "ä", "")),
        "when": "2026-03-01",
    }

    def read(path: Path) -> Any:
        found = read_calibrations([path], [Input("tip", "Dev1/ai0", 5.0)])["tip"]
        return {"tip": {key: getattr(found, key) for key in table}}

    return {"tip": table}, read


def _settings(draw: random.Random) -> tuple[dict[str, Any], Any]:
    whole = {
        "name": ["base", "tip"],
        "unit": ["g", "mV"],
        "scale": [2.5, -1.0],
        "rate": 1000.0,
        "start": -0.5,
        "columns": ["base", 2],
        "masked": [[0.0, 1.5]],
        "decimal": ",",
    }
    table = {key: whole[key] for key in draw.sample(sorted(whole), draw.randint(1, len(whole)))}
    return table, lambda path: _listed(read_settings(path).model_dump(include=set(table)))


def _listed(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _listed(one) for key, one in value.items()}
    return [_listed(one) for one in value] if isinstance(value, tuple | list) else value


def _rig(draw: random.Random) -> tuple[dict[str, Any], Any]:
    table = {
        "rig": {
            "scene": "../beam.toml",
            "device": draw.choice(("labpc+", "xseries")),
            "name": draw.choice(("Dev1", "Rig-2")),
            "speed": draw.choice((1.0, 10.0)),
            "clock_error": draw.choice((0.0, -50.0)),
        },
        "wiring": {"ao0": "exciter", "ai0": "sensor.displacement"},
    }

    def read(path: Path) -> Any:
        return {**table, "rig": read_rig(path).rig.model_dump(include=set(table["rig"]))}

    return table, read


def _toml(draw: random.Random) -> str | None:
    """Read a settings file of one kind: as drawn, or with odd values and lines."""
    tables, read = draw.choice((_calibration, _settings, _rig))(draw)
    text, path = Spelling(draw).text(tables), Path("file.toml")
    is_sound = draw.random() < 0.5
    if not is_sound:
        lines = text.split("\n")
        for _ in range(draw.choice((1, 1, 3))):
            place = draw.randrange(len(lines))
            key, equals, _ = lines[place].partition("=")
            if equals and draw.random() < 0.7:
                lines[place] = f"{key}= {draw.choice(VALUES)}"
            else:
                lines.insert(place, draw.choice(LINES))
        text = "\n".join(lines)
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        found = read(path)
    except VibroimpactError as refusal:
        return f"a sound file is refused: {refusal}" if is_sound else files.badly_said(refusal, path)
    except KeyError:
        return "no calibration, and no refusal" if is_sound else None  # a table of another name
    return f"{found} for {tables}" if is_sound and found != tables else None


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    with files.bounded_memory() as grown:
        problem = draw.choice((_journal, _toml))(draw)
    return problem or grown()
