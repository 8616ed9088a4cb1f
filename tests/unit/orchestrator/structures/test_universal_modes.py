"""Universal files of modes (UFF 55), written by the tests and by pyuff: there and back, units, masses and damage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyuff
from hypothesis import given, settings
from hypothesis import strategies as st
from support.damaged_bytes import damaged, read_or_refused
from support.modes_files import MARK, nodal_data, six_digits, units

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files import read_modes, universal, write_modes
from vibroimpact.orchestrator.structures.modes_files.given import checked_modes

DRAW = np.random.default_rng(7)
NODES = (3, 12, 700)
POINTS = tuple(f"{node}.{direction}" for node in NODES for direction in "xyz")
SHAPES = DRAW.standard_normal((2, 3, 3))
"""Shapes of two modes at three nodes."""
MASSES = (0.5, 4.0)


def normal(
    number: int, values: Any, *, frequency: float = 10.0, mass: float = 1.0, ratio: float = 0.01
) -> str:
    """Return the dataset of a normal mode."""
    return nodal_data(number, (frequency, mass, ratio, 0.0), dict(zip(NODES, values, strict=True)))


def complex_mode(
    number: int, values: Any, eigenvalue: complex, modal_a: complex, modal_b: complex = 0.0
) -> str:
    """Return the dataset of a complex mode."""
    parts = [part for each in (eigenvalue, modal_a, modal_b) for part in (each.real, complex(each).imag)]
    return nodal_data(number, parts, dict(zip(NODES, values, strict=True)), analysis=3)


def read(*texts: str) -> Modes:
    """Return the modes of datasets."""
    return checked_modes(universal.read("".join(texts).encode()))


def rows(modes: Modes) -> Any:
    """Return the shapes of all points, shape (point, mode)."""
    return np.array(list(modes.shapes.values()))


def test_normal_modes_are_read_to_their_last_digit_and_normalised_by_their_modal_masses() -> None:
    found = read(
        normal(2, SHAPES[0], frequency=62.7, mass=MASSES[0]),
        normal(1, SHAPES[1], frequency=12.7, mass=MASSES[1], ratio=-0.02),
    )
    np.testing.assert_allclose(found.natural, 2.0 * np.pi * np.array([12.7, 62.7]), rtol=1e-15)
    np.testing.assert_array_equal(found.damping_ratios, [-0.02, 0.01])
    assert tuple(found.shapes) == POINTS
    expected = six_digits(SHAPES[::-1].reshape(2, 9)).T / np.sqrt([4.0, 0.5])
    np.testing.assert_allclose(rows(found), expected, rtol=1e-15)
    assert found.remarks == ()


def test_modes_written_are_read_back_to_six_digits_here_and_by_pyuff(tmp_path: Path) -> None:
    path = tmp_path / "modes.uff"
    shapes = DRAW.standard_normal((6, 3)) * 10.0 ** DRAW.integers(-12, 12, (6, 3))
    names = ("1.x", "1.rz", "5.y", "5.z", "20.rx", "999999999.x")
    known = Modes(
        np.array([0.0, 50.0, 1e4]), np.array([0.0, 0.01, -0.2]), None, dict(zip(names, shapes, strict=True))
    )
    write_modes(path, known)
    found = read_modes(path)
    np.testing.assert_allclose(
        found.natural, 2.0 * np.pi * six_digits(known.natural / 2.0 / np.pi), rtol=1e-15
    )
    np.testing.assert_array_equal(found.damping_ratios, known.damping_ratios)
    assert tuple(found.shapes) == names
    np.testing.assert_array_equal(rows(found), six_digits(shapes))
    assert list(found.files) == ["modes.uff"]
    sets = pyuff.UFF(str(path)).read_sets()
    assert [each["type"] for each in sets] == [164, 55, 55, 55]
    np.testing.assert_array_equal(sets[3]["r1"][[0, 3]], six_digits(shapes[[0, 5], 2]))
    write_modes(path, found)
    np.testing.assert_array_equal(rows(read_modes(path)), rows(found))


@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_modes_written_by_pyuff_are_read(tmp_path: Path) -> None:
    path = tmp_path / "modes.unv"
    for number in (1, 2):
        parts = dict(zip(("r1", "r2", "r3"), SHAPES[number - 1].T, strict=True))
        known: dict[str, Any] = {
            "model_type": 1,
            "analysis_type": 2,
            "data_ch": 2,
            "spec_data_type": 8,
            "load_case": 1,
        }
        known |= {
            "freq": 10.0 * number,
            "modal_m": MASSES[number - 1],
            "modal_damp_vis": 0.01,
            "mode_n": number,
        }
        pyuff.UFF(str(path)).write_sets({"type": 55, "node_nums": list(NODES), **known, **parts}, "add")
    found = read_modes(path)
    np.testing.assert_allclose(found.natural, 2.0 * np.pi * np.array([10.0, 20.0]), rtol=1e-15)
    np.testing.assert_allclose(rows(found), six_digits(SHAPES.reshape(2, 9)).T / np.sqrt(MASSES), rtol=1e-15)


@settings(max_examples=40)
@given(
    st.floats(0.5, 500.0),
    st.floats(1e-4, 0.3),
    st.floats(-3.0, 3.0),
    st.floats(1e-3, 1e3),
    st.booleans(),
    st.booleans(),
)
def test_a_complex_mode_of_any_phase_is_its_normal_mode(
    frequency: float, ratio: float, phase: float, mass: float, with_a: bool, conjugate: bool
) -> None:
    natural = 2.0 * np.pi * frequency
    damped = natural * np.sqrt(1.0 - ratio**2)
    eigenvalue, turn = complex(-ratio * natural, damped), np.exp(1j * phase)
    modal_a = 2.0j * damped * mass * turn**2
    parts = [eigenvalue, modal_a if with_a else 0.0, -eigenvalue * modal_a]
    values = SHAPES[0] * turn
    if conjugate:
        parts, values = [complex(each).conjugate() for each in parts], values.conj()
    found = read(complex_mode(1, values, *parts))
    assert abs(found.natural[0] / natural - 1.0) < 1e-5
    assert abs(found.damping_ratios[0] - ratio) < 1e-5
    sign = np.sign(SHAPES[0].ravel()[np.argmax(np.abs(SHAPES[0]))])
    np.testing.assert_allclose(
        rows(found)[:, 0], sign * SHAPES[0].ravel() / np.sqrt(mass), rtol=0.0, atol=1e-4 / np.sqrt(mass)
    )


def test_complex_modes_of_six_directions_and_pairs_of_conjugates_are_read() -> None:
    turn = np.exp(2.0j)
    rows_of = {4: np.arange(1.0, 7.0) * turn, 9: -np.arange(7.0, 13.0) * turn}
    modal_a = 100.0j * 4.0 * turn**2
    text = ""
    for number, way in ((1, complex), (2, np.conj)):
        parts = [part for each in (-1.0 + 50.0j, modal_a, 0j) for part in (way(each).real, way(each).imag)]
        values = {node: way(row) if way is np.conj else row for node, row in rows_of.items()}
        text += nodal_data(number, parts, values, analysis=3)
    found = read(text)
    assert tuple(found.shapes) == tuple(
        f"{node}.{way}" for node in (4, 9) for way in ("x", "y", "z", "rx", "ry", "rz")
    )
    np.testing.assert_allclose(np.abs(rows(found)[:, 0]), np.arange(1.0, 13.0) / 2.0, rtol=1e-4)
    assert found.shapes["9.rz"][0] == max(found.shapes.values())[0]
    assert found.remarks[0] == "Modes of negative frequency are left out (1)."


def test_a_normal_mode_with_complex_values_is_made_real_and_its_error_is_told() -> None:
    values = SHAPES[0] + 0.05j * SHAPES[1]
    found = read(normal(1, values, mass=4.0))
    flat = values.ravel()
    line = np.exp(-0.5j * np.angle(np.sum(flat**2)))
    part = np.linalg.norm((flat * line).imag) / np.linalg.norm(flat)
    assert 0.01 < part < 0.1
    assert found.remarks == (
        f"Complex shapes are made real; at most {100.0 * part:.2g} % of a shape (mode 1) is left out.",
    )
    turns = [np.linalg.norm((flat * np.exp(1j * angle)).imag) for angle in np.linspace(0.0, np.pi, 500)]
    assert part * np.linalg.norm(flat) <= min(turns)


@pytest.mark.parametrize("scale", [1e-300, 1e-160, 1e160, 1e300])
def test_complex_shapes_of_any_size_are_made_real(scale: float) -> None:
    found = read(normal(1, SHAPES[0] * np.exp(1j) * scale))
    np.testing.assert_allclose(np.abs(rows(found)[:, 0]) / scale, np.abs(SHAPES[0].ravel()), rtol=1e-4)
    with pytest.raises(UsageError, match="3.x: expected finite numbers, got another in mode 1"):
        read(normal(1, SHAPES[0] * 1e300, mass=1e-30))


def test_a_mode_far_from_real_is_refused_by_its_number() -> None:
    with pytest.raises(
        UsageError, match="mode 1: expected a shape within 10 % of a real one, got [0-9.]+ % of it"
    ):
        read(normal(1, SHAPES[0] + 0.5j * SHAPES[1]))


def test_units_of_the_file_become_si() -> None:
    plain = read(normal(1, SHAPES[0], mass=2e-3))
    for length, force, factor in (
        (1000.0, 1.0, 1000.0),
        (1000.0, 1000.0, 1.0),
        (3.28083989501312, 1.0, 3.28083989501312),
    ):
        found = read(units(length, force), normal(1, SHAPES[0], mass=2e-3))
        np.testing.assert_allclose(rows(found), rows(plain) / np.sqrt(factor), rtol=1e-14)
        assert found.remarks == ("The units of the file are converted to SI.",)
    assert read(units(), normal(1, SHAPES[0])).remarks == ()
    six = nodal_data(1, (5.0, 1e-3, 0.0, 0.0), {1: np.arange(1.0, 7.0)})
    found = read(units(1000.0, 1.0), six)
    np.testing.assert_allclose(rows(found)[:3, 0], [1.0, 2.0, 3.0], rtol=1e-15)
    np.testing.assert_allclose(rows(found)[3:, 0], [4000.0, 5000.0, 6000.0], rtol=1e-15)


def test_other_datasets_are_left_out_and_said() -> None:
    binary = f"{MARK}{58:6d}b{1:6d}{2:6d}{2:12d}{8:12d}{0:6d}\nNONE\nNONE\n{MARK}\n\n{MARK}"
    found = read(
        f"{MARK}{151:6d}\nmodel\n{MARK}\n",
        binary,
        nodal_data(1, (10.0, 1.0), {1: np.ones(3)}, analysis=5),
        nodal_data(1, (10.0, 1.0, 0.0, 0.0), {1: np.ones(3)}, quantity=3),
        normal(1, SHAPES[0]),
        complex_mode(2, SHAPES[1], -1.0 - 50.0j, -100.0j),
        complex_mode(3, SHAPES[1], -1.0 + 50.0j, 100.0j),
    )
    assert len(found.natural) == 2
    assert found.remarks[:3] == (
        "Datasets of a frequency response are left out (1).",
        "Datasets of quantities of type 3 are left out (1).",
        "Modes of negative frequency are left out (1).",
    )


def test_values_that_are_zero_in_all_modes_are_no_points() -> None:
    first, second = SHAPES[0].copy(), SHAPES[1].copy()
    first[1, 2] = second[1, 2] = 0.0
    first[2] = 0.0
    found = read(normal(1, first), normal(2, second, frequency=20.0))
    assert "12.z" not in found.shapes
    assert found.shapes["700.x"][0] == 0.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (normal(1, SHAPES[0], mass=0.0), "line 10: dataset 55: mode 1: expected a modal mass > 0, got 0"),
        (normal(1, SHAPES[0], mass=-2.0), "expected a modal mass > 0, got -2"),
        (normal(1, SHAPES[0], ratio=1.5), "line 10: dataset 55: expected a damping ratio below 1, got 1.5"),
        (normal(1, SHAPES[0], frequency=-3.0), "frequency: expected numbers >= 0, got"),
        (complex_mode(1, SHAPES[0], -1.0 + 0j, 1j), "expected the eigenvalue of an oscillation, got -1"),
        (
            complex_mode(1, SHAPES[0], -1.0 + 9j, 0.0),
            "expected a modal mass > 0, got .*Modal A or B gives it",
        ),
        (nodal_data(1, (9.0, 1.0, 0.0, 0.0), {1: SHAPES[0, 0]}, quantity=12), "got accelerations .12."),
        (
            nodal_data(1, (9.0, 1.0), {1: SHAPES[0, 0]}),
            "line 10: dataset 55: expected 4 parameters of a mode, got 2",
        ),
        (normal(1, SHAPES[0]) * 2, "expected each mode once, got mode 1 2 times"),
        (
            normal(1, SHAPES[0]).replace("       700\n", "        12\n"),
            "expected each node once, got one again",
        ),
        (
            normal(1, SHAPES[0]).replace("       700\n", ""),
            "line 15: dataset 55: expected 2 lines for each node, got 1",
        ),
        (
            normal(1, SHAPES[0]).replace("       700\n", "       7x0\n"),
            "line 15: dataset 55: expected an integer",
        ),
        (normal(1, 0.0 * SHAPES[0]), "expected shapes at 1 to 1000000 points, got 0"),
        (
            nodal_data(1, (9.0,), {1: SHAPES[0, 0]}, analysis=4),
            r"expected modes at nodes \(dataset 55\), got a transient",
        ),
        (f"{MARK}    55\nNONE\n{MARK}", "line 3: expected the records of dataset 55, got fewer lines"),
        (f"{MARK}    55\nNONE\n", "expected the end of dataset 55 .-1., got the end of the file"),
        (f"{MARK}  none\n{MARK}", "line 2: expected the number of a dataset, got '  none'"),
        ("none\n", "line 1: expected the mark of a dataset"),
        (
            f"{MARK}   164\n         1\n{MARK}" + normal(1, SHAPES[0]),
            "dataset 164: expected two lines, got fewer",
        ),
        (units(0.0) + normal(1, SHAPES[0]), "line 4: dataset 164: expected factors > 0"),
    ],
)
def test_damaged_datasets_are_refused_with_their_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        read(text)


def test_modes_that_do_not_fit_a_universal_file_are_refused(tmp_path: Path) -> None:
    one = np.array([1.0])
    with pytest.raises(UsageError, match=r"expected points node.direction such as 12.z .*, got 'tip'"):
        write_modes(tmp_path / "a.uff", Modes(one, one, None, {"tip": one}))
    with pytest.raises(UsageError, match="expected damping ratios alone"):
        write_modes(tmp_path / "a.uff", Modes(one, one, np.eye(1), {"1.x": one}))
    with pytest.raises(UsageError, match="ending in .toml, .csv, .uff, .unv, got '.dat'"):
        write_modes(tmp_path / "a.dat", Modes(one, one, None, {"1.x": one}))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", [15, 2411])
def test_places_of_nodes_are_read_in_metres(kind: int) -> None:
    node = f"{NODES[0]:10d}"
    record = f"{node}{0:10d}{0:10d}{8:10d}"
    places = {
        15: "".join(f"{each:13.5E}" for each in (1500.0, -2.0, 0.0)),
        2411: "\n   1.5000000000000000D+03  -2.0000000000000000D+00   0.0D+00",
    }
    nodes = f"{MARK}{kind:6d}\n{record}{places[kind]}\n{MARK}"
    found = read(units(1000.0), nodes, normal(1, SHAPES[0]))
    assert found.coordinates
    assert {name.partition(".")[0] for name in found.coordinates} == {str(NODES[0])}
    assert set(found.coordinates.values()) == {(1.5, -0.002, 0.0)}
    with pytest.raises(UsageError, match=rf"line \d+: dataset {kind}: expected"):
        read(nodes.replace(node, "       one", 1), normal(1, SHAPES[0]))


WHOLE = (
    units(1000.0) + normal(1, SHAPES[0]) + complex_mode(2, SHAPES[1] * 1j, -1.0 + 50.0j, -100.0j)
).encode()


@settings(max_examples=40)
@given(damaged(WHOLE))
def test_a_damaged_file_is_read_or_refused_in_one_line(content: bytes) -> None:
    found = read_or_refused(lambda: checked_modes(universal.read(content)))
    if found is not None:
        assert np.isfinite(rows(found)).all()
        assert (np.diff(found.natural) >= 0.0).all()


def test_a_file_that_ends_early_is_refused_at_every_line() -> None:
    lines = WHOLE.splitlines(keepends=True)
    ends = [at + 1 for at, line in enumerate(lines) if line == MARK.encode()][1::2]
    for count in set(range(1, len(lines))) - set(ends):
        with pytest.raises(UsageError, match="expected"):
            read(b"".join(lines[:count]).decode())
