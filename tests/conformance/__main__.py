"""`make conformance NI_TESTS=path`: NI's own tests on the virtual rig, into docs/rig.md; exit code 1 if one fails.

`python -m conformance PATH [pytest's arguments]` runs some of them, and writes nothing.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path

from support.places import ROOT

from conformance._reasons import reason_not_run
from conformance._table import Outcome, failures, one_for_each, section, write_section
from conformance.plugin import ADDRESS, REPORT
from vibroimpact.hardware.virtual_rig.serving import served
from vibroimpact.hardware.virtual_rig.settings import read_rig

PAGE = ROOT / "docs" / "rig.md"
# A mass without a spring that stays 1 m from its place: input k has k + 1 V, as NI's tests expect
SCENE = """
[body]
kind = "oscillator"
mass = 1.0
stiffness = 0.0
displacement_start = 1.0

[sensor]
gain = 1.0

[exciter]
gain = 0.0

[record]
recorded_time = 1.0
"""
RIG = """
[rig]
scene = "still.toml"
device = "xseries"

[wiring]
ao0 = "exciter"
"""
WIRE = 'ai{place} = {{ signal = "sensor.displacement", amplification = {volts} }}\n'


def main() -> int:
    """Run NI's tests and print their outcomes."""
    given = sys.argv[1] if len(sys.argv) > 1 else ""
    checkout = Path(given)
    if not given or not (checkout / "tests" / "component" / "conftest.py").is_file():
        print(
            f"conformance: expected a checkout of ni/nidaqmx-python, got {given or 'none'}. Get one and say where it "
            "is: git clone https://github.com/ni/nidaqmx-python; make conformance NI_TESTS=nidaqmx-python",
            file=sys.stderr,
        )
        return 2
    chosen = sys.argv[2:]
    outcomes = one_for_each(_run(checkout, chosen or _files(checkout)))
    bad = failures(outcomes)
    text = section(outcomes, version("nidaqmx"), _commit(checkout))
    print(text)
    for each in bad:
        print(f"fails: {each.test}: {each.said}")
    if not outcomes:
        print("No test was run.", file=sys.stderr)
        return 1
    if not chosen:
        write_section(PAGE, text)
        print(f"The table is in {PAGE.relative_to(ROOT)}.")
    return 1 if bad else 0


def _files(checkout: Path) -> list[str]:
    found = sorted((checkout / "tests" / "component").rglob("test_*.py"))
    paths = [path.relative_to(checkout).as_posix() for path in found]
    return [path for path in paths if reason_not_run(path) is None]


def _commit(checkout: Path) -> str:
    command = ["git", "-C", str(checkout), "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() if done.returncode == 0 else "unknown"


def rig_in(folder: Path) -> Path:
    """Write the rig for NI's tests into a folder; return its file."""
    (folder / "still.toml").write_text(SCENE, encoding="utf-8")
    wires = "".join(WIRE.format(place=place, volts=place + 1.0) for place in range(8))
    file = folder / "rig.toml"
    file.write_text(RIG + wires, encoding="utf-8")
    return file


def _run(checkout: Path, chosen: list[str]) -> list[Outcome]:
    with tempfile.TemporaryDirectory() as folder:
        report = Path(folder) / "report"
        report.touch()
        with served(read_rig(rig_in(Path(folder)))) as server:
            port = server.address.rpartition(":")[2]
            changed = {ADDRESS: port, REPORT: str(report), "PYTHONPATH": str(ROOT / "tests")}
            command = [sys.executable, "-m", "pytest", "-p", "conformance.plugin", "-p", "no:cacheprovider"]
            command += ["-q", "--tb=no", "--no-summary", *chosen]
            subprocess.run(command, cwd=checkout, env=os.environ | changed, check=False)
        lines = report.read_text(encoding="utf-8").splitlines()
    return [Outcome(**json.loads(line)) for line in lines]


if __name__ == "__main__":
    sys.exit(main())
