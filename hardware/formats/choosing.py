"""Chooses the reader of a file: the first bytes decide, not the ending of the name."""

from __future__ import annotations

import stat
from dataclasses import replace
from pathlib import Path

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.fmus.file_names import refuse_no_text
from vibroimpact.hardware.formats.arrow import SIGNATURES as ARROW
from vibroimpact.hardware.formats.arrow import read_arrow
from vibroimpact.hardware.formats.foreign_netcdf import read_foreign_netcdf
from vibroimpact.hardware.formats.hdf5 import SIGNATURE as HDF5
from vibroimpact.hardware.formats.hdf5 import is_h5py_there, is_netcdf4, read_hdf5
from vibroimpact.hardware.formats.labview import SIGNATURE, read_labview
from vibroimpact.hardware.formats.mat import read_mat
from vibroimpact.hardware.formats.other_formats import refuse_other_format
from vibroimpact.hardware.formats.probe import UnreadableError, check_reads, missing_extra
from vibroimpact.hardware.formats.table import LARGEST_FILE, RawFile
from vibroimpact.hardware.formats.tdms import read_tdms
from vibroimpact.hardware.formats.text import read_text
from vibroimpact.hardware.formats.uff import is_uff, read_uff
from vibroimpact.hardware.formats.wav import SIGNATURES as WAV
from vibroimpact.hardware.formats.wav import read_wav

_NETCDF3 = (b"CDF\x01", b"CDF\x02")
_NETCDF_64_BIT = b"CDF\x05"
_WORDS_OF_NETCDF = (b"_NCProperties", b"DIMENSION_SCALE", b"vibroimpact SHA-256")
"""Words of a NetCDF library or this program, one of which its HDF5 files hold; HDF5 writes attributes unchanged."""
_LONGEST_WORD = max(map(len, _WORDS_OF_NETCDF))
_STRETCH = 1 << 22
_OTHERS = {
    b"PK": "a zip archive or a spreadsheet (.xlsx, .ods)",
    b"\xd0\xcf\x11\xe0": "an old spreadsheet (.xls)",
    b"\x1f\x8b": "a gzip archive",
    b"%PDF": "a PDF",
    b"fLaC": "compressed audio (FLAC)",
    b"OggS": "compressed audio (Ogg)",
    b"\x93NUMPY": "an array of numpy (.npy)",
}


def check_file(path: Path) -> None:
    """Raise unless the path is a regular file of a readable size.

    Raises
    ------
    DatasetError
        There is no such file, or it cannot be read, is empty or too large.
    UsageError
        Its name is no text.
    """
    refuse_no_text(path)
    try:
        status = path.stat()
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or str(problem)
        raise DatasetError(f"expected a file to read, got none: {reason}.") from problem
    if not stat.S_ISREG(status.st_mode):
        raise DatasetError("expected a regular file, got something else. Name the file itself.")
    if status.st_size > LARGEST_FILE:
        raise DatasetError(
            f"expected at most {LARGEST_FILE} bytes, got {status.st_size}. Cut it into pieces."
        )
    if status.st_size == 0:
        raise DatasetError("expected a recording, got an empty file.")


def holds_recording(path: Path) -> bool:
    """Return whether a file is a recording of this program already.

    Raises
    ------
    DatasetError
        It looks like one, and crashes the library that reads it.
    """
    # recordings take half a second to load; the process for other formats does without them
    from vibroimpact.analysis.recording import is_recording

    with path.open("rb") as file:
        if file.read(len(HDF5)) != HDF5:
            return False
    if is_h5py_there() and not _has_word_of_netcdf(path):
        return False
    try:
        check_reads(path)
    except UnreadableError as problem:
        if problem.raised and is_h5py_there():
            return False  # HDF5 that is no NetCDF
        raise
    return is_recording(path)


def _has_word_of_netcdf(path: Path) -> bool:
    """Whether an HDF5 file may be NetCDF; the NetCDF library never gets any other."""
    with path.open("rb") as file:
        before = b""
        while stretch := file.read(_STRETCH):
            stretch = before + stretch
            if any(word in stretch for word in _WORDS_OF_NETCDF):
                return True
            before = stretch[-_LONGEST_WORD:]
    return False


def read_raw(path: Path, delimiter: str | None = "", decimal: str = "", dates: str = "") -> RawFile:
    """Return a file of a known format, checked by `check_file`; the other arguments are for `text.read_text`.

    DatasetError: the format is unknown, or the file is damaged.
    """
    with path.open("rb") as file:
        start = file.read(512)
    if start.startswith((b"TDSm", b"TDSh")):
        return read_tdms(path)
    if start.startswith(b"MATLAB 7.3"):
        return read_hdf5(path, matlab=True)
    if start.startswith(b"MATLAB 5.0") or (path.suffix.lower() == ".mat" and not start.startswith(HDF5)):
        return read_mat(path)
    if start.startswith(HDF5) and is_h5py_there() and not (_has_word_of_netcdf(path) and is_netcdf4(path)):
        return read_hdf5(path)
    if start.startswith(_NETCDF_64_BIT):
        raise DatasetError(
            "expected a NetCDF file of version 3 or 4, got CDF-5. Convert it: nccopy -k nc4 OLD NEW."
        )
    if start.startswith((HDF5, *_NETCDF3)):
        raw = read_foreign_netcdf(path)
        if start.startswith(HDF5) and not raw.tables and not is_h5py_there():
            raise missing_extra("an HDF5 file with groups", "h5py", "hdf5")
        return raw
    if is_uff(start):
        return read_uff(path)
    if start.startswith(WAV) and start[8:12] == b"WAVE":
        return read_wav(path.read_bytes())
    if start.startswith(ARROW):
        return read_arrow(path)
    for magic, kind in _OTHERS.items():
        if start.startswith(magic):
            raise DatasetError(f"expected a recording, got {kind}. Unpack it, or save it as text first.")
    refuse_other_format(start)
    content, remarks = _decoded(path.read_bytes())
    is_labview = content.startswith(SIGNATURE)
    raw = read_labview(content) if is_labview else read_text(content, delimiter, decimal, dates)
    return replace(raw, remarks=[*remarks, *raw.remarks])


def _decoded(content: bytes) -> tuple[str, list[str]]:
    """Return the text of a file, and remarks on its encoding."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            return content.decode("utf-16"), []
        except UnicodeDecodeError as problem:
            raise DatasetError("expected UTF-16 text as its first bytes say, got others.") from problem
    if b"\x00" in content:
        raise DatasetError(
            "expected TDMS, LabVIEW, MATLAB, NetCDF, HDF5, UFF, WAV, Parquet, Feather or a table of text, got other "
            "binary contents."
        )
    try:
        return content.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        return content.decode("latin-1"), [
            "the text is not UTF-8; it is read as Latin-1, its names may be wrong"
        ]
