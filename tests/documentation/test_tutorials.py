"""The tutorials run, cell by cell, and find the numbers that they promise."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from support.places import EXAMPLES, ROOT

Names = dict[str, Any]


@pytest.fixture
def run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[[str], tuple[Names, str]]:
    """Return a function that runs the cells of a page in a new folder: their names, and the printed lines."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(EXAMPLES)
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


def test_a_bracket_of_finite_elements_hits_its_stop_and_its_residual_vector_makes_up_for_left_out_modes(
    run: Callable[[str], tuple[Names, str]],
) -> None:
    names, _ = run("tutorial_structure")
    found = names["found"]
    assert found.frequency.values[0] == pytest.approx(949.7605, abs=1e-3)  # CalculiX finds the same
    assert 0.6 * 0.0377 < found.effective_mass.values[0] < 0.0377  # kg, of a bracket of 37.7 g
    assert 0.1 < names["missing"] < 2.0
    assert names["impacts"].sizes["impact"] > 20
    assert names["swept"].displacement_range.max() < 2.0e-4


def test_the_modes_of_a_test_rattle_between_stops_and_lack_the_flexibility_of_higher_ones(
    run: Callable[[str], tuple[Names, str]],
) -> None:
    names, said = run("tutorial_measured_modes")
    assert "[8.54, 34.14, 76.83, 136.59] Hz" in said
    assert names["found"].shape.values == pytest.approx(names["model"].shape.values[:5, :4], abs=2e-5)
    assert 0.0 < names["lacking"] < 2.0
    assert names["impacts"].sizes["impact"] > 50
