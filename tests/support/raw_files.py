"""Bytes of binary formats, written field by field, so that each field can hold anything."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

# ---- TDMS: National Instruments, "TDMS File Format Internal Structure" ----

TDMS_TYPES: Mapping[str, tuple[int, str]] = {
    "i1": (1, "<b"), "i2": (2, "<h"), "i4": (3, "<i"), "i8": (4, "<q"), "u1": (5, "<B"), "u2": (6, "<H"),
    "u4": (7, "<I"), "u8": (8, "<Q"), "f4": (9, "<f"), "f8": (10, "<d"), "b1": (0x21, "<?"),
}  # fmt: skip
TDMS_STRING, TDMS_TIME = 0x20, 0x44
NO_DATA = 0xFFFFFFFF


@dataclass(frozen=True)
class TdmsObject:
    """An object of a segment: its path, the index of its raw data as bytes, and its properties as (name, bytes)."""

    path: str
    index: bytes = struct.pack("<I", NO_DATA)
    properties: Sequence[tuple[str, bytes]] = ()


def tdms_text(text: str) -> bytes:
    """Return a text after its length."""
    content = text.encode("utf-8", "surrogatepass")
    return struct.pack("<I", len(content)) + content


def tdms_property(value: Any) -> bytes:
    """Return type and value of a property: a text, a truth value, a whole number of 32 bits or a double."""
    if isinstance(value, str):
        return struct.pack("<I", TDMS_STRING) + tdms_text(value)
    kind = "b1" if isinstance(value, bool) else "i4" if isinstance(value, int) else "f8"
    number, form = TDMS_TYPES[kind]
    return struct.pack("<I", number) + struct.pack(form, value)


def tdms_index(kind: int, count: int, dimension: int = 1, length: int = 20) -> bytes:
    """Return the index of raw data of `count` numbers."""
    return struct.pack("<IIIQ", length, kind, dimension, count)


def tdms_segment(
    objects: Sequence[TdmsObject],
    data: bytes = b"",
    *,
    contents: int = 0b1110,
    number: int | None = None,
    lead: bytes = b"TDSm",
    following: int | None = None,
    begin: int | None = None,
) -> bytes:
    """Return a segment; `number`, `following` and `begin` are the sizes that it declares."""
    parts = [struct.pack("<I", len(objects) if number is None else number)]
    for one in objects:
        parts += [tdms_text(one.path), one.index, struct.pack("<I", len(one.properties))]
        parts += [tdms_text(name) + value for name, value in one.properties]
    known = b"".join(parts)
    begin = len(known) if begin is None else begin
    following = len(known) + len(data) if following is None else following
    return lead + struct.pack("<IIQQ", contents, 4713, following, begin) + known + data


def tdms_channel(
    group: str, name: str, values: NDArray[Any], properties: Mapping[str, Any] = {}
) -> tuple[TdmsObject, bytes]:
    """Return a channel and its raw data."""
    kind, _ = TDMS_TYPES[values.dtype.str[1:]]
    given = [(key, tdms_property(value)) for key, value in properties.items()]
    path = f"/'{group}'/'{name}'"
    return TdmsObject(path, tdms_index(kind, len(values)), given), values.tobytes()


# ---- MATLAB, version 4 and 5: The MathWorks, "MAT-File Format" ----

MAT_HEAD = b"MATLAB 5.0 MAT-file, Created on: Thu Jul 30 10:00:00 2026".ljust(124) + b"\x00\x01IM"


def mat_element(kind: int, content: bytes, size: int | None = None) -> bytes:
    """Return a data element; `size` is its declared number of bytes."""
    head = struct.pack("<II", kind, len(content) if size is None else size)
    return head + content + bytes(-len(content) % 8)


def mat_array(name: str, content: bytes, dims: Sequence[int], *, kind: int = 6, flags: int = 0) -> bytes:
    """Return an array (kind 6: of doubles, 2: a structure, 1: of cells) whose elements are in `content`."""
    parts = (
        mat_element(6, struct.pack("<II", kind | flags << 8, 0)),
        mat_element(5, struct.pack(f"<{len(dims)}i", *dims)),
        mat_element(1, name.encode("latin-1", "replace")),
    )
    return mat_element(14, b"".join(parts) + content)


def mat_doubles(values: Iterable[float]) -> bytes:
    """Return the element of an array of doubles."""
    return mat_element(9, np.fromiter(values, dtype="<f8").tobytes())


def mat_fields(names: Sequence[str], length: int = 32) -> bytes:
    """Return the names of the fields of a structure; their contents follow."""
    written = b"".join(name.encode()[: length - 1].ljust(length, b"\0") for name in names)
    return mat_element(5, struct.pack("<i", length)) + mat_element(1, written)


def mat4_matrix(
    name: bytes,
    values: bytes,
    rows: int,
    columns: int,
    *,
    kind: int = 0,
    complex_: int = 0,
    length: int | None = None,
) -> bytes:
    """Return a matrix of version 4."""
    head = struct.pack("<5i", kind, rows, columns, complex_, len(name) + 1 if length is None else length)
    return head + name + b"\0" + values


# ---- NetCDF of the classic format: Unidata, "NetCDF Classic Format Specification" ----


def cdf_name(name: str, length: int | None = None) -> bytes:
    """Return a name; `length` is its declared number of bytes."""
    content = name.encode()
    return struct.pack(">i", len(content) if length is None else length) + content + bytes(-len(content) % 4)


def cdf_list(tag: int, items: Sequence[bytes], count: int | None = None) -> bytes:
    """Return a list of dimensions (10), variables (11) or attributes (12)."""
    if not items and count is None:
        return bytes(8)
    return struct.pack(">ii", tag, len(items) if count is None else count) + b"".join(items)


def cdf_text(name: str, text: str) -> bytes:
    """Return an attribute of text."""
    return cdf_name(name) + struct.pack(">i", 2) + cdf_name(text)


def cdf_variable(
    name: str, dims: Sequence[int], attributes: Sequence[bytes], kind: int, size: int, begin: int
) -> bytes:
    """Return the entry of a variable (kind 6: of doubles)."""
    places = struct.pack(f">i{len(dims)}i", len(dims), *dims)
    return cdf_name(name) + places + cdf_list(12, attributes) + struct.pack(">iii", kind, size, begin)


def cdf_file(
    dims: Sequence[bytes],
    attributes: Sequence[bytes],
    variables: Sequence[bytes],
    data: bytes = b"",
    records: int = 0,
) -> bytes:
    """Return a file; the variables give the positions of their data in it."""
    head = b"CDF\x01" + struct.pack(">i", records)
    return head + cdf_list(10, dims) + cdf_list(12, attributes) + cdf_list(11, variables) + data


# ---- WAV ----


def wav_chunk(name: bytes, content: bytes, size: int | None = None, order: str = "<") -> bytes:
    """Return a chunk; `size` is its declared number of bytes."""
    head = name + struct.pack(f"{order}I", len(content) if size is None else size)
    return head + content + bytes(len(content) % 2)


def wav_format(
    channels: int,
    rate: int,
    bits: int,
    *,
    tag: int = 1,
    order: str = "<",
    frame: int | None = None,
    more: bytes = b"",
) -> bytes:
    """Return the chunk with the format of the samples."""
    frame = channels * bits // 8 if frame is None else frame
    fields = struct.pack(f"{order}HHIIHH", tag, channels, rate, (rate * frame) & 0xFFFFFFFF, frame, bits)
    return wav_chunk(b"fmt ", fields + more, order=order)


def wav_file(chunks: Iterable[bytes], kind: bytes = b"RIFF", size: int | None = None) -> bytes:
    """Return a file of chunks."""
    content = b"WAVE" + b"".join(chunks)
    order = ">" if kind == b"RIFX" else "<"
    return kind + struct.pack(f"{order}I", len(content) if size is None else size) + content


# ---- Universal files ----

UFF_EDGE = "    -1\n"


def uff_set(number: str, lines: Iterable[str]) -> str:
    """Return a dataset."""
    return f"{UFF_EDGE}{number:>6}\n" + "".join(f"{line}\n" for line in lines) + UFF_EDGE


def uff_function(
    name: str,
    values: Sequence[str],
    *,
    kind: str = "1",
    data: str = "4",
    count: str | None = None,
    spacing: str = "1",
    start: str = "0.00000e+00",
    interval: str = "1.00000e-02",
    unit: str = "g",
    abscissa: str = "17",
) -> str:
    """Return a function (58) whose fields are texts; `values` are written four to a line, in 20 characters each."""
    lines = [f"{name:<80}", *["NONE".ljust(80)] * 4]
    lines += [f"{kind:>5}         0    0         0       NONE         1   3       NONE         0   0"]
    lines += [
        f"{data:>10}{len(values) if count is None else count:>10}{spacing:>10}{start:>13}{interval:>13}{'0.0':>13}"
    ]
    lines += [f"{abscissa:>10}    0    0    0 NONE                 {'s':<20}"]
    lines += [f"{'12':>10}    0    0    0 NONE                 {unit:<20}"]
    lines += [f"{'0':>10}    0    0    0 NONE                 {'NONE':<20}"] * 2
    lines += ["".join(f"{one:>20}" for one in values[at : at + 4]) for at in range(0, len(values), 4)]
    return uff_set("58", lines)
