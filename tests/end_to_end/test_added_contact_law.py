"""A contact law is added to a copy of the checkout as in docs/contact_laws.md, in two files, and bodies feel it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.places import ROOT

from vibroimpact.analysis.dataset import open_dataset

FOLDERS = ("analysis", "door", "fmus", "hardware", "orchestrator", "service")
TABLE, MODELS = "fmus/native/core/contact/contact_law.c", "orchestrator/scene/models.py"
SCENE = """
[scene]
units = "nondimensional"
[body]
kind = "{kind}"
{numbers}
[[stop]]
law = "cubic"
position = 1.0
stiffness = 10.0
[record]
recorded_time = 6.0
time_series = {{ rate = 200, variables = ["displacement"] }}
[execution]
how = "{how}"
{exchange}
"""
OSCILLATOR = "mass = 1.0\nstiffness = 1.0\ndamping = 0.0\ndisplacement_start = -2.0"
CHAIN = "masses = [1.0]\nstiffnesses = [1.0]\ndampings = [0.0]\ndisplacement_start = [-2.0]"
#: Largest of 200 samples a time unit, by scipy's DOP853 at 1e-12; the motion turns at 1.6910580, with an energy of 2.
LARGEST_SAMPLE = 1.6910572632


def changed(path: Path, before: str, after: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert text.count(before) == 1, (path, before)
    path.write_text(text.replace(before, after), encoding="utf-8")


def follow_the_page(checkout: Path) -> None:
    """Add the law of the page to a checkout."""
    page = (ROOT / "docs" / "contact_laws.md").read_text(encoding="utf-8").split("## To add a law", 1)[1]
    row, model = re.findall(r"^```\w+\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    changed(checkout / TABLE, "};\n\n/* ---- what is asked", f"{row}}};\n\n/* ---- what is asked")
    own, union = model.rsplit("\n\n\n", 1)
    changed(checkout / MODELS, "\nStop = ", f"\n{own}\n\n\nStop = ")
    (before,) = re.findall(r"^Stop = .*$", (checkout / MODELS).read_text(encoding="utf-8"), re.MULTILINE)
    changed(checkout / MODELS, before, union.rstrip("\n"))


@pytest.mark.long
def test_a_law_added_as_the_page_says_is_felt_by_every_body(tmp_path: Path) -> None:
    checkout = tmp_path / "checkout"
    package = checkout / ".editable" / "vibroimpact"
    package.mkdir(parents=True)
    for folder in FOLDERS:
        shutil.copytree(
            ROOT / folder, checkout / folder, ignore=shutil.ignore_patterns("built", "__pycache__")
        )
        if folder != "door":
            (package / folder).symlink_to(checkout / folder)
    for module in (checkout / "door").glob("*.py"):
        (package / module.name).symlink_to(module)
    shutil.copy(ROOT / "LICENSE", checkout)
    follow_the_page(checkout)

    def python(*arguments: str) -> subprocess.CompletedProcess[str]:
        path = {"PYTHONPATH": str(package.parent)}
        command = [sys.executable, *arguments]
        return subprocess.run(
            command, env={**os.environ, **path}, cwd=tmp_path, capture_output=True, text=True
        )

    built = python("-m", "vibroimpact.fmus.packaging.build")
    assert built.returncode == 0, built.stderr
    command = "from vibroimpact.orchestrator.commands.cli import main; main()"
    for kind, numbers, how in (
        ("oscillator", OSCILLATOR, "fused"),
        ("oscillator", OSCILLATOR, "coupled"),
        ("chain", CHAIN, "fused"),
    ):
        scene, results = tmp_path / "cubic.toml", tmp_path / f"{kind}_{how}.nc"
        exchange = 'exchange = "iterated"\nmacro_step = 0.001' if how == "coupled" else ""
        scene.write_text(SCENE.format(kind=kind, numbers=numbers, how=how, exchange=exchange))
        ran = python("-c", command, "run", str(scene), "-o", str(results))
        assert ran.returncode == 0, ran.stderr
        with open_dataset(results) as dataset:
            largest = float(dataset.vibroimpact.samples().displacement.max())
        # a coupled stop takes steps
        assert abs(largest - LARGEST_SAMPLE) < (1e-9 if how == "fused" else 1e-5)
    walk = ROOT / "tests" / "unit" / "fmus" / "core" / "test_contact_laws.py"
    walked = python("-m", "pytest", "-v", "-p", "no:cacheprovider", str(walk))
    assert walked.returncode == 0, walked.stdout
    assert "integral_of_its_force[cubic" in walked.stdout
