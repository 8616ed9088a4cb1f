"""WAV files of drawn types, orders and chunks: read equal; with odd sizes and fields: read or refused."""

from __future__ import annotations

import random
import struct
from pathlib import Path

import numpy as np
from support import raw_files as raw

from soak import _drawn_files as files

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

BITS = {8: "u1", 16: "i2", 24: "i3", 32: "i4", 64: "i8"}
FLOATS = {32: "f4", 64: "f8"}
EXTENSIBLE = 0xFFFE
GUID = b"\x00\x00\x00\x00\x10\x00\x80\x00\x00\xaa\x00\x38\x9b\x71"
OTHERS = (b"LIST", b"fact", b"bext", b"JUNK", b"cue ", b"id3 ", b"PAD ")


def _sound(draw: random.Random) -> tuple[bytes, files.Truth]:
    """Return a file and its expected reading: integers as parts of full scale."""
    many, count, rate = (
        draw.randint(1, 4),
        draw.randint(12, files.LONGEST_FILE),
        draw.choice((100, 1000, 44_100, 51_200)),
    )
    kind = draw.choice((b"RIFF", b"RIFF", b"RIFX"))
    order = ">" if kind == b"RIFX" else "<"
    is_float = draw.random() < 0.3
    bits = draw.choice(list(FLOATS if is_float else BITS))
    noise = np.stack([files.drawn_values(draw, count) for _ in range(many)], axis=1)
    if is_float:
        samples = noise.astype(f"{order}{FLOATS[bits]}")
        data, values = samples.tobytes(), samples.astype(np.float64)
    else:
        data, values = _whole(noise / np.abs(noise).max(), bits, order)
    chunks = [
        _format(draw, many, rate, bits, is_float=is_float, order=order),
        *(
            raw.wav_chunk(draw.choice(OTHERS), bytes(draw.randrange(9)), order=order)
            for _ in range(draw.choice((0, 0, 1, 3)))
        ),
        raw.wav_chunk(b"data", data, order=order),
        *(raw.wav_chunk(b"LIST", b"after", order=order) for _ in range(draw.choice((0, 0, 1)))),
    ]
    names = [f"channel_{at + 1}" for at in range(many)]
    truth = files.Truth(list(values.T), ["1"] * many, 1.0 / rate, 0.0, names)
    return raw.wav_file(chunks, kind), truth


def _whole(parts: files.Floats, bits: int, order: str) -> tuple[bytes, files.Floats]:
    """Return samples of `bits` bits, and their values as parts of full scale."""
    scale = 2.0 ** (bits - 1)
    numbers = np.clip(np.round(parts * min(scale, 2.0**52)), -scale, min(scale - 1, 2.0**52)).astype(np.int64)
    if bits == 8:
        return (numbers + 128).astype("u1").tobytes(), numbers / scale
    width = bits // 8
    content = b"".join(
        int(one).to_bytes(width, "big" if order == ">" else "little", signed=True) for one in numbers.ravel()
    )
    return content, numbers.astype(np.float64) / scale


def _format(draw: random.Random, many: int, rate: int, bits: int, *, is_float: bool, order: str) -> bytes:
    tag = 3 if is_float else 1
    if order == "<" and draw.random() < 0.3:
        more = struct.pack("<HHIH", 22, bits, 0, tag) + GUID
        return raw.wav_format(many, rate, bits, tag=EXTENSIBLE, order=order, more=more)
    return raw.wav_format(many, rate, bits, tag=tag, order=order)


def _odd(draw: random.Random) -> bytes:
    """Return chunks with some odd sizes and fields."""

    def whole(bits: int, *usual: int) -> int:
        return draw.choice(usual) if draw.random() < 0.85 else files.bounded(files.number(draw), bits)

    chunks = []
    for _ in range(draw.choice((2, 2, 3, 6))):
        name = draw.choice((b"fmt ", b"fmt ", b"data", b"data", b"ds64", b"LIST", b"\x00\x00\x00\x00"))
        if name == b"fmt ":
            more = bytes(draw.choice((0, 0, 2, 24)))
            chunks.append(
                raw.wav_format(
                    whole(16, 1, 2),
                    whole(32, 1000),
                    whole(16, 16, 24, 32),
                    tag=whole(16, 1, 3, EXTENSIBLE, 2, 17),
                    frame=whole(16, 2, 4),
                    more=more,
                )
            )
            continue
        content = draw.randbytes(draw.choice((0, 1, 7, 64, 400)))
        chunks.append(raw.wav_chunk(name, content, None if draw.random() < 0.8 else whole(32, len(content))))
    kind = draw.choice((b"RIFF", b"RIFF", b"RIFX", b"RF64"))
    return raw.wav_file(chunks, kind, None if draw.random() < 0.8 else whole(32, 36))


def check(seed: int) -> str | None:
    """Read one file."""
    draw = random.Random(seed)
    path, kind = Path("record.wav"), draw.random()
    if kind < 0.35:
        path.write_bytes(_odd(draw))
        return files.odd(path)
    content, truth = _sound(draw)
    path.write_bytes(content if kind < 0.75 else files.damaged(draw, content))
    return files.sound(path, truth) if kind < 0.75 else files.odd(path)
