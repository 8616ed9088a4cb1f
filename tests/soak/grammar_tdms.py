"""TDMS files of drawn groups, channels, types and segments: read equal; with odd fields: read or refused."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from support import raw_files as raw

from soak import _drawn_files as files

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

TYPES = ("f8", "f8", "f4", "i2", "i4", "u1", "i8")
SCALES = (
    "Linear",
    "Polynomial",
    "Thermocouple",
    "RTD",
    "Table",
    "Strain",
    "Add",
    "Subtract",
    "Thermistor",
    "None",
)
KEYS = (
    *("wf_increment", "wf_start_offset", "wf_samples", "wf_start_time", "unit_string", "name", "DecimationLevel"),
    *("NI_Number_Of_Scales", "NI_Scale[0]_Scale_Type", "NI_Scale[0]_Linear_Slope", "NI_Scale[0]_Linear_Y_Intercept"),
    *("NI_Scale[0]_Linear_Input_Source", "NI_Scale[1]_Scale_Type", "NI_Scale[0]_Polynomial_Coefficients_Size"),
    *("NI_Scale[0]_Polynomial_Coefficients[0]", "NI_Scale[0]_Polynomial_Input_Source", "NI_Scaling_Status"),
    *("NI_Scale[0]_Table_Scaled_Values_Size", "NI_Scale[0]_Table_Pre_Scaled_Values_Size", "NI_Scale[9]_Scale_Type"),
)  # fmt: skip


def _sound(draw: random.Random, path: Path) -> files.Truth:
    signals = files.drawn_signals(draw)
    kinds = [draw.choice(TYPES) for _ in signals.values]
    values = [_as(kind, one) for kind, one in zip(kinds, signals.values, strict=True)]
    cut = draw.choice((0, 0, signals.count // 3))
    known = {"wf_increment": signals.interval, "wf_start_offset": signals.start}
    if draw.random() < 0.4:
        known |= {"wf_start_time": np.datetime64("2026-07-30T10:00:00"), "wf_samples": 10}
    with TdmsWriter(path) as writer:
        for part in (slice(0, cut), slice(cut, None)) if cut else (slice(None),):
            channels = [
                ChannelObject("run", name, one[part], {**known, "unit_string": unit, "note": 3.5})
                for name, unit, one in zip(signals.names, signals.units, values, strict=True)
            ]
            writer.write_segment(
                [RootObject({"name": "bench"}), GroupObject("run", {"who": "nobody"}), *channels]
            )
    exact = [one.astype(np.float64) for one in values]
    units = files.truth_of(signals).units
    return files.Truth(exact, units, signals.interval, signals.start, signals.names)


def _as(kind: str, values: files.Floats) -> Any:
    if kind[0] == "f":
        return values.astype(kind)
    limits = np.iinfo(kind)
    largest = float(np.abs(values).max())
    return np.clip(np.round(values / largest * min(limits.max, 10_000)), limits.min, limits.max).astype(kind)


def _odd(draw: random.Random) -> bytes:
    """Return segments with some odd fields."""
    return b"".join(_odd_segment(draw) for _ in range(draw.choice((1, 1, 2, 4))))


def _odd_segment(draw: random.Random) -> bytes:
    objects, data = [], b""
    for _ in range(draw.choice((0, 1, 2, 3))):
        values = files.drawn_values(draw, 20)[: draw.choice((0, 1, 3, 20))].astype(draw.choice(("f8", "f4")))
        properties = {draw.choice(KEYS): _value(draw) for _ in range(draw.randrange(7))}
        names = files.word(draw, "run"), files.word(draw, "base", "tip")
        one, content = raw.tdms_channel(*names, values, properties)
        if draw.random() < 0.3:
            kind, length = (
                files.number(draw, 9, 10, 3, 0x20, 0x44),
                files.number(draw, 20, 28, 0, 0x1269, 0x1369),
            )
            count, dimension = bounded(draw, 64, len(values)), bounded(draw, 32, 1)
            index = raw.tdms_index(files.bounded(kind, 32), count, dimension, files.bounded(length, 32))
            one = raw.TdmsObject(one.path, index, one.properties)
        objects.append(one)
        data += content
    return raw.tdms_segment(
        objects,
        data,
        contents=files.bounded(
            files.number(draw, 0b1110, 0b1110, 0b1000, 0b101110, 0b1001110, 0b10001110), 32
        ),
        number=bounded(draw, 32, len(objects)),
        lead=draw.choice((b"TDSm", b"TDSm", b"TDSm", b"TDSh")),
        following=None if draw.random() < 0.9 else bounded(draw, 64, 100),
        begin=None if draw.random() < 0.9 else bounded(draw, 64, 60),
    )


def bounded(draw: random.Random, bits: int, usual: int) -> int:
    """Return a number of `bits` bits, nearly always the usual one."""
    return usual if draw.random() < 0.9 else files.bounded(files.number(draw), bits)


def _value(draw: random.Random) -> Any:
    match draw.randrange(4):
        case 0:
            return files.word(draw, *SCALES)
        case 1:
            return files.bounded(files.number(draw, 0, 1, 2), 32, signed=True)
        case 2:
            return draw.choice(files.FRACTIONS)
        case _:
            return draw.random() < 0.5


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path("record.tdms"), draw.random()
    if kind < 0.4:
        return files.sound(path, _sound(draw, path))
    if kind < 0.8:
        path.write_bytes(_odd(draw))
        return files.odd(path)
    _sound(draw, path)
    path.write_bytes(files.damaged(draw, path.read_bytes()))
    return files.odd(path)
