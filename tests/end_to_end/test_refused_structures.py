"""Matrices and modes that are none of a structure, by `check`, `run` and `modes`: one line, code 2, nothing written."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support.command_line import in_this_process
from support.matrix_files import market
from support.modes_files import netcdf

from vibroimpact.fmus.private_folder import CACHE_VARIABLE
from vibroimpact.orchestrator.structures import factors

SPRINGS = np.array([[2.0, -1.0], [-1.0, 2.0]])
MASSES = np.eye(2)
SOUND = {"k.mtx": market(SPRINGS), "m.mtx": market(MASSES), "names.csv": b"name\n1.z\n2.z\n"}
MATRICES = {"kind": "matrices", "stiffness": "k.mtx", "mass": "m.mtx", "freedoms": "names.csv", "modes": 2}
COMMAND = ("modes", "k.mtx", "--mass", "m.mtx", "--freedoms", "names.csv", "--modes", "2")
CURVED = {"kind": "modes", "file": "modes.nc"}


@dataclass(frozen=True)
class Refused:
    """Files of a body that is refused: those that differ from `SOUND`, keys of the body, and the command `modes`."""

    said: str
    files: Mapping[str, bytes] = field(default_factory=dict)
    body: Mapping[str, Any] = field(default_factory=lambda: MATRICES)
    command: tuple[str, ...] = COMMAND
    at: str = "body.2.z"
    """The point of a stop."""


def _complex() -> bytes:
    variables: dict[str, Any] = {
        "frequency": (("mode",), [3.0]),
        "point": (("point",), ["2.z", "1.z"]),
        "shape": (("point", "mode"), [[1.0], [0.0]]),
        "shape_imaginary": (("point", "mode"), [[0.0], [1.0]]),
    }
    return netcdf(variables)


LOOSE = {
    "k.mtx": market(np.array([[2.0, 0.0, 0.0], [0.0, 1.0, -1.0], [0.0, -1.0, 1.0]])),
    "m.mtx": market(np.diag([1.0, 0.0, 0.0])),
    "names.csv": b"name\n1.z\n2.z\n3.z\n",
}
"""Two unknowns without mass that only each other holds."""
GYROSCOPIC = market(np.array([[0.1, 0.3], [-0.3, 0.1]]))
DAMPED = MATRICES | {"damping": "c.mtx"}
OF_CSV = {"kind": "modes", "file": "modes.csv"}
CASES = {
    "matrices that do not fit": Refused("m.mtx: expected 2 unknowns", {"m.mtx": market(np.eye(3))}),
    "a table that does not fit": Refused(
        "names.csv: expected 2 degrees of freedom", {"names.csv": b"name\n1.z\n2.z\n3.z\n"}
    ),
    "a name twice": Refused(
        "names.csv: expected each degree of freedom once, got '2.z' again", {"names.csv": b"name\n2.z\n2.z\n"}
    ),
    "an indefinite mass": Refused("mass .*positive", {"m.mtx": market(np.array([[1.0, 2.0], [2.0, 1.0]]))}),
    "a negative mass": Refused("mass with a diagonal >= 0", {"m.mtx": market(np.diag([1.0, -1.0]))}),
    "an indefinite stiffness": Refused(
        "stiffness .*positive", {"k.mtx": market(np.array([[1.0, 2.0], [2.0, 1.0]]))}
    ),
    "a matrix that is not symmetric": Refused(
        "stiffness that is symmetric", {"k.mtx": market(SPRINGS + 0.5 * np.eye(2, k=1))}
    ),
    "gyroscopic terms": Refused(
        "gyroscopic", {"c.mtx": GYROSCOPIC}, DAMPED, (*COMMAND, "--damping", "c.mtx")
    ),
    "a structure without mass": Refused(
        "expected a mass matrix with numbers above 0", {"m.mtx": market(np.zeros((2, 2)))}
    ),
    "a motion without stiffness and mass": Refused("expected mass or stiffness for each motion", LOOSE),
    "a number that is not finite": Refused("finite", {"k.mtx": market(np.diag([1.0, np.inf]))}),
    "a file that ends early": Refused("k.mtx: ", {"k.mtx": SOUND["k.mtx"][:-8]}),
    "an empty file": Refused("k.mtx: expected a file", {"k.mtx": b""}),
    "a point at no degree of freedom": Refused(
        "9.z", {}, MATRICES | {"points": {"tip": "9.z"}}, (*COMMAND, "--point", "tip=9.z")
    ),
    "modes without a point": Refused(
        "point", {"modes.csv": b"frequency,1,2\n"}, OF_CSV, ("modes", "modes.csv")
    ),
    "modes far from real": Refused(
        "mode 1: .* real", {"modes.nc": _complex()}, CURVED, ("modes", "modes.nc")
    ),
    "modes that end early": Refused(
        "modes.csv: ", {"modes.csv": b"frequency,1,2\n2.z,1"}, OF_CSV, ("modes", "modes.csv")
    ),
}


def _write(case: Refused) -> None:
    for name, content in {**SOUND, **case.files}.items():
        Path(name).write_bytes(content)
    scene = {
        "body": case.body,
        "stop": [{"at": case.at, "position": 1e-3, "restitution": 0.7}],
        "record": {"recorded_time": 1.0},
    }
    Path("scene.toml").write_text(tomli_w.dumps(scene))


@pytest.mark.parametrize("name", CASES)
def test_a_structure_that_is_none_is_refused_in_a_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    case = CASES[name]
    _write(case)
    _refuse(case.said, case.command)


def test_factors_beyond_the_memory_are_refused_in_a_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path.parent / "cache"))
    monkeypatch.setattr(factors, "available_memory", lambda: 8)
    _write(Refused(""))
    _refuse("expected factors of the stiffness within the available memory", COMMAND)


def test_a_stop_at_a_point_without_a_shape_is_refused_by_its_key(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    _write(Refused("", {"modes.csv": b"frequency,1,2\n2.z,1,1\n"}, OF_CSV, at="body.gap"))
    _refuse(r"stop\[1\].at: expected a point with shapes: \"body.2.z\", got \"body.gap\"")


def _refuse(said: str, *commands: tuple[str, ...]) -> None:
    """Check that `check`, `run` and further commands refuse in a line, and write nothing."""
    before = {path: path.read_bytes() for path in Path().iterdir()}
    for arguments in (("check", "scene.toml"), ("run", "scene.toml", "-o", "out.nc"), *commands):
        done = in_this_process(*arguments)
        assert (done.returncode, done.stdout) == (2, ""), done.stderr
        assert re.fullmatch(f".*{said}.*\n", done.stderr), done.stderr
        assert {path: path.read_bytes() for path in Path().iterdir()} == before
