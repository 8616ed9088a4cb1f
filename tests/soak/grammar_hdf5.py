"""HDF5 files and MATLAB files of version 7.3: drawn ones are read equal, odd ones are read or refused."""

from __future__ import annotations

import random
from contextlib import suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from soak import _drawn_files as files

CASES, SAMPLE = files.CASES, files.SAMPLE
SECONDS = 3.0 * files.SECONDS
"""Thrice the usual limit: unwritten values take no space; a reader may meet 400 MB of them twice in its own 10 s."""

TYPES = ("f8", "f8", "f4", ">f8", "i2", "i4", "u1", ">i2")
HEAD = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
KEYS = (
    "units",
    "unit",
    "fs",
    "sample_rate",
    "dt",
    "MATLAB_class",
    "MATLAB_empty",
    "MATLAB_sparse",
    "CLASS",
    "_NCProperties",
    "scale_factor",
    "UNITS",
)
CLASSES = ("double", "single", "int16", "char", "struct", "cell", "logical")


def _layout(draw: random.Random, values: Any) -> dict[str, Any]:
    """Return the storage options of a dataset."""
    if draw.random() < 0.5:
        return {}
    packing = draw.choice(({}, {"compression": "gzip"}, {"compression": "lzf"}, {"shuffle": True}))
    return {
        "chunks": tuple(min(7, size) for size in values.shape),
        "fletcher32": draw.random() < 0.5,
        **packing,
    }


def _sound(draw: random.Random, path: Path, *, matlab: bool) -> files.Truth:
    signals = files.drawn_signals(draw)
    values = [_as(draw.choice(TYPES), one) for one in signals.values]
    units = list(signals.units) if not matlab else [""] * len(values)
    clock = draw.choice(("t", "time", "fs"))
    group = draw.choice(("", "", "run"))
    with h5py.File(path, "w", userblock_size=512 if matlab else 0) as file:
        place = file.require_group(group or "/")
        for name, one, unit in zip(signals.names, values, units, strict=True):
            shaped = one.reshape(1, -1) if matlab else one
            item = place.create_dataset(name, data=shaped, **_layout(draw, shaped))
            if unit:
                item.attrs["units"] = unit
            if matlab:
                item.attrs["MATLAB_class"] = np.bytes_(b"double")
        if clock == "fs" and not matlab:
            place.attrs["fs"] = 1.0 / signals.interval
        else:
            name = "t" if clock == "fs" else clock
            place[name] = signals.instants.reshape(1, -1) if matlab else signals.instants
        if draw.random() < 0.2:
            file["elsewhere"] = h5py.SoftLink("/etc/passwd")
            file["outside"] = h5py.ExternalLink("no.h5", "/a")
            file["words"] = "some"
    if matlab:
        content = path.read_bytes()
        path.write_bytes(HEAD + content[len(HEAD) :])
    start = 0.0 if clock == "fs" and not matlab else signals.start
    names = [f"{group}_{name}" if group else name for name in signals.names]
    cf = [files.UNITS[unit] for unit in units]
    truth = files.Truth([one.astype(np.float64) for one in values], cf, signals.interval, start)
    return _in_order(truth, names)


def _in_order(truth: files.Truth, names: list[str]) -> files.Truth:
    """Return the truth with its channels in the order of their names, as HDF5 lists them."""
    order = sorted(range(len(names)), key=lambda at: names[at])
    return files.Truth(
        [truth.values[at] for at in order],
        [truth.units[at] for at in order],
        truth.interval,
        truth.start,
        [names[at] for at in order],
    )


def _as(kind: str, values: files.Floats) -> Any:
    if "f" in kind:
        return values.astype(kind)
    limits = np.iinfo(kind)
    return np.clip(np.round(values / np.abs(values).max() * 200.0), limits.min, limits.max).astype(kind)


def _odd(draw: random.Random, path: Path) -> None:
    with h5py.File(path, "w", userblock_size=draw.choice((0, 0, 512))) as file:
        for _ in range(draw.randint(1, 8)):
            with suppress(
                ValueError, TypeError, OSError, RuntimeError, KeyError
            ):  # the library itself refuses it
                _add_odd(draw, file)


def _add_odd(draw: random.Random, file: h5py.File) -> None:
    name = draw.choice(
        ("t", "time", "base", "fs", "dt", "run/a", "run/t", "run/b", "a/b/c", "/".join("g" * 30))
    )
    count = draw.choice((0, 1, 3, 50))
    numbers = np.array([draw.choice(files.FRACTIONS) for _ in range(count)])
    match draw.randrange(12):
        case 0:
            file[name] = h5py.SoftLink(files.word(draw, "/t", "/", "."))
        case 1:
            file[name] = h5py.ExternalLink(files.word(draw, "x.h5"), "/")
        case 2:
            file[name] = file[draw.choice(("/", "t", "run"))]
        case 3:
            file[name] = np.array([(1.0, 2)], dtype=[("x", "f8"), ("y", "i4")])
        case 4:
            file.create_dataset(name, data=["a", "b"], dtype=h5py.string_dtype())
        case 5:
            file.create_dataset(
                name,
                shape=draw.choice(((2**40,), (2**31, 2), (0,), (0, 5), None)),
                dtype="f8",
                **draw.choice(({}, {"chunks": True})),
            )
        case 6:
            file[name] = np.zeros((2, 3, 4))
        case 7:
            file[name] = numbers.reshape(draw.choice(((-1, 1), (1, -1), (-1,))))
        case 8:
            file.create_dataset(name, shape=(5,), dtype="f8", external=[("/etc/passwd", 0, 40)])
        case 9:
            file[name] = draw.choice((1.5, 7, True, "word", b"word", np.complex128(1j)))
        case 10:
            file.create_dataset(name, data=numbers, dtype=draw.choice(("f2", "f4", "i1", "u8", "?")))
        case _:
            file.require_group(name)
    item = file[name]
    for key in draw.sample(KEYS, draw.randrange(4)):
        item.attrs[key] = draw.choice(
            (
                files.word(draw),
                np.bytes_(draw.choice(CLASSES).encode()),
                draw.choice(files.FRACTIONS),
                [1, 2],
                h5py.Empty("f4"),
                h5py.Empty("S1"),
            )
        )


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path(draw.choice(("record.h5", "record.mat"))), draw.random()
    matlab = path.suffix == ".mat"
    if kind < 0.4:
        with np.errstate(all="ignore"):
            _odd(draw, path)
        return files.odd(path, crashes=True)
    truth = _sound(draw, path, matlab=matlab)
    if kind < 0.8:
        return files.sound(path, truth)
    path.write_bytes(files.damaged(draw, path.read_bytes()))
    return files.odd(path, crashes=True)
