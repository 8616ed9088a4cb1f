"""Unsupported formats are named, with a package that reads them; headers follow their documentation."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.recordings import import_recording


def sac(order: str) -> bytes:
    return struct.pack(f"{order}70f", *[-12345.0] * 70) + struct.pack(
        f"{order}40i", *[-12345] * 6, 6, *[-12345] * 33
    )


HEADERS = {
    "MDF 4|asammdf": b"MDF     4.10    amf 7.0 " + bytes(100),
    "SAC|obspy": sac("<"),
    " SAC|obspy": sac(">"),
    "miniSEED|obspy": b"000001D STA01  BHZNL" + bytes(40),
    " miniSEED|obspy": b"MS\x03\x04" + bytes(60),
    "SEG-Y|segyio": b"\xc3\x40\xf1\x40" + b"\x40" * 76 + b"\xc3" + bytes(3600),
    " SEG-Y|segyio": b"C 1 CLIENT".ljust(80) + b"C 2 LINE".ljust(80) + bytes(3600),
    "EDF or BDF|pyedflib": b"0       "
    + b"patient".ljust(160)
    + b"12.03.1910.11.12"
    + b"768".ljust(300)
    + bytes(9),
    "GSE2|obspy": b"WID2 2019/03/12 10:11:12.000 STA01 BHZ\n1\n2\n",
}


@pytest.mark.parametrize("named", sorted(HEADERS))
def test_a_format_that_is_not_read_is_named_with_its_package(named: str, tmp_path: Path) -> None:
    path = tmp_path / "record.dat"
    path.write_bytes(HEADERS[named])
    name, package = named.strip().split("|")
    with pytest.raises(
        DatasetError, match=f"got {name}. Read it with the package {package}, and save its channels"
    ):
        import_recording(path)


@pytest.mark.parametrize("start", ["C 1 of 2\n", "000001D AB\n", "0       1\n", "MDF of a lab\n"])
def test_a_text_that_begins_alike_is_a_text(start: str, tmp_path: Path) -> None:
    path = tmp_path / "record.csv"
    rows = [f"{0.1 * place:.1f},{place * place}" for place in range(40)]
    path.write_text("\n".join([start.strip(), "Time (s),x (N)", *rows]) + "\n")
    assert import_recording(path).channels["x"].values.size == 40
