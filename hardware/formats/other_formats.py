"""Formats of measurements that this package does not read, by their first bytes, each with a package that does."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from dataclasses import dataclass

from vibroimpact.fmus.errors import DatasetError

# sequence number, quality, a blank or NUL, then the station: the fixed header of miniSEED 2
_MINISEED = re.compile(rb"\d{6}[DRQM][ \x00][A-Z0-9 ]{5}", re.ASCII)
_EDF_START = re.compile(rb"\d\d\.\d\d\.\d\d\d\d\.\d\d\.\d\d")
"""Date and time of EDF, at their place in its header."""
_SAC_HEADER, _SAC_VERSION_AT = 308, 304
_SAC_VERSIONS = frozenset({6, 7})
_EBCDIC_CARD, _ASCII_CARD = b"\xc3\x40\xf1", re.compile(rb"C[ 0]1[ A-Z]")
_SEGY_CARD = 80
"""Bytes of a line of the textual header of SEG-Y, which has no line breaks."""


@dataclass(frozen=True, slots=True)
class OtherFormat:
    """A format: its name, a package that reads it, and a test of the first bytes."""

    name: str
    package: str
    begins: Callable[[bytes], bool]


def _is_sac(start: bytes) -> bool:
    """Whether the version in the header of SAC, in either byte order, is valid."""
    if len(start) < _SAC_HEADER or b"\x00" not in start:
        return False
    found = {struct.unpack_from(order, start, _SAC_VERSION_AT)[0] for order in ("<i", ">i")}
    return bool(found & _SAC_VERSIONS)


def _is_segy(start: bytes) -> bool:
    is_text = _ASCII_CARD.match(start) is not None and b"\n" not in start[: 2 * _SEGY_CARD]
    return start.startswith(_EBCDIC_CARD) or (is_text and start[_SEGY_CARD : _SEGY_CARD + 1] == b"C")


def _is_edf(start: bytes) -> bool:
    return (
        start.startswith((b"0       ", b"\xffBIOSEMI")) and _EDF_START.fullmatch(start[168:184]) is not None
    )


def _is_miniseed(start: bytes) -> bool:
    is_second = _MINISEED.match(start) is not None and b"\x00" in start
    return is_second or start.startswith(b"MS\x03")


OTHERS = (
    OtherFormat("MDF 4", "asammdf", lambda start: start.startswith((b"MDF     ", b"UnFinMF "))),
    OtherFormat("miniSEED", "obspy", _is_miniseed),
    OtherFormat("GSE2", "obspy", lambda start: start.startswith((b"WID2 ", b"BEGIN GSE"))),
    OtherFormat("SEG-2", "obspy", lambda start: start[:4] in (b"\x55\x3a\x01\x00", b"\x3a\x55\x00\x01")),
    OtherFormat("SAC", "obspy", _is_sac),
    OtherFormat("SEG-Y", "segyio", _is_segy),
    OtherFormat("EDF or BDF", "pyedflib", _is_edf),
)


def refuse_other_format(start: bytes) -> None:
    """Raise DatasetError, with the format and a package for it, if a file begins as an unsupported format.

    >>> refuse_other_format(b"# time, force")
    >>> [other.package for other in OTHERS if other.begins(b"MDF     4.10    ")]
    ['asammdf']
    """
    for other in OTHERS:
        if other.begins(start):
            raise DatasetError(
                f"expected a recording, got {other.name}. Read it with the package {other.package}, and save its "
                "channels as CSV or MAT."
            )
