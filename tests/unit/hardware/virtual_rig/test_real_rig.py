"""The conformance tests run on a board: tried on a virtual rig that is treated as one, without control."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from support.places import ROOT

from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig

FOLDER = "tests/unit/hardware/virtual_rig"
TABLE = [f"{FOLDER}/test_conformance.py", f"{FOLDER}/test_conformance_refusals.py"]
# a rig faster than real time waits for programs on any machine: nothing is too late on it
TOO_LATE = "not are_late and not too_late and not runs_empty and not written_over"


def test_the_table_passes_on_a_rig_that_is_only_known_by_its_address(tmp_path: Path) -> None:
    examples = ROOT / "examples" / "rig"
    text = (examples / "oscillator.toml").read_text(encoding="utf-8")
    scene = (examples / "oscillator_scene.toml").as_posix()
    board = text.replace("[rig]", '[rig]\nname = "Board7"\nspeed = 2.0').replace(
        "oscillator_scene.toml", scene
    )
    (tmp_path / "rig.toml").write_text(board, encoding="utf-8")
    with served(read_rig(tmp_path / "rig.toml")) as server:
        rig = f"grpc://{server.address}/Board7"
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-q",
            "-rs",
            "-p",
            "no:cacheprovider",
            *TABLE,
            "-k",
            TOO_LATE,
            "--real-rig",
            rig,
        ]
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    found = re.search(r"(\d+) passed, (\d+) skipped, 4 deselected", done.stdout)
    assert found is not None
    assert int(found[1]) >= 30
    assert re.search(rf"\[{found[2]}\].*: needs the control service of a virtual rig", done.stdout)
