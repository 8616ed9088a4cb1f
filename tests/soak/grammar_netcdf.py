"""NetCDF files of other programs: drawn variables are read equal; odd headers and attributes are read or refused."""

from __future__ import annotations

import random
import struct
from contextlib import suppress
from pathlib import Path

import netCDF4
import numpy as np
from support import raw_files as raw

from soak import _drawn_files as files

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

VERSIONS = ("NETCDF3_CLASSIC", "NETCDF3_64BIT_OFFSET", "NETCDF4", "NETCDF4_CLASSIC")
TYPES = ("f8", "f8", "f4", "i2", "i4")
KEYS = (
    "units",
    "long_name",
    "scale_factor",
    "add_offset",
    "_FillValue",
    "missing_value",
    "valid_range",
    "calendar",
    "_Unsigned",
)


def _sound(draw: random.Random, path: Path, version: str) -> files.Truth:
    signals = files.drawn_signals(draw)
    unit = draw.choice(("s", "seconds", "ms", "seconds since 2026-07-30 10:00:00"))
    values = []
    with netCDF4.Dataset(path, "w", format=version) as file:
        file.createDimension("time", draw.choice((None, signals.count)))
        time = file.createVariable("time", "f8", ("time",))
        time.units = unit
        time[:] = signals.instants * (1e3 if unit == "ms" else 1.0)
        for name, own, one in zip(signals.names, signals.units, signals.values, strict=True):
            values.append(_variable(draw, file, name, own, one))
        if draw.random() < 0.3:
            file.createVariable("count", "i4", ())
            file.title = "of the beam"
    start = 0.0 if "since" in unit else signals.start
    return files.Truth(values, files.truth_of(signals).units, signals.interval, start, signals.names)


def _variable(
    draw: random.Random, file: netCDF4.Dataset, name: str, unit: str, values: files.Floats
) -> files.Floats:
    """Write one variable, sometimes packed or with missing values; return its values."""
    kind = draw.choice(TYPES)
    packed = kind[0] == "i"
    options = (
        {"zlib": True, "fletcher32": draw.random() < 0.5}
        if file.data_model.startswith("NETCDF4") and draw.random() < 0.4
        else {}
    )
    variable = file.createVariable(
        name, kind, ("time",), fill_value=-9999 if packed and draw.random() < 0.4 else None, **options
    )
    if unit:
        variable.units = unit
    known = (
        values.astype(kind).astype(np.float64)
        if not packed
        else np.round(100.0 * values / np.abs(values).max())
    )
    if hasattr(variable, "_FillValue"):
        known[5:7] = np.nan
    if packed and draw.random() < 0.5:
        variable.set_auto_maskandscale(False)
        variable.scale_factor, variable.add_offset = 0.25, 2.0
        variable[:] = np.where(np.isnan(known), -9999, known).astype(kind)
        return np.asarray(known * 0.25 + 2.0)
    missing = np.isnan(known)
    variable[:] = np.ma.masked_array(np.where(missing, 0.0, known), missing)
    return np.asarray(known)


def _odd_classic(draw: random.Random) -> bytes:
    """Return a file of the classic format with some odd sizes, types and places."""

    def whole(usual: int) -> int:
        return usual if draw.random() < 0.85 else files.bounded(files.number(draw), 32, signed=True)

    rows = draw.choice((0, 1, 3, 20))
    dims = [
        raw.cdf_name(files.word(draw, "time", "x")) + struct.pack(">i", whole(rows))
        for _ in range(draw.randint(0, 3))
    ]
    variables = []
    for _ in range(draw.randint(0, 4)):
        places = [whole(draw.randrange(max(1, len(dims)))) for _ in range(draw.choice((1, 1, 0, 2)))]
        attributes = [
            raw.cdf_text(draw.choice(KEYS), files.word(draw, "s", "g", "ms"))
            for _ in range(draw.randrange(3))
        ]
        variables.append(
            raw.cdf_variable(
                files.word(draw, "time", "a", "base"),
                places,
                attributes,
                whole(draw.choice((6, 5, 4, 3, 2, 1))),
                whole(8 * rows),
                whole(200),
            )
        )
    known = [raw.cdf_text("title", files.word(draw))] if draw.random() < 0.3 else []
    content = raw.cdf_file(dims, known, variables, b"\x40" * 400, records=whole(0))
    return (
        content
        if draw.random() < 0.8
        else content.replace(struct.pack(">i", 12), struct.pack(">i", whole(12)), 1)
    )


def _odd(draw: random.Random, path: Path) -> None:
    """Write a file with unfit attributes."""
    with netCDF4.Dataset(path, "w", format=draw.choice(VERSIONS)) as file:
        file.createDimension("time", draw.choice((0, 1, 2, 40)))
        for name in draw.sample(("time", "t", "base", "time_2"), draw.randint(1, 4)):
            with suppress(
                RuntimeError, TypeError, ValueError, AttributeError, OSError
            ):  # the library itself refuses it
                variable = file.createVariable(
                    name, draw.choice(("f8", "f4", "i2", "i4", "S1", "i1")), ("time",)
                )
                for key in draw.sample(KEYS[:4] + KEYS[5:], draw.randrange(5)):
                    variable.setncattr(
                        key,
                        draw.choice(
                            (
                                files.word(draw, "s", "g"),
                                draw.choice(files.FRACTIONS),
                                np.int16(3),
                                [1.0, 2.0],
                            )
                        ),
                    )
                variable.set_auto_maskandscale(False)
                variable[:] = np.resize(
                    np.array([draw.choice(files.FRACTIONS) for _ in range(5)]), len(file.dimensions["time"])
                )


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path("record.nc"), draw.random()
    if kind < 0.25:
        path.write_bytes(_odd_classic(draw))
        return files.odd(path)
    if kind < 0.45:
        with np.errstate(all="ignore"):
            _odd(draw, path)
        return files.odd(path, crashes=True)
    version = draw.choice(VERSIONS)
    truth = _sound(draw, path, version)
    if kind < 0.8:
        return files.sound(path, truth)
    path.write_bytes(files.damaged(draw, path.read_bytes()))
    return files.odd(path, crashes=True)
