"""Damaged and hostile NetCDF and MATLAB files through every reader: opened, or refused in one line."""

from __future__ import annotations

import functools
import io
import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from unittest.mock import patch

import netCDF4
import numpy as np
from scipy.io import savemat
from support.command_line import in_this_process
from support.dataset_examples import everything, up_down

from vibroimpact.analysis import open_dataset, write_dataset
from vibroimpact.analysis.dataset import open_measured, read_flat, read_part
from vibroimpact.analysis.dataset.schema import RULES
from vibroimpact.analysis.files.fingerprints import LINE_LENGTH
from vibroimpact.analysis.files.opening import file_attributes
from vibroimpact.analysis.recording import (
    Channel,
    EventTrain,
    Recording,
    SingleValue,
    TimeAxis,
    open_recording,
    open_signals,
    write_recording,
)
from vibroimpact.fmus.errors import VibroimpactError
from vibroimpact.hardware.recordings import import_recording

SAMPLE = 10
SECONDS = 40.0
LONGEST_MESSAGE = 5000

Door = Callable[[Path], object]


def _loaded(path: Path) -> None:
    with open_dataset(path) as dataset:
        dataset.load()


def _measured(path: Path) -> None:
    with open_measured(path) as dataset:
        dataset.load()


DOORS: tuple[Door, ...] = (
    *(_loaded, _measured, read_flat, read_part, open_recording, open_signals, file_attributes),
    lambda path: import_recording([path]),
)


@functools.cache
def whole(kind: str) -> bytes:
    """Return a sound file, without the hash that would reveal damage."""
    path = Path(f"{kind}.base")
    if kind == "matlab":
        content = io.BytesIO()
        savemat(content, {"t": np.arange(50) / 100, "base": np.sin(np.arange(50)), "note": "hello"})
        return content.getvalue()
    if kind == "recording":
        axis = TimeAxis(np.arange(40) / 100, 0.01)
        channels = {
            name: Channel(name, np.cos(axis.time), "m s-2", axis, np.zeros(40, np.uint8))
            for name in ("base", "tip")
        }
        trains = {"hits": EventTrain("hits", np.array([0.1, 0.2]), (0.0, 0.4))}
        write_recording(Recording(channels, trains, {"mass": SingleValue(1.0, "kg", "mass")}), path)
    elif kind == "classic":
        with netCDF4.Dataset(path, "w", format="NETCDF3_CLASSIC") as file:
            file.createDimension("time", 30)
            file.createVariable("time", "f8", ("time",))[:] = np.arange(30.0)
            file.createVariable("a", "f4", ("time",))[:] = np.arange(30.0)
    else:
        write_dataset(
            everything() if kind == "everything" else up_down(5), path, compression=4 * (kind == "packed")
        )
    content_bytes = path.read_bytes()
    path.unlink()
    return content_bytes if kind == "classic" else content_bytes[:-LINE_LENGTH]


def damaged(draw: random.Random) -> bytes:
    """Return a file with bits flipped, bytes zeroed, exchanged, set or cut off."""
    content = bytearray(
        whole(draw.choice(["everything", "plain", "packed", "recording", "classic", "matlab"]))
    )
    for _ in range(draw.choice([1, 1, 1, 2, 5, 20])):
        place = draw.randrange(len(content))
        length = draw.choice([1, 2, 4, 8, 47, 200, 2000])
        kind = draw.randrange(7)
        if kind <= 1:
            content[place] ^= 1 << draw.randrange(8)
        elif kind == 2:
            content[place : place + length] = bytes(min(length, len(content) - place))
        elif kind == 3:
            content[place : place + length] = b"\xff" * min(length, len(content) - place)
        elif kind == 4:
            other = draw.randrange(len(content))
            content[place : place + length] = content[other : other + length]
        elif kind == 5:
            number = draw.choice([-1, -8, 2**31, 2**40, 2**63 - 1, 0, 3])
            content[place : place + 8] = number.to_bytes(8, "little", signed=True)
        elif draw.random() < 0.3:
            del content[max(1, place) :]
    return bytes(content)


ATTRIBUTES = (
    *("1", "", "SI", 1, -3, 2.5, float("nan"), "x" * 300, "\u202e\x1b[31m", "CF-1.11"),
    *(np.arange(3), np.array([1e308, -np.inf]), "1 2 3", "not a unit", ["a", "b"]),
)
TYPES = ("f8", "f4", "i1", "i4", "i8", "u1", "u8", "S1", str, "vlen", "enum", "compound")
GLOBALS = (
    "dataset_schema",
    "recording_schema",
    "results_kind",
    "units_system",
    "Conventions",
    "scene",
    "variable_order",
)
LOCALS = (
    *(
        "units",
        "long_name",
        "coordinates",
        "flag_values",
        "flag_meanings",
        "sampling_interval",
        "event_train",
    ),
    *(
        "ancillary_variables",
        "window_start",
        "window_end",
        "resolution",
        "interval_uncertainty",
        "scale_factor",
    ),
    *("add_offset", "missing_value", "valid_range", "swept_key", "role"),
)
NAMES = (
    *RULES,
    "time",
    "time_2",
    "base",
    "base_quality",
    "omega",
    "hits",
    "Omega/2",
    "\u202ename",
    "value",
    "error",
)
DIMENSIONS = ("run", "period", "impact", "stick", "sample", "event", "time", "estimate", "string")


def hostile(path: Path, draw: random.Random) -> None:
    """Write a file with known names whose types, sizes and attributes do not fit."""
    with netCDF4.Dataset(path, "w", format=draw.choice(["NETCDF4", "NETCDF4", "NETCDF3_CLASSIC"])) as file:
        old = file.data_model != "NETCDF4"
        large = draw.choice(DIMENSIONS)  # two large dimensions would make variables of gigabytes
        for name in DIMENSIONS:
            size = draw.choice([1, 2, 3, 5, 7] if old else [0, 1, 2, 3, 5, 7])
            file.createDimension(name, 20_000 if name == large else size)
        for name in draw.sample(GLOBALS, draw.randrange(len(GLOBALS))):
            _attribute(file, name, draw)
        if draw.random() < 0.7:
            file.setncatts({"dataset_schema": "1", "Conventions": "CF-1.11", "units_system": "SI"})
        for name in {"run_index", "outcome", *draw.sample(NAMES, draw.randrange(len(NAMES)))}:
            _variable(file, name, draw, old)


def _variable(file: netCDF4.Dataset, name: str, draw: random.Random, old: bool) -> None:
    kinds = [kind for kind in TYPES if kind in ("f8", "f4", "i1", "i4", "S1")] if old else TYPES
    kind = draw.choice(kinds)
    rule = RULES.get(name)
    dimensions: tuple[str, ...] = tuple(draw.sample(DIMENSIONS, draw.randrange(3)))
    if rule is not None and draw.random() < 0.7 and set(rule.dims) <= set(DIMENSIONS):
        dimensions = rule.dims
        kind = (
            np.dtype(rule.dtype).str[1:]
            if np.dtype(rule.dtype).kind in "if" and draw.random() < 0.7
            else kind
        )
        kind = "i4" if old and kind == "i8" else kind
    made: object = kind
    if kind == "vlen":
        made = file.createVLType(np.float64, f"vlen_{len(file.vltypes)}")
    elif kind == "enum":
        made = file.createEnumType(np.int8, f"enum_{len(file.enumtypes)}", {"a": 1, "b": 2})
    elif kind == "compound":
        made = file.createCompoundType(np.dtype([("x", "f8"), ("y", "i4")]), f"compound_{len(file.cmptypes)}")
    try:
        variable = file.createVariable(name.replace("/", "_"), made, dimensions)  # type: ignore[call-overload]
    except (RuntimeError, ValueError, TypeError, KeyError):
        return  # the library itself refuses the combination
    for key in draw.sample(LOCALS, draw.randrange(6)):
        _attribute(variable, key, draw)
    if rule is not None and draw.random() < 0.8:
        variable.setncatts({"units": rule.unit, "long_name": rule.long_name})
    if isinstance(made, str) and made[0] in "fiu" and draw.random() < 0.8 and variable.size < 1000:
        values = draw.choice([np.zeros, np.ones])(variable.shape) * draw.choice(
            [1, -1, 2, 100, np.nan, 1e300]
        )
        variable.set_auto_maskandscale(False)
        with suppress(RuntimeError):  # the library does not store every value
            variable[...] = np.nan_to_num(values).astype(made) if made[0] != "f" else values


def _attribute(holder: object, name: str, draw: random.Random) -> None:
    try:
        holder.setncattr(name, draw.choice(ATTRIBUTES))  # type: ignore[attr-defined]
    except (TypeError, ValueError, RuntimeError, AttributeError, OSError):
        return  # the library itself refuses the combination


def check(seed: int) -> str | None:
    """Open one damaged or hostile file by every reader."""
    draw = random.Random(seed)
    path = Path.cwd() / draw.choice(["file.nc", "file.nc", "file.mat"])
    if draw.random() < 0.7:
        path.write_bytes(damaged(draw))
    else:
        with np.errstate(all="ignore"):
            hostile(path, draw)
    before = path.read_bytes()
    with patch.dict("os.environ", {"VIBROIMPACT_CACHE": str(Path.cwd() / "cache")}):
        for door in DOORS:
            problem = _refusal(door, path)
            if problem is not None:
                return problem
        if draw.random() < 0.05:
            done = in_this_process("plot", path, "-o", "figure.png")
            if done.returncode not in (0, 2):
                return f"plot: exit code {done.returncode}: {done.stderr[:500]}"
    left = {entry.name for entry in Path.cwd().iterdir()} - {"cache", "figure.png", path.name}
    if left or path.read_bytes() != before:
        return f"{sorted(left)} written, or the file changed"
    return None


def _refusal(door: Door, path: Path) -> str | None:
    """Return the problem of a reader's refusal; any other error propagates."""
    try:
        door(path)
    except VibroimpactError as refusal:
        if path.name not in str(refusal) or len(str(refusal)) > LONGEST_MESSAGE:
            return f"{len(str(refusal))} characters of refusal: {str(refusal)[:300]}"
    return None
