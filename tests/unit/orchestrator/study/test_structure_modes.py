"""`vibroimpact modes` and `vi.modes`: chains have known modes, each file is read back, and each mistake is one line."""

from __future__ import annotations

import runpy
import shutil
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csc_array
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.figures.study.modes import _neighbours
from vibroimpact.orchestrator.structures.matrices import Matrices

MASSES = np.array([1.0, 2.0, 0.5, 1.0])
SPRINGS = np.array([40.0, 30.0, 20.0, 10.0])


def chain(springs: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return the stiffness of a chain whose first spring stands on the ground."""
    ends = np.append(springs[1:], 0.0)
    return np.diag(springs + ends) - np.diag(springs[1:], 1) - np.diag(springs[1:], -1)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with the matrices of a chain along x."""
    monkeypatch.chdir(tmp_path)
    np.savez("chain.npz", K=chain(SPRINGS), M=np.diag(MASSES))
    Path("freedoms.csv").write_text("name, x, y, z\n1.x, 0, 0, 0\n2.x, 1, 0, 0\n3.x, 2, 0, 0\n4.x, 3, 0, 0\n")
    return tmp_path


def test_all_modes_of_a_chain_have_its_mass_and_its_flexibility(folder: Path) -> None:
    found = vi.modes("chain.npz", freedoms="freedoms.csv", modes=4, base="x", damping_ratio=0.02)
    squares = np.linalg.eigvals(np.linalg.solve(np.diag(MASSES), chain(SPRINGS)))
    assert found.frequency.values == pytest.approx(np.sqrt(np.sort(squares.real)) / (2.0 * np.pi), rel=1e-12)
    assert float(found.effective_mass.sum()) == pytest.approx(MASSES.sum(), rel=1e-12)
    assert found.point.values.tolist() == ["1.x", "2.x", "3.x", "4.x"]
    assert (1.0 / found.point_mass).sum("mode").values == pytest.approx(1.0 / MASSES, rel=1e-12)
    assert found.flexibility.values == pytest.approx(np.cumsum(1.0 / SPRINGS), rel=1e-12)
    assert found.x.values.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert (found.damping_ratio == 0.02).all()
    assert vi.draw(found).axes[0].get_xlabel() == "x (m)"
    assert found.total_mass.sel(axis="x") == pytest.approx(MASSES.sum(), rel=1e-12)
    assert found.centre_of_mass.values == pytest.approx([MASSES @ np.arange(4) / MASSES.sum(), 0.0, 0.0])
    assert "error" not in found.attrs  # no point has a flexibility that could be wrong


def test_rayleigh_damping_adds_to_the_ratio(folder: Path) -> None:
    found = vi.modes(
        "chain.npz", freedoms="freedoms.csv", damping_ratio=0.02, rayleigh={"mass": 0.3, "stiffness": 1e-3}
    )
    angular = 2.0 * np.pi * found.frequency.values
    assert found.damping_ratio.values == pytest.approx(0.02 + 0.15 / angular + 5e-4 * angular, rel=1e-12)
    done = in_this_process("modes", "chain.npz", "--rayleigh", "{stiffness=1e-3}", "--point", "tip=4")
    assert done.returncode == 0, done.stderr
    assert "4.5 kg" not in done.stdout  # degrees of freedom without directions have no mass along one
    done = in_this_process("modes", "chain.npz", "--freedoms", "freedoms.csv", "--base", "x")
    assert "Mass that the matrices move: 4.5 kg along x, with its centre at (1.333, 0, 0) m" in done.stdout


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        (["--point", "tip=9.z"], "chain.npz: expected a degree of freedom such as"),
        (["--base", "q"], "chain.npz: expected a base direction that"),
        (["--modes", "65"], "chain.npz: expected 1 to 64 modes, got 65"),
        (["--damping-ratio", "-0.1"], "--damping-ratio: expected a damping ratio >= 0, got -0.1"),
        (["--rayleigh", "0.1"], "--rayleigh: expected a table such as {mass=0.1, stiffness=1e-5}, got '0.1'"),
        (["--rayleigh", "{mass=-1}"], "--rayleigh: expected {mass = .., stiffness = ..} of numbers >= 0"),
        (["--rayleigh", "{masses=1}"], "--rayleigh: expected {mass = .., stiffness = ..} of numbers >= 0"),
        (["-o", "m.uff", "--point", "tip=1"], "m.uff: expected points node.direction such as 12.z"),
    ],
)
def test_a_refusal_names_the_file_or_the_option(folder: Path, options: list[str], expected: str) -> None:
    done = in_this_process("modes", "chain.npz", *options)
    assert done.returncode == 2
    assert expected in done.stderr


def test_a_matrix_without_a_name_needs_the_file_of_the_mass(folder: Path) -> None:
    shutil.copy(EXAMPLES / "tube" / "stiffness.mtx", "k.mtx")
    for options, got in (([], "got none"), (["--mass", "m.mtx"], "got m.mtx, which is no file")):
        done = in_this_process("modes", "k.mtx", *options)
        assert done.returncode == 2
        assert f"--mass: expected the file of the mass matrix, {got}." in done.stderr


def test_a_scene_of_matrices_has_their_mass(folder: Path) -> None:
    done = in_this_process("modes", str(EXAMPLES / "bracket.toml"))
    assert "0.033493 kg along x, y, z, with its centre at (0.03344, 0.01, 0.002) m" in done.stdout


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(1.0, 1e4), min_size=3, max_size=7), st.data())
def test_a_residual_vector_makes_the_flexibility_of_its_point_exact(
    tmp_path_factory: pytest.TempPathFactory, springs: list[float], data: st.DataObject
) -> None:
    size = len(springs)
    path = tmp_path_factory.mktemp("chain") / "chain.npz"
    np.savez(path, K=chain(np.array(springs)), M=np.eye(size))
    at, count = data.draw(st.integers(1, size)), data.draw(st.integers(2, size))
    found = vi.modes(path, points={"p": str(at)}, modes=count).sel(point="p")
    exact = float(np.cumsum(1.0 / np.array(springs))[at - 1])
    assert float(found.flexibility) == pytest.approx(exact, rel=1e-9)
    assert float(found.flexibility_without) <= exact * (1.0 + 1e-9)
    bare = vi.modes(path, points={"p": str(at)}, modes=count, residual=False).sel(point="p")
    assert float(bare.flexibility) <= float(found.flexibility) * (1.0 + 1e-9)


@pytest.mark.parametrize("ending", ["toml", "csv", "nc", "uff"])
def test_written_modes_are_read_back_and_are_a_body(folder: Path, ending: str) -> None:
    points = {"1.x": "1.x", "4.x": "4.x"}
    made = vi.modes(
        "chain.npz", f"m.{ending}", freedoms="freedoms.csv", points=points, modes=3, damping_ratio=0.02
    )
    digits = 1e-5 if ending == "uff" else 1e-15
    found = vi.modes(f"m.{ending}")
    assert found.frequency.values == pytest.approx(made.frequency.values, rel=digits)
    at = found.sel(point=list(points)).shape.values
    assert at == pytest.approx(made.sel(point=list(points)).shape.values, rel=digits)
    if ending in ("nc", "uff"):
        assert found.sel(point=list(points)).x.values.tolist() == [0.0, 3.0]
    scene = {
        "body": [{"name": "b", "kind": "modes", "file": f"m.{ending}"}],
        "forcing": [{"at": "b.1.x", "amplitude": 1.0, "angular_frequency": 2.0}],
        "stop": [{"at": "b.4.x", "position": 1.0, "restitution": 0.5}],
        "record": {"recorded_periods": 1},
    }
    body = vi.modes(scene)
    assert body.frequency.values == pytest.approx(found.frequency.values, rel=1e-15)
    assert len(vi.draw(body).axes) == (
        1 if ending in ("toml", "nc") else 3
    )  # which says what is a residual vector


def test_the_command_prints_writes_and_draws(folder: Path) -> None:
    words = "modes", "chain.npz", "--freedoms", "freedoms.csv", "--modes", "3"
    points = "--point", "tip=4.x", "--point", 'gap={"4.x"=1, "1.x"=-1}'
    done = in_this_process(*words, *points, "--base", "x", "-o", "m.toml", "--figure", "m.png")
    assert (done.returncode, done.stderr) == (0, "")
    assert "at tip, kg" in done.stdout
    assert done.stdout.count("residual vector") == 3  # two modes, and the head of a column
    assert "relative error of" in done.stdout
    assert Path("m.png").stat().st_size > 1000
    again = in_this_process("modes", "m.toml", "-o", "m.csv")
    assert (again.returncode, again.stderr) == (0, "")
    assert Path("m.csv").read_text().splitlines()[-1].startswith("gap,")


def test_a_body_by_matrices_of_a_scene_is_drawn_over_the_places_of_its_nodes() -> None:
    found = vi.modes(EXAMPLES / "frame.toml")
    assert found.point.values[0] == "roof"
    assert found.sizes["point"] == 1 + 57
    assert found.attrs["residual_vectors"] == 1
    assert float(found.sel(point="roof").x) == 2.0
    assert len(vi.draw(found).axes) == 6
    changed = in_this_process("modes", EXAMPLES / "frame.toml", "--set", "body[1].modes=3")
    assert changed.returncode == 0
    rows = [line.split() for line in changed.stdout.splitlines() if "residual vector" in line]
    assert rows[0][0] == "3"


SCENE = """
[[body]]
name = "a"
kind = "modes"
frequencies = [1.0]
shapes = { p = [1.0] }
[[body]]
name = "b"
kind = "modes"
frequencies = [2.0]
shapes = { p = [1.0] }
[record]
recorded_time = 1.0
"""
WRONG = {
    "modes none.npz": "none.npz: expected",
    "modes chain.npz --modes many": "--modes: expected 1 to 64 or auto, got 'many'",
    "modes chain.npz --modes 65": "expected 1 to 64 modes, got 65",
    "modes chain.npz --point tip": "--point: expected NAME=FREEDOM",
    "modes chain.npz --point tip=1 --point tip=2": "got 'tip' again",
    "modes chain.npz --point tip=9": "got '9'",
    "modes chain.npz --point tip={1=nan,": "--point: expected weights",
    "modes chain.npz --point t/p=1": "--point: expected a name",
    "modes chain.npz --stiffness KK": "chain.npz: expected",
    "modes chain.npz --body a": "--body: expected a scene with it",
    "modes chain.npz --set body.modes=3": "--set: expected a scene with it",
    "modes chain.npz --base w": "expected a base direction",
    "modes chain.npz -o m.txt": "m.txt: expected a name ending in .toml, .csv, .uff, .unv, .nc, got '.txt'",
    "modes chain.npz -o chain.npz": "chain.npz: expected a name ending",
    "modes chain.npz -o there.toml": "there.toml: expected a new file",
    "modes chain.npz -o m.uff": "expected points node.direction",
    "modes there.toml --modes 3": "--modes: expected none beside a file of modes",
    "modes scene.toml": "scene.toml: expected one body, got a, b. Name it: --body",
    "modes scene.toml --body c": "--body: expected one of a, b, got 'c'",
    "modes scene.toml --body a --mass m.mtx": "--mass: expected none beside a scene",
    "modes oscillator.toml": "oscillator.toml: expected a body by matrices or modes, got none",
}


@pytest.mark.parametrize("words", WRONG)
def test_a_mistake_is_one_line_and_writes_nothing(folder: Path, words: str) -> None:
    Path("there.toml").write_text("frequencies = [1.0]\nshapes = { p = [1.0] }\n")
    Path("scene.toml").write_text(SCENE)
    shutil.copy(EXAMPLES / "single_run.toml", "oscillator.toml")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    done = in_this_process(*words.split())
    assert (done.returncode, done.stdout.count("written")) == (2, 0)
    assert WRONG[words] in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_degrees_of_freedom_within_an_element_follow_no_base_and_are_not_drawn() -> None:
    places = np.array([[0.0, 0.0, 0.0], [np.nan] * 3])
    inner = Matrices(csc_array(np.eye(2)), csc_array(np.eye(2)), None, ("1.z", "2.z"), places)
    assert inner.rigid("z").tolist() == [1.0, 0.0]
    assert inner.spread(8) == ("1.z",)


def test_a_large_model_shows_nodes_spread_over_all_of_it() -> None:
    names = tuple(f"{node}.{direction}" for node in range(1, 1001) for direction in "xyz")
    found = Matrices(csc_array((3000, 3000)), csc_array((3000, 3000)), None, names).spread(300)
    nodes = sorted({int(name.partition(".")[0]) for name in found})
    assert len(found) == 3 * len(nodes)
    assert 95 <= len(nodes) <= 100
    assert max(np.diff([0, *nodes, 1001])) <= 20


def test_the_edges_of_a_drawn_grid_are_those_of_its_elements() -> None:
    grid = np.array([(x, 2.0 * y, 0.0) for x in range(4) for y in range(3)])
    lengths = sorted(float(np.linalg.norm(grid[one] - grid[other])) for one, other in _neighbours(grid))
    assert lengths == [1.0] * 9 + [2.0] * 8


def test_the_script_of_the_examples_writes_their_matrices_whose_tube_has_the_frequencies_of_a_hinged_beam(
    tmp_path: Path,
) -> None:
    runpy.run_path(str(EXAMPLES / "beam_models.py"))["main"](tmp_path)
    for name in ("tube/tube.csv", "frame/frame.csv"):
        assert (tmp_path / name).read_bytes() == (EXAMPLES / name).read_bytes()
    for matrix in ("K", "M"):
        ours, theirs = (np.load(root / "frame" / "frame.npz")[matrix] for root in (tmp_path, EXAMPLES))
        np.testing.assert_allclose(ours, theirs, rtol=1e-14, atol=1e-9)
    found = vi.modes(EXAMPLES / "tube" / "stiffness.mtx", mass=str(EXAMPLES / "tube" / "mass.mtx"), modes=3)
    made = vi.modes(tmp_path / "tube" / "stiffness.mtx", mass=str(tmp_path / "tube" / "mass.mtx"), modes=3)
    assert made.frequency.values == pytest.approx(found.frequency.values, rel=1e-12)
    # Euler-Bernoulli: (n pi / L)^2 sqrt(E I / (rho A)), with I / A = (outer^2 + inner^2) / 16
    wave = np.sqrt(2.1e11 / 7850.0 * (0.019**2 + 0.015**2) / 16.0)
    exact = (np.arange(1, 4) * np.pi / 2.4) ** 2 * wave / (2.0 * np.pi)
    assert found.frequency.values == pytest.approx(exact, rel=2e-5)
