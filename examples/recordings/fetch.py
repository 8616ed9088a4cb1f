"""Fetch the recordings of docs/recordings from the places where their makers keep them.

`python examples/recordings/fetch.py --list` shows them; it needs `pip install 'vibroimpact[recordings]'`. Each file
comes from one commit of its repository, and its SHA-256 is checked: it is the file that the pages describe. None is
part of this project; each has the licence named here.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

SERVER = "https://raw.githubusercontent.com"
#: Seconds without an answer after which a download is given up.
PATIENCE = 30.0


@dataclass(frozen=True)
class File:
    """One file: its name here, its path in the repository, the SHA-256 of its bytes."""

    name: str
    path: str
    sha256: str


@dataclass(frozen=True)
class Source:
    """Origin of a recording, and its licence."""

    repository: str
    commit: str
    licence: str
    files: tuple[File, ...]


_SHOCK = "data/dataset-1/data-1/PCB repeated shock trials"
_SMD = "Data/Board 3.4/HM_b04_100mO_#8_12in_16thflt_wR2841"
_SHAKER = "data/testset-B/amplitude _7"

SOURCES = {
    "board": Source(
        "High-Rate-SHM-Working-Group/Dataset-5-Extended-Impact-Testing",
        "1bbfcf17dfd78a09790aa092a5dc07e6a6bae628",
        "CC BY-SA 4.0",
        (
            File(
                "acc_base_a0.txt",
                f"{_SHOCK}/acc_base_a0.txt",
                "1f61b38efdf805105e793d1fcd86d6422caeab35dbeae1e36a81a0c1214472c8",
            ),
            File(
                "acc_base_a1.txt",
                f"{_SHOCK}/acc_base_a1.txt",
                "d54b74ff031cdff557fac2337e600b7d4efcff3b74a6d78529f63d2aaeb99602",
            ),
            File(
                "acc_pcb_a0.txt",
                f"{_SHOCK}/acc_pcb_a0.txt",
                "cb579e5dd25d5aa81625e9d1bd1ff2b860f8fcf41eb89e6d6ce0074236b12a08",
            ),
            File(
                "acc_pcb_a1.txt",
                f"{_SHOCK}/acc_pcb_a1.txt",
                "e34e8568560392f1a58aa4d69031f8964de3f837cf0887cfa7bda02e63fa7a07",
            ),
            File(
                "dataset2_Test_001.lvm",
                "data/dataset-2/data-1/Test_001.lvm",
                "42ffd07e9edff37ad32579f29971312283b1997927fb4e1e87cfec86e7802ee1",
            ),
        ),
    ),
    "package": Source(
        "High-Rate-SHM-Working-Group/"
        "Dataset-11-rectangular-electronic-SMD-assembly-under-repeated-5-kg-impacts",
        "364cb81e7ea5c570a6419182c70c9e2131bd4303",
        "CC0 1.0",
        (
            File(
                "board3.4_00.lvm",
                f"{_SMD}_00.lvm",
                "9bed25af22cee58917226c2725a883fa97375ce7e51121457159878eb9accb1d",
            ),
            File(
                "board3.4_05.lvm",
                f"{_SMD}_05.lvm",
                "35899ea3216d2ae1e2344ec7689a8708691487a3355d1106a92f8cc888a910c3",
            ),
        ),
    ),
    "shaker": Source(
        "High-Rate-SHM-Working-Group/Dataset-7-forced-vibration-and-shock",
        "81e7be7d522e9d52544f652a56454bdefd55197b",
        "CC BY-SA 4.0",
        (
            File(
                "amp7_impact0.0_vib0.5.lvm",
                f"{_SHAKER}/Impact_0.0/vibration_0.5.lvm",
                "5bccb00cb118eef0aede9f4b8c1cfb9065847852ff949df76c43d4b82ceb902c",
            ),
            File(
                "amp7_impact0.3_vib0.5.lvm",
                f"{_SHAKER}/Impact_0.3/vibration_0.5.lvm",
                "5e0f18a6e11585ac3db275613427fac065b9d2dc0d47e0b2fe077d1b87480914",
            ),
        ),
    ),
    "pendulum": Source(
        "unipi-physics-labs/lab1-notes",
        "935f5bbfb04280e1cbaeb6163ce46745fac9e93c",
        "CC BY-SA 4.0",
        (
            File(
                "pendolo_smorzato.txt",
                "macro/data/pendolo_smorzato.txt",
                "25cf6c0409c201d3e07b1be4bc72954d7382cf3923d2f4d79407c2af46fdcbd7",
            ),
        ),
    ),
    "retina": Source(
        "Mark-Kramer/Case-Studies-Python",
        "060e67e81096b900773e2166910c5f3aca6365f8",
        "MIT",
        (
            File(
                "08_spikes-1.mat",
                "matfiles/08_spikes-1.mat",
                "e473c797eeede9fa967d87f1a4dc8e0df001dacf3d1caebaad5c32a6e0605017",
            ),
            File(
                "08_spikes-2.mat",
                "matfiles/08_spikes-2.mat",
                "66e4ceb816436de5d824abdfbcf08c5296dea9116f94cacafe3615d5e4f05f8c",
            ),
        ),
    ),
    "bounces": Source(
        "echasnovski/curiosity-projects",
        "b64978a3d7cf41549946bb0ee2bef5535ca1ab5c",
        "MIT",
        (
            File(
                "ttd-world-record_beats.csv",
                "ttd-world-record/ttd-world-record_beats.csv",
                "b3055c3a627873efcfd506c2508d02b0d979b431f36929b5a1b5ba26392ef90b",
            ),
        ),
    ),
    "tdms": Source(
        "adamreeve/npTDMS",
        "824119ee0a99db33a8a442e38c8a4fd9a0d4f6de",
        "LGPL-3.0",
        (
            File(
                "raw1.tdms",
                "nptdms/test/data/raw1.tdms",
                "f4e33424abebe7863c369a936795924001a6f0e5886e5c26604cc9f52c1ea684",
            ),
            File(
                "big_endian.tdms",
                "nptdms/test/data/big_endian.tdms",
                "051833770eaa2f3a0cb4dce4c3a05f8559ffeda65b24d2d9b4ef7bef8f78ce6b",
            ),
        ),
    ),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Fetch the named recordings; return 0 if all of them are there, 1 if a download failed, 2 for misuse."""
    parser = argparse.ArgumentParser(
        description="Fetch recordings made in laboratories, each under its own licence."
    )
    parser.add_argument("names", nargs="*", metavar="NAME", help="recordings to fetch; none: all")
    parser.add_argument(
        "-o", "--output", type=Path, default=Path(), help="folder for the files; the current one by default"
    )
    parser.add_argument("--list", action="store_true", help="list the recordings, and fetch nothing")
    parser.add_argument("--server", default=SERVER, help="a mirror with the same paths")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.names if name not in SOURCES]
    if unknown:
        return _report(
            f"fetch.py: NAME: expected some of {', '.join(SOURCES)}, got {', '.join(unknown)}.", code=2
        )
    chosen = given.names or list(SOURCES)
    if given.list:
        for name in chosen:
            print(_described(name))
        return 0
    try:
        import pooch
    except ImportError:
        return _report(
            "fetch.py: expected the package pooch, got none. pip install 'vibroimpact[recordings]'", code=2
        )
    for file in (file for name in chosen for file in SOURCES[name].files):
        there = given.output / file.name
        if there.exists() and pooch.file_hash(str(there)) != file.sha256:
            return _report(
                f"{there}: expected the file that is fetched, or none, got another. Move it away.", code=2
            )
    downloader = pooch.HTTPDownloader(timeout=PATIENCE)
    pooch.get_logger().setLevel("WARNING")
    for name in chosen:
        source = SOURCES[name]
        for file in source.files:
            address = f"{given.server}/{source.repository}/{source.commit}/{quote(file.path)}"
            try:
                pooch.retrieve(
                    address, f"sha256:{file.sha256}", file.name, path=given.output, downloader=downloader
                )
            # OSError: requests and the disk raise it; ValueError: another SHA-256
            except (OSError, ValueError) as problem:
                return _report(
                    f"{address}: cannot be fetched as {given.output / file.name}: {_one_line(problem)}",
                    code=1,
                )
        print(_described(name))
    return 0


def _described(name: str) -> str:
    source = SOURCES[name]
    files = ", ".join(file.name for file in source.files)
    return f"{name}: {files}\n    {source.licence}, github.com/{source.repository} at {source.commit[:8]}"


def _one_line(problem: Exception) -> str:
    return " ".join(str(problem).split())


def _report(text: str, code: int) -> int:
    print(text, file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main())
