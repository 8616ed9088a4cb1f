"""Damaged and hostile recordings of every format: imported or refused in one line; a cut file has no wrong end."""

from __future__ import annotations

import io
import random
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pyarrow as pa
from nptdms import ChannelObject, TdmsWriter
from pyarrow import feather, parquet
from scipy.io import savemat, wavfile

from soak.scenes import wrong_message
from vibroimpact.analysis.recording import Recording, write_recording
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.hardware.recordings import import_recording

SAMPLE = 50
SECONDS = 10.0
ROWS = 80
TIME = np.arange(ROWS) / 100.0
BASE = np.round(np.sin(np.arange(ROWS) / 7.0), 5)
BOARD = np.round(30.0 * np.cos(np.arange(ROWS) / 3.0), 5)
LABVIEW = (
    "LabVIEW Measurement,\nWriter_Version,2\nSeparator,Comma\nX_Columns,One\nDate,2026/07/30\n"
    "Time,20:07:43.62\n***End_of_Header***,\n,\nChannels,2,,\nSamples,80,80,\nY_Unit_Label,g,g,\n"
    "X_Dimension,Time,Time,\nX0,0.0E+0,0.0E+0,\nDelta_X,0.010000,0.010000,\n***End_of_Header***,,,\n"
    "X_Value,base,board,Comment\n"
)
INSERTED = (
    b",", b";", b"\t", b"\n", b"\r", b"1e999", b"nan", b"\xff\xfe", b"OVRNG", b"-" * 40, b"9" * 400, b"#", b"\x00",
    b"***", b"1,5", b"1.5.5", b"\x1b[31m", b"\xe2\x80\xae", b"\xc2\x85", b'"', b"2026-07-30 10:00:00", b"word",
    b" " * 3000, b"7" * 100_000, b"\n" * 500, b"0x1p3", b"1e-400", b"[bold]",
)  # fmt: skip


def rows(form: str) -> str:
    """Return the table with each row in this form."""
    return "".join(form.format(t, a, b) for t, a, b in zip(TIME, BASE, BOARD, strict=True))


def tdms() -> bytes:
    """Return a TDMS file of two segments."""
    content = io.BytesIO()
    known = {"wf_increment": 0.01, "wf_start_time": np.datetime64("2026-07-30T10:00:00"), "unit_string": "g"}
    with TdmsWriter(content) as writer:
        for part in (slice(0, 40), slice(40, ROWS)):
            writer.write_segment(
                [
                    ChannelObject("run", "base", BASE[part], known),
                    ChannelObject("run", "board", BOARD[part], known),
                ]
            )
    return content.getvalue()


def matlab() -> bytes:
    """Return a MAT file."""
    content = io.BytesIO()
    savemat(content, {"t": TIME, "base": BASE, "board": BOARD})
    return content.getvalue()


def netcdf() -> bytes:
    """Return a NetCDF file of version 3."""
    file = netCDF4.Dataset("memory.nc", "w", memory=1, format="NETCDF3_CLASSIC")
    file.createDimension("time", ROWS)
    for name, values, unit in (("time", TIME, "s"), ("base", BASE, "m s-2"), ("board", BOARD, "m s-2")):
        variable = file.createVariable(name, "f8", ("time",))
        variable.units = unit
        variable[:] = values
    return bytes(file.close())


def hdf5() -> bytes:
    """Return an HDF5 file with a group."""
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file["run/t"], file["run/base"], file["run/board"] = TIME, BASE, BOARD
        file["run/base"].attrs["units"] = "g"
    return content.getvalue()


def wav() -> bytes:
    """Return a WAV file of floats."""
    content = io.BytesIO()
    wavfile.write(content, 100, np.stack([BASE, BOARD], axis=1))
    return content.getvalue()


def uff() -> bytes:
    """Return a universal file of text, as pyuff writes it."""
    head = (
        "{:<80}\n" * 5 + "    1         0    0         0       NONE         1   3       NONE         0   0\n"
    )
    form = "         4        80         1  0.00000e+00  1.00000e-02  0.00000e+00\n"
    axes = (
        "        17    0    0    0 NONE                 s\n        12    0    0    0 NONE                 g\n"
    )
    rest = "         0    0    0    0 NONE                 NONE\n" * 2
    functions = []
    for name, values in (("base", BASE), ("board", BOARD)):
        rows = "".join("".join(f"{one:20.11e}" for one in row) + "\n" for row in values.reshape(-1, 4))
        functions.append(
            f"    -1\n    58\n{head.format(name, *['NONE'] * 4)}{form}{axes}{rest}{rows}    -1\n"
        )
    return "".join(functions).encode()


def arrow(feathered: bool) -> bytes:
    """Return a Parquet or Feather file."""
    content, table = io.BytesIO(), pa.table({"time": TIME, "base [g]": BASE, "board [g]": BOARD})
    (feather.write_feather if feathered else parquet.write_table)(table, content)
    return content.getvalue()


TEXTS: dict[str, str] = {
    "comma.csv": "time (s),base (g),board (g)\n" + rows("{:.2f},{:.5f},{:.5f}\n"),
    "semicolon.csv": "Zeit;base;board\n" + rows("{:.2f};{:.5f};{:.5f}\r\n").replace(".", ","),
    "exponent.txt": rows("{:.5e}\t{:.5e}\t{:.5e}\n"),
    "shortest.txt": "# a comment\nt base board\n" + rows("{:g} {:g} {:g}\n"),
    "record.lvm": LABVIEW + rows("{:.6f},{:.6f},{:.6f}\n"),
}
MAKERS: dict[str, Callable[[], bytes]] = {
    "record.tdms": tdms,
    "record.mat": matlab,
    "record.nc": netcdf,
    "record.h5": hdf5,
    "record.wav": wav,
    "record.uff": uff,
    "record.parquet": lambda: arrow(False),
    "record.feather": lambda: arrow(True),
}


@lru_cache(maxsize=1)
def whole() -> dict[str, bytes]:
    """Return a sound file of each format."""
    return {name: text.encode() for name, text in TEXTS.items()} | {
        name: make() for name, make in MAKERS.items()
    }


def damaged(draw: random.Random, content: bytes) -> bytes:
    """Return a file with bytes changed, put in or taken out."""
    changed = bytearray(content)
    for _ in range(draw.choice((1, 2, 4, 20))):
        place = draw.randrange(len(changed) + 1)
        match draw.randrange(5):
            case 0:
                changed[place : place + 1] = bytes([draw.randrange(256)])
            case 1:
                changed[place:place] = draw.choice(INSERTED) * draw.choice((1, 3, 30))
            case 2:
                changed[place : place + draw.randint(1, 300)] = b""
            case 3 if changed:
                bit = draw.randrange(8 * len(changed))
                changed[bit // 8] ^= 1 << bit % 8
            case _:
                lines = bytes(changed).split(b"\n")
                draw.shuffle(lines)
                changed = bytearray(b"\n".join(lines) if draw.random() < 0.2 else changed)
    return bytes(changed)


def imported(path: Path) -> Recording | str:
    """Return the recording, or the refusal; any other error propagates."""
    try:
        return import_recording([path])
    except (DatasetError, UsageError) as refusal:
        return str(refusal)


def wrong_end(recording: Recording) -> str | None:
    """Return the channel of a cut-off file with a wrong sample; None where a remark names the cut end."""
    if "the text ends with" in "\n".join(recording.remarks):
        return None
    columns = list(recording.channels.values())
    for channel, known in zip(columns, (BASE, BOARD), strict=False):
        values = channel.values[: len(known)]
        # `{:g}` keeps six digits
        right = np.isnan(values) | np.isclose(values, known[: len(values)], rtol=1e-5, atol=1e-5)
        if len(columns) == 2 and not right.all():
            place = int(np.argmin(right))
            return (
                f"{channel.name}: sample {place} is {values[place]}, not {known[place]}, and nothing is said"
            )
    return None


def check(seed: int) -> str | None:
    """Import one file that was cut off or damaged otherwise."""
    draw = random.Random(seed)
    name = draw.choice(sorted(whole()))
    content, cut = whole()[name], draw.random() < 0.4
    path = Path(name)
    path.write_bytes(content[: -draw.randint(1, 200)] if cut else damaged(draw, content))
    found = imported(path)
    if isinstance(found, str):
        return wrong_message(found) or (
            None if found.startswith(name) else f"no name of the file: {found[:200]!r}"
        )
    try:
        write_recording(found, Path("imported.nc"))
    except DatasetError as refusal:  # the recording holds numbers that no measurement has
        return wrong_message(str(refusal))
    said = "\n".join(found.remarks)
    return (wrong_message(said) if said else None) or (wrong_end(found) if cut else None)
