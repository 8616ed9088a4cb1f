"""Tokens of binary recordings: samples, channels, segments, properties, chunks, names, depth."""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Mapping
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
from pyarrow import feather, parquet
from support import raw_files as raw
from support.direct_reading import imported_directly

from scaling._growth import Tokens
from vibroimpact.hardware.formats.choosing import read_raw
from vibroimpact.hardware.formats.universal import read_universal

Made = Callable[[int], bytes]
SIGNAL = np.array([0.5, 1.5, -0.5])
WAVE = {"wf_increment": 0.01, "unit_string": "g"}


def _tdms(
    properties: Mapping[str, object], values: object = SIGNAL, channels: int = 1, groups: int = 1
) -> bytes:
    made = [
        raw.tdms_channel(f"run {group}", f"base {at}", np.asarray(values), properties)
        for group in range(groups)
        for at in range(channels)
    ]
    return raw.tdms_segment([one for one, _ in made], b"".join(data for _, data in made))


def _tdms_texts(count: int) -> bytes:
    kind = struct.pack("<IIIQQ", 28, raw.TDMS_STRING, 1, count, 5 * count)
    data = np.arange(1, count + 1, dtype="<u4").tobytes() + b"x" * count
    return raw.tdms_segment([raw.TdmsObject("/'run'/'words'", kind)], data) + _tdms(WAVE)


TDMS: Mapping[str, Made] = {
    "samples": lambda n: _tdms(WAVE, np.arange(float(n))),
    "segments": lambda n: _tdms(WAVE) * n,
    "segments of other channels": lambda n: _tdms(WAVE) + _tdms(WAVE, channels=2) * n,
    "segments without metadata": lambda n: (
        _tdms(WAVE)
        + raw.tdms_segment([], SIGNAL.tobytes(), contents=0b1000, begin=0)[:28]
        + SIGNAL.tobytes() * n
    ),
    "channels": lambda n: _tdms(WAVE, channels=n),
    "groups": lambda n: _tdms(WAVE, groups=n),
    "groups without channels": lambda n: (
        raw.tdms_segment([raw.TdmsObject(f"/'group {at}'") for at in range(n)]) + _tdms(WAVE)
    ),
    "properties": lambda n: _tdms({**WAVE, **{f"key {at}": at for at in range(n)}}),
    "properties of texts": lambda n: _tdms({**WAVE, **{f"key {at}": "word" for at in range(n)}}),
    "letters of a property": lambda n: _tdms({**WAVE, "comment": "x" * n}),
    "letters of a unit": lambda n: _tdms({**WAVE, "unit_string": "m " * n}),
    "brackets of a unit": lambda n: _tdms({**WAVE, "unit_string": "(" * n}),
    "letters of a name": lambda n: raw.tdms_segment([raw.TdmsObject(f"/'run'/'{'x' * n}'")]) + _tdms(WAVE),
    "quotes of a name": lambda n: (
        raw.tdms_segment([raw.TdmsObject("/'run'/'" + "''" * n + "'")]) + _tdms(WAVE)
    ),
    "texts": _tdms_texts,
}


def _mat(*arrays: bytes) -> bytes:
    return raw.MAT_HEAD + b"".join(arrays)


def _vector(name: str, count: int = 3) -> bytes:
    return raw.mat_array(name, raw.mat_doubles(range(count)), (count, 1))


def _nested(depth: int) -> bytes:
    inner = _vector("")
    for _ in range(depth):
        inner = raw.mat_array("", raw.mat_fields(["a"]) + inner, (1, 1), kind=2)
    return inner


MATLAB: Mapping[str, Made] = {
    "numbers": lambda n: _mat(_vector("t", n), _vector("a", n)),
    "variables": lambda n: _mat(_vector("t"), *(_vector(f"a{at}") for at in range(n))),
    "fields": lambda n: _mat(
        raw.mat_array(
            "s",
            raw.mat_fields([f"f{at}" for at in range(n)]) + b"".join(_vector("") for _ in range(n)),
            (1, 1),
            kind=2,
        )
    ),
    "structures in structures": lambda n: _mat(_vector("t"), _nested(min(n, 400))),
    "cells": lambda n: _mat(
        _vector("t"), raw.mat_array("c", b"".join(_vector("") for _ in range(n)), (n, 1), kind=1)
    ),
    "letters": lambda n: _mat(
        _vector("t"), raw.mat_array("c", raw.mat_element(4, b"x\0" * n), (1, n), kind=4)
    ),
    "letters of a name": lambda n: _mat(_vector("t"), _vector("x" * n)),
    "columns": lambda n: _mat(_vector("t"), raw.mat_array("a", raw.mat_doubles(range(4 * n)), (4, n))),
    "dimensions": lambda n: _mat(
        _vector("t"), raw.mat_array("a", raw.mat_doubles([1.0]), (1,) * min(n, 10_000))
    ),
    "matrices of version 4": lambda n: b"".join(
        raw.mat4_matrix(b"a%d" % at, SIGNAL.tobytes(), 3, 1) for at in range(n)
    ),
}


def _hdf5(fill: Callable[[h5py.File], object]) -> bytes:
    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file["t"] = np.arange(3.0)
        fill(file)
    return content.getvalue()


def _datasets(count: int) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        for at in range(count):
            file[f"a{at}"] = SIGNAL

    return fill


def _words(count: int) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        for at in range(count):
            file[f"a{at}"] = b"word"

    return fill


def _groups(count: int) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        for at in range(count):
            file[f"group {at}/a"] = SIGNAL

    return fill


def _links(count: int) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        for at in range(count):
            file[f"a{at}"] = h5py.SoftLink("/t")

    return fill


def _attributes(count: int) -> Callable[[h5py.File], object]:
    def fill(file: h5py.File) -> None:
        for at in range(count):
            file["t"].attrs[f"key {at}"] = at

    return fill


HDF5: Mapping[str, Made] = {
    "numbers": lambda n: _hdf5(lambda file: file.create_dataset("a", data=np.arange(float(n)))),
    "columns": lambda n: _hdf5(lambda file: file.create_dataset("a", data=np.zeros((4, n)))),
    "datasets": lambda n: _hdf5(_datasets(n)),
    "datasets of words": lambda n: _hdf5(_words(n)),
    "groups": lambda n: _hdf5(_groups(n)),
    "groups in groups": lambda n: _hdf5(lambda file: file.create_group("/".join("g" * min(n, 3000)))),
    "links": lambda n: _hdf5(_links(n)),
    "attributes": lambda n: _hdf5(_attributes(n)),
    "letters of a unit": lambda n: _hdf5(lambda file: file["t"].attrs.create("units", "m " * min(n, 30_000))),
}


def _cdf(count: int = 3, *, more: list[bytes] | None = None, dims: int = 0, attributes: int = 0) -> bytes:
    """Return a file with instants and a channel; further variables share the data."""
    lengths = [raw.cdf_name("time") + struct.pack(">i", count)]
    lengths += [raw.cdf_name(f"d{at}") + struct.pack(">i", 1) for at in range(dims)]
    known = [raw.cdf_text(f"key{at}", "word") for at in range(attributes)]
    units = [raw.cdf_text("units", "s")]
    variables = [
        raw.cdf_variable("time", [0], units, 6, 8 * count, 0),
        raw.cdf_variable("a", [0], [], 6, 8 * count, 0),
        *(more or []),
    ]
    begin = len(raw.cdf_file(lengths, known, variables))
    placed = [one[:-4] + struct.pack(">i", begin) for one in variables]
    return raw.cdf_file(lengths, known, placed, np.arange(float(count)).astype(">f8").tobytes())


NETCDF: Mapping[str, Made] = {
    "numbers": _cdf,
    "variables": lambda n: _cdf(more=[raw.cdf_variable(f"v{at}", [0], [], 6, 24, 0) for at in range(n)]),
    "dimensions": lambda n: _cdf(dims=n),
    "attributes": lambda n: _cdf(attributes=n),
    "attributes of a variable": lambda n: _cdf(
        more=[raw.cdf_variable("v", [0], [raw.cdf_text(f"k{at}", "word") for at in range(n)], 6, 24, 0)]
    ),
    "letters of a unit": lambda n: _cdf(
        more=[raw.cdf_variable("v", [0], [raw.cdf_text("units", "m " * n)], 6, 24, 0)]
    ),
    "letters since": lambda n: _cdf(
        more=[raw.cdf_variable("v", [0], [raw.cdf_text("units", "s since " * n)], 6, 24, 0)]
    ),
}


def _wav(chunks: list[bytes], channels: int = 1, samples: int = 3) -> bytes:
    data = np.zeros(samples * channels, dtype="<i2").tobytes()
    return raw.wav_file([raw.wav_format(channels, 1000, 16), *chunks, raw.wav_chunk(b"data", data)])


WAV: Mapping[str, Made] = {
    "samples": lambda n: _wav([], samples=n),
    "channels": lambda n: _wav([], channels=min(n, 32_000)),
    "chunks": lambda n: _wav([raw.wav_chunk(b"note", b"")] * n),
    "bytes of a chunk": lambda n: _wav([raw.wav_chunk(b"note", bytes(n))]),
    "bytes after the samples": lambda n: _wav([]) + bytes(n),
}


def _uff(count: int, *, apart: bool = False) -> bytes:
    return "".join(
        raw.uff_function(
            f"base {at}",
            [f"{at + 1}.5", "1.5", "2.5", "2.5"] if apart else ["1.5", "2.5", "3.5"],
            count="2" if apart else None,
            spacing="0" if apart else "1",
        )
        for at in range(count)
    ).encode()


def _with_uff(text: str) -> bytes:
    return text.encode() + _uff(1)


NODE = "         0         0         0  1.00000e+00  2.00000e+00  3.00000e+00"
UNIVERSAL: Mapping[str, Made] = {
    "numbers": lambda n: raw.uff_function("base", ["1.5"] * n).encode(),
    "functions": _uff,
    "functions with instants": lambda n: _uff(n, apart=True),
    "other datasets": lambda n: _with_uff(raw.uff_set("151", ["NONE"] * 7) * n),
    "empty lines": lambda n: _with_uff("\n" * n),
    "edges": lambda n: _with_uff(raw.UFF_EDGE * (2 * n)),
    "lines of a dataset": lambda n: _with_uff(raw.uff_set("151", ["a line"] * n)),
    "letters of a line": lambda n: _with_uff(raw.uff_set("151", ["x" * n])),
    "letters of a name": lambda n: raw.uff_function("x" * n, ["1.5"] * 4).encode(),
    "letters of a unit": lambda n: raw.uff_function("base", ["1.5"] * 4, unit="m " * n).encode(),
    "blanks among numbers": lambda n: (
        raw.uff_function("base", ["1.5"] * 4).replace("1.5\n", "1.5" + " " * n + "\n").encode()
    ),
    "nodes": lambda n: _with_uff(raw.uff_set("15", [f"{at:>10}{NODE}" for at in range(n)])),
}


def _table(kind: str, table: pa.Table, **options: int) -> bytes:
    content = io.BytesIO()
    if kind == "parquet":
        parquet.write_table(table, content, **options)
    else:
        feather.write_feather(table, content, **({"chunksize": options["row_group_size"]} if options else {}))
    return content.getvalue()


def _arrow(kind: str) -> dict[str, Made]:
    return {
        "numbers": lambda n: _table(kind, pa.table({"t": np.arange(float(n)), "a": np.arange(float(n))})),
        "columns": lambda n: _table(kind, pa.table({f"a{at}": [1.5, 2.5] for at in range(n)})),
        "columns of one name": lambda n: _table(
            kind, pa.Table.from_arrays([pa.array([1.5])] * n, names=["a"] * n)
        ),
        "columns of words": lambda n: _table(kind, pa.table({f"a{at}": ["x"] for at in range(n)})),
        "row groups": lambda n: _table(
            kind, pa.table({"t": np.arange(float(n)), "a": np.arange(float(n))}), row_group_size=1
        ),
        "metadata": lambda n: _table(
            kind,
            pa.table({"t": [0.5, 1.5], "a": [1.5, 2.5]}).replace_schema_metadata(
                {f"k{at}": "v" for at in range(n)}
            ),
        ),
        "letters of a name": lambda n: _table(
            kind, pa.table({"t": [0.5, 1.5], "a (" + "m " * n: [1.5, 2.5]})
        ),
        "words": lambda n: _table(kind, pa.table({"t": np.arange(float(n)), "w": ["word"] * n})),
    }


READERS: Mapping[str, tuple[str, Mapping[str, Made]]] = {
    "TDMS": ("tokens.tdms", TDMS),
    "MATLAB": ("tokens.mat", MATLAB),
    "HDF5": ("tokens.h5", HDF5),
    "NetCDF": ("tokens.nc", NETCDF),
    "WAV": ("tokens.wav", WAV),
    "UFF": ("tokens.uff", UNIVERSAL),
    "Parquet": ("tokens.parquet", _arrow("parquet")),
    "Feather": ("tokens.feather", _arrow("feather")),
}


def _read(path: Path) -> object:
    return read_raw(path)


def all_tokens() -> list[Tokens]:
    """Return all kinds of tokens of binary recordings, for the readers alone and for whole imports."""
    found = [
        Tokens(parser, kind, make, _read, name)
        for parser, (name, made) in READERS.items()
        for kind, make in made.items()
    ]
    found += [
        Tokens(f"imported {parser}", kind, make, imported_directly, name)
        for parser, (name, made) in READERS.items()
        for kind, make in made.items()
    ]
    found += [Tokens("universal file", kind, make, read_universal) for kind, make in UNIVERSAL.items()]
    return found
