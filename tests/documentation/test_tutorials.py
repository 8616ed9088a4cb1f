"""The tutorials run, cell by cell, and find the numbers that they promise."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.places import ROOT

Names = dict[str, Any]


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[str], tuple[Names, str]]:
    """Return a function that runs the cells of a page in a new folder: their names, and the printed lines."""
    monkeypatch.chdir(tmp_path)
    # an FMU of pythonfmu that another test loaded here brings its own copy, which builds FMUs without binaries
    monkeypatch.setattr(
        sys, "path", [place for place in sys.path if not Path(place, "slavemodule.txt").exists()]
    )
    for name in [name for name in sys.modules if name.partition(".")[0] == "pythonfmu"]:
        del sys.modules[name]
    monkeypatch.setenv("PATH", os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"])))

    def runner(page: str) -> tuple[Names, str]:
        text = (ROOT / "docs" / f"{page}.md").read_text(encoding="utf-8")
        cells = re.findall(r"^```\{code-cell\} python3\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
        assert len(cells) >= 8
        names: Names = {}
        for cell in cells:
            exec(compile(cell, f"docs/{page}.md", "exec"), names)
        return names, capsys.readouterr().out

    return runner


def test_the_tutorial_finds_what_it_promises(run: Callable[[str], tuple[Names, str]]) -> None:
    names, said = run("tutorial")
    assert "stop[1].restitution: expected 0 <= r <= 1, got 1.2" in said
    assert "sure of" in said
    assert "trajectory" in said.splitlines()[-7]
    assert names["livelier"].impact_velocity.mean() < names["impacts"].impact_velocity.mean()
    assert names["above"].impacts_per_period.mean("period").values.tolist() == [1.0, 0.0]
    assert all(abs(r.value - r.exact) <= r.grid_step for r in names["bifurcation_readings"](names["swept"]))
    found = names["found"].values["trajectory"]
    truth = {"restitution": 0.7, "damping_ratio": 0.1, "natural_frequency": 1.0, "stop_position": 1000.0}
    assert all(found[name].low <= value <= found[name].high for name, value in truth.items())


def test_a_measurement_becomes_a_model_with_the_numbers_of_its_plant(
    run: Callable[[str], tuple[Names, str]],
) -> None:
    names, said = run("tutorial_measurement")
    assert names["server"].returncode is not None
    # intervals of 95 %: a clock that begins elsewhere puts a number out of its interval now and then
    for name, true in names["truth"].items():
        assert names["found"].values["trajectory"][name].value == pytest.approx(true, rel=1e-3)
    assert "to be trusted" in said
    assert names["gain"] == pytest.approx(0.2, rel=5e-3)
    assert names["swept"].sizes["frequency"] == 141


def test_a_foreign_body_meets_a_stop_with_the_speed_of_its_energy(
    run: Callable[[str], tuple[Names, str]],
) -> None:
    names, _ = run("tutorial_fmu")
    impacts = names["impacts"]
    assert impacts.impact_velocity.values[0] == pytest.approx(names["speed"], rel=1e-4)
    assert impacts.impact_restitution.values == pytest.approx(names["restitution"], rel=5e-3)
    assert float(names["gap"].min()) > -2e-3
    assert len(names["hit"].vibroimpact.impacts().impact_time) == 3
