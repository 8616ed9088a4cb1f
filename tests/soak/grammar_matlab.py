"""MATLAB files of versions 4 and 5: drawn variables and structures are read equal; odd elements are read or refused."""

from __future__ import annotations

import random
import struct
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import savemat
from scipy.sparse import coo_matrix
from support import raw_files as raw

from soak import _drawn_files as files

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

TYPES = ("f8", "f8", "f4", "i2", "i4", "u1", "u2")


def drawn_variables(draw: random.Random) -> tuple[dict[str, Any], files.Truth]:
    """Return variables by name, and their expected reading."""
    signals = files.drawn_signals(draw)
    values = [_as(draw.choice(TYPES), one) for one in signals.values]
    shape = draw.choice(((-1, 1), (1, -1)))
    arrays: dict[str, Any] = {
        name: one.reshape(shape) for name, one in zip(signals.names, values, strict=True)
    }
    clock = draw.choice(("t", "time", "fs", "dt"))
    arrays[clock] = {"fs": 1.0 / signals.interval, "dt": signals.interval}.get(
        clock, signals.instants.reshape(shape)
    )
    start = signals.start if clock in ("t", "time") else 0.0
    names = list(signals.names)
    if draw.random() < 0.4:
        arrays, names = {"run": arrays}, [f"run_{name}" for name in names]
    others = {"note": "hello", "cells": np.array([[1.0, "a"]], dtype=object), "complex": np.array([1j, 2.0])}
    for name in draw.sample(sorted(others), draw.randrange(3)):
        arrays[name] = others[name]
    units = ["1"] * len(names)
    return arrays, files.Truth(
        [one.astype(np.float64) for one in values], units, signals.interval, start, names
    )


def _as(kind: str, values: files.Floats) -> Any:
    if kind[0] == "f":
        return values.astype(kind)
    limits = np.iinfo(kind)
    return np.clip(np.round(values / np.abs(values).max() * 200.0), limits.min, limits.max).astype(kind)


def _odd_element(draw: random.Random, depth: int = 0) -> bytes:
    """Return an array with some odd class, size, name or number."""
    count = draw.choice((0, 1, 2, 5))
    dims = [
        files.bounded(files.number(draw, count, 1, 1), 32, signed=True)
        for _ in range(draw.choice((2, 2, 2, 1, 3, 0)))
    ]
    kind = files.bounded(files.number(draw, 6, 6, 2, 1, 4, 5, 3, 9, 15, 17), 8)
    name = files.word(draw, "t", "a", "base", "fs")
    if kind in (1, 2) and depth < 3:
        inner = b"".join(_odd_element(draw, depth + 1) for _ in range(count))
        fields = raw.mat_fields([files.word(draw, "a", "t")[:31] for _ in range(count)]) if kind == 2 else b""
        content = fields + inner
    else:
        numbers = np.array([draw.choice(files.FRACTIONS) for _ in range(count)])
        size = None if draw.random() < 0.9 else files.bounded(files.number(draw), 32)
        content = raw.mat_element(
            files.bounded(files.number(draw, 9, 9, 1, 7, 14, 15, 16), 32), numbers.tobytes(), size
        )
    return raw.mat_array(name, content, dims, kind=kind, flags=files.number(draw, 0, 0, 8) & 0xFF)


def _odd_matrix(draw: random.Random) -> bytes:
    """Return a matrix of version 4 with a partly odd header."""
    count = draw.choice((0, 1, 5))
    kind = files.bounded(files.number(draw, 0, 0, 10, 20, 1, 2, 1000), 32, signed=True)
    rows, columns = (files.bounded(files.number(draw, usual), 32, signed=True) for usual in (count, 1))
    values = np.arange(float(count)).tobytes()
    name = files.word(draw, "t", "a").encode("utf-8", "replace")
    length = None if draw.random() < 0.9 else files.bounded(files.number(draw), 32, signed=True)
    return raw.mat4_matrix(
        name, values, rows, columns, kind=kind, complex_=draw.choice((0, 0, 0, 1)), length=length
    )


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path("record.mat"), draw.random()
    if kind < 0.3:
        path.write_bytes(raw.MAT_HEAD + b"".join(_odd_element(draw) for _ in range(draw.randint(1, 4))))
        return files.odd(path, crashes=True)
    if kind < 0.4:
        path.write_bytes(b"".join(_odd_matrix(draw) for _ in range(draw.randint(1, 4))))
        return files.odd(path, crashes=True)
    arrays, truth = drawn_variables(draw)
    is_old = draw.random() < 0.2 and "run" not in arrays and "cells" not in arrays
    is_packed = not is_old and draw.random() < 0.5
    if not is_old and draw.random() < 0.1:
        arrays["sparse"] = coo_matrix(np.eye(3))
    savemat(path, arrays, format="4" if is_old else "5", do_compression=is_packed, oned_as="column")
    if kind < 0.8:
        return files.sound(path, truth)
    content = path.read_bytes()
    # each packed variable ends with an Adler-32
    path.write_bytes(_flipped_inside(draw, content) if is_packed else files.damaged(draw, content))
    return files.odd(path, equal=truth if is_packed else None, crashes=True)


def _flipped_inside(draw: random.Random, content: bytes) -> bytes:
    """Return a file of packed variables with bits flipped within them, not in the sizes between them."""
    changed, place, inside = bytearray(content), 128, []
    while place + 8 <= len(content):
        (size,) = struct.unpack_from("<I", content, place + 4)
        inside += range(place + 8, min(place + 8 + size, len(content)))
        place += 8 + size
    for at in draw.sample(inside, draw.choice((1, 1, 2, 5))):
        changed[at] ^= 1 << draw.randrange(8)
    return bytes(changed)
