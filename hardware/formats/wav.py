"""WAV files, read with scipy: integers of 8 to 64 bits as parts of full scale, floats unchanged."""

from __future__ import annotations

import io
import struct
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.hardware.formats.cells import column_of
from vibroimpact.hardware.formats.probe import one_refusal
from vibroimpact.hardware.formats.table import MOST_COLUMNS, MOST_SAMPLES, Column, RawFile, Table

SIGNATURES = (b"RIFF", b"RIFX", b"RF64")
# scipy's warnings on parts of a file without samples (names, comments), and on a cut file
_KNOWN_WORDS = ("Chunk (non-data) not understood", "Reached EOF prematurely", "Incomplete chunk ID")
_MOST_PARTS = 10_000
_CUT_OFF = "the file is cut off: it holds less samples than it declares, and what is there is read"


def read_wav(content: bytes) -> RawFile:
    """Return the content of a WAV file: a column for each channel.

    DatasetError: the file is damaged, compressed or empty.
    """
    from scipy.io import wavfile

    data = _samples_of(content)
    with one_refusal("a whole WAV file of plain samples"), warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        # an incomplete frame is dropped
        rate, samples = wavfile.read(io.BytesIO(content[: data.end] if data.is_cut else content))
    if samples.size > MOST_SAMPLES:
        raise DatasetError(
            f"expected at most {MOST_SAMPLES} samples, got {samples.size}. Cut it into pieces."
        )
    table = samples if samples.ndim == 2 else samples[:, np.newaxis]
    if not table.size or table.shape[1] > MOST_COLUMNS or not rate > 0:
        raise DatasetError(
            f"expected samples of 1 to {MOST_COLUMNS} channels at a rate above 0, got {len(table)} of "
            f"{table.shape[1]} at {rate} Hz."
        )
    heard = sorted({str(one.message) for one in warned if not str(one.message).startswith(_KNOWN_WORDS)})
    remarks = [f"scipy says: {line[:120]}" for line in heard]
    if table.dtype.kind != "f":
        remarks.append(
            message(
                "the samples are parts of full scale, which is 1 (",
                *(Argument("scale"), ", ", Argument("unit"), ")"),
            )
        )
    kind = f"{data.bits} bit{' float' if table.dtype.kind == 'f' else ''}"
    columns = [
        _column(table[:, place], f"channel {place + 1}", 1.0 / rate, data) for place in range(table.shape[1])
    ]
    return RawFile(f"WAV, {kind}", [Table(columns)], remarks, damage=_CUT_OFF if data.is_cut else "")


@dataclass(frozen=True, slots=True)
class _Samples:
    """The place of the samples: the byte after the last whole frame, bits of a sample, and whether it is cut."""

    end: int
    bits: int
    is_cut: bool


def _samples_of(content: bytes) -> _Samples:
    """Return the place of the samples; if they cannot be found, scipy reports the problem.

    DatasetError: more parts than any program writes.
    """
    order, place, frame, bits = (">" if content.startswith(b"RIFX") else "<"), 12, 0, 0
    found: _Samples | None = None
    for _ in range(_MOST_PARTS):
        if place + 8 > len(content):
            return found or _Samples(len(content), bits, False)
        name, size = struct.unpack_from(f"{order}4sI", content, place)
        place += 8
        if name == b"fmt " and place + 16 <= len(content):
            frame, bits = struct.unpack_from(f"{order}HH", content, place + 12)
        if name == b"data" and frame and found is None:
            if content.startswith(b"RF64"):
                (size,) = struct.unpack_from("<Q", content, 28)
            there = len(content) - place
            found = _Samples(place + there // frame * frame, bits, there < size)
        place += size + size % 2
    raise DatasetError(f"expected a WAV file of at most {_MOST_PARTS} parts, got more. It is damaged.")


def _column(samples: Any, label: str, interval: float, data: _Samples) -> Column:
    """Return one channel; integers as parts of full scale, with the ends of their range."""
    if samples.dtype.kind == "f":
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN
            return column_of(label, samples.astype(np.float64), interval=interval)
    limits = np.iinfo(samples.dtype)
    scale, middle = -float(limits.min), 0.0
    if samples.dtype.kind == "u":
        scale = middle = (limits.max + 1) / 2.0
    values = (samples.astype(np.float64) - middle) / scale
    # scipy writes samples of 24 bits into the upper ones of 32
    steps = 2.0 ** (min(data.bits, limits.bits) - 1)
    return Column(label, values, interval=interval, rails=(-1.0, 1.0 - 1.0 / steps))
