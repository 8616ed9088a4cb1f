"""Universal files of drawn functions, text and binary: read equal; with odd fields and lines: read or refused."""

from __future__ import annotations

import random
from pathlib import Path

import numpy as np
import pyuff
from support import raw_files as raw

from soak import _drawn_files as files
from soak.recordings import INSERTED
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.hardware.formats.universal import read_universal

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

FIELDS = (
    "0",
    "1",
    "-1",
    "2",
    "4",
    "5",
    "6",
    "58",
    "99999",
    "1e9",
    "nan",
    "NONE",
    "",
    "x",
    "1.5",
    "9" * 12,
    "-9" * 6,
)
SETS = ("15", "55", "58", "58b", "82", "151", "164", "2411", "2414", "0", "-1", "99999", "x", "")


def _sound(draw: random.Random, path: Path) -> files.Truth:
    """Write a file; return its expected reading."""
    signals = files.drawn_signals(draw)
    kind = draw.choice(("text", "pyuff", "binary"))
    if kind == "text":
        digits = draw.choice((5, 11))
        texts = [[f"{value:.{digits}e}" for value in one] for one in signals.values]
        functions = [
            raw.uff_function(
                name,
                text,
                unit=unit or "NONE",
                start=f"{signals.start:.5e}",
                interval=f"{signals.interval:.5e}",
            )
            for name, text, unit in zip(signals.names, texts, signals.units, strict=True)
        ]
        others = [raw.uff_set("151", ["NONE"] * 7)] if draw.random() < 0.4 else []
        path.write_text("".join([*others, *functions]))
        values = [np.array([float(text) for text in one]) for one in texts]
        return files.Truth(
            values, files.truth_of(signals).units, signals.interval, signals.start, signals.names
        )
    file = pyuff.UFF(str(path))
    for name, one, unit in zip(signals.names, signals.values, signals.units, strict=True):
        file.write_sets(_function(name, one, unit, signals, binary=kind == "binary"), mode="add")
    tolerance = 0.0 if kind == "binary" else 1e-5
    return files.truth_of(signals, tolerance=tolerance)


def _function(
    name: str, values: files.Floats, unit: str, signals: files.Signals, *, binary: bool
) -> dict[str, object]:
    known = {
        **dict.fromkeys(("ver_num", "load_case_id", "ref_node", "ref_dir"), 0),
        **dict.fromkeys(("orddenom_spec_data_type", "z_axis_spec_data_type"), 0),
        **dict.fromkeys(("rsp_ent_name", "ref_ent_name", "id2", "id3", "id4", "id5"), "NONE"),
        "binary": int(binary),
        "id1": name,
        "func_type": 1,
        "rsp_node": 7,
        "rsp_dir": 3,
        "x": signals.instants,
        "data": values,
        "ord_data_type": 4,
        "num_pts": len(values),
        "abscissa_spacing": 1,
        "abscissa_min": signals.start,
        "abscissa_inc": signals.interval,
        "abscissa_spec_data_type": 17,
        "abscissa_axis_units_lab": "s",
        "ordinate_spec_data_type": 12,
        "ordinate_axis_units_lab": unit or "NONE",
    }
    return dict(pyuff.prepare_58(**known))


def _odd(draw: random.Random) -> bytes:
    """Return datasets with odd fields and lines."""
    sets = []
    for _ in range(draw.randint(1, 4)):
        values = [
            draw.choice(("1.5", "2.5", *FIELDS)) if draw.random() < 0.1 else "1.5"
            for _ in range(draw.choice((0, 1, 4, 9)))
        ]
        fields = {
            key: draw.choice(FIELDS)
            for key in draw.sample(
                ("kind", "data", "count", "spacing", "start", "interval", "abscissa"),
                draw.choice((0, 1, 2, 4)),
            )
        }
        text = raw.uff_function(files.word(draw, "base"), values, unit=files.word(draw, "g"), **fields)
        if draw.random() < 0.3:
            text = raw.uff_set(
                draw.choice(SETS),
                [files.word(draw, "NONE", "1 2 3", "1.0 2.0") for _ in range(draw.choice((0, 1, 7, 20)))],
            )
        sets.append(text)
    lines = "".join(sets).split("\n")
    for _ in range(draw.choice((0, 0, 1, 5))):
        place = draw.randrange(len(lines))
        match draw.randrange(4):
            case 0:
                lines[place] = lines[place][: draw.randrange(80)]
            case 1:
                lines.insert(place, draw.choice((*FIELDS, "    -1", "", " " * 80)))
            case 2:
                lines[place] = lines[draw.randrange(len(lines))]
            case _:
                del lines[place]
    content = "\n".join(lines).encode("utf-8", "replace")
    if draw.random() < 0.2:
        place = draw.randrange(len(content) + 1)
        content = content[:place] + draw.choice(INSERTED) + content[place:]
    return content


def _whole_file(path: Path) -> str | None:
    """Read the whole content of a universal file."""
    try:
        read_universal(path)
    except VibroimpactError as refusal:
        return (
            None
            if len(str(refusal)) <= files.LONGEST_MESSAGE
            else f"{len(str(refusal))} characters of refusal"
        )
    return None


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path("record.uff"), draw.random()
    if kind < 0.4:
        path.write_bytes(_odd(draw))
        return files.odd(path) or _whole_file(path)
    truth = _sound(draw, path)
    if kind < 0.8:
        return files.sound(path, truth)
    path.write_bytes(files.damaged(draw, path.read_bytes()))
    return files.odd(path) or _whole_file(path)
