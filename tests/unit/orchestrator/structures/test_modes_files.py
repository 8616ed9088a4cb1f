"""Files of modes in TOML, CSV and NetCDF: each is read to the bit, and its mistakes are told by name."""

from __future__ import annotations

import gzip
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st
from support.damaged_bytes import damaged, read_or_refused
from support.modes_files import Kind, netcdf

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files import csv_table, read_modes, toml_table, write_modes
from vibroimpact.orchestrator.structures.modes_files.given import checked_modes

FREQUENCIES = [10.1, 62.7, 3.3]
ORDER = [2, 0, 1]
"""Modes in ascending order of frequency."""
RATIOS = [0.01, 0.02, 0.03]
SHAPES = {"tip": [2.0, -2.0, 1e-300], "12.rx": [0.7, 1.4, -3.1]}
MASSES = [4.0, 0.25, 9.0]
PARTICIPATION = [1.0, 2.0, 3.0]
DAMPING = [[1.0, 0.5, 0.0], [0.5, 2.0, -0.1], [0.0, -0.1, 0.3]]


def read(folder: Path, name: str, content: bytes) -> Modes:
    """Return the modes of a file with some content."""
    path = folder / name
    path.write_bytes(content)
    return read_modes(path)


def check(found: Modes, *, masses: list[float] | None = None, damping: bool = False) -> None:
    """Check the modes of this module, in ascending order."""
    np.testing.assert_array_equal(found.natural, 2.0 * np.pi * np.array(FREQUENCIES)[ORDER])
    np.testing.assert_array_equal(found.damping_ratios, np.array(RATIOS)[ORDER])
    assert list(found.shapes) == ["tip", "12.rx"]
    for name, row in SHAPES.items():
        expected = np.array(row) / np.sqrt(masses or [1.0, 1.0, 1.0])
        np.testing.assert_array_equal(found.shapes[name], expected[ORDER])
    assert found.participation is not None
    np.testing.assert_array_equal(found.participation, np.array(PARTICIPATION)[ORDER])
    if damping:
        assert found.damping is not None
        np.testing.assert_array_equal(found.damping, np.array(DAMPING)[np.ix_(ORDER, ORDER)])


TABLE: dict[str, Any] = {
    "kind": "modes",
    "frequencies": FREQUENCIES,
    "damping_ratio": RATIOS,
    "damping_matrix": DAMPING,
    "shapes": SHAPES,
    "participation": PARTICIPATION,
}
TEXT = (
    "# measured\n\nfrequency,10.1,62.7,3.3\nDamping_Ratio, .01, .02,.03\ntip,2,-2,1e-300\n"
    "12.rx,0.7,1.4,-3.1\nparticipation,1,2,3\nmodal_mass,4,0.25,9\n"
)


@pytest.mark.parametrize("tables", [TABLE, {"body": TABLE}, {"body": [TABLE | {"name": "board"}]}])
def test_the_table_of_a_body_is_read_to_the_bit(tmp_path: Path, tables: dict[str, Any]) -> None:
    check(read(tmp_path, "modes.toml", tomli_w.dumps(tables).encode()), damping=True)


@pytest.mark.parametrize("change", [lambda text: text, lambda text: text.replace(",", "\t")])
def test_a_table_of_text_is_read_to_the_bit(tmp_path: Path, change: Any) -> None:
    check(read(tmp_path, "modes.csv", change(TEXT).encode()), masses=MASSES)


def test_decimal_commas_and_packed_files_are_read(tmp_path: Path) -> None:
    content = "\ufeff" + TEXT.replace(",", ";").replace(".", ",").replace("12,rx", "12.rx").replace(
        "\n", "\r\n"
    )
    packed = gzip.compress(content.encode())
    found = read(tmp_path, "modes.csv.gz", packed)
    check(found, masses=MASSES)
    assert dict(found.files) == {"modes.csv.gz": hashlib.sha256(packed).hexdigest()}


@pytest.mark.parametrize("kind", ["NETCDF4", "NETCDF3_CLASSIC"])
@pytest.mark.parametrize("turned", [False, True])
def test_netcdf_is_read_to_the_bit(tmp_path: Path, kind: Kind, turned: bool) -> None:
    shapes = np.array(list(SHAPES.values()))
    variables: dict[str, Any] = {
        "frequency": (("mode",), FREQUENCIES),
        "damping_ratio": (("mode",), RATIOS),
        "modal_mass": (("mode",), MASSES),
        "participation": (("mode",), PARTICIPATION),
        "damping_matrix": (("mode", "other"), DAMPING),
        "point": (("point",), list(SHAPES)),
        "shape": (("mode", "point"), shapes.T) if turned else (("point", "mode"), shapes),
        "remark": (("point",), [1.0, 2.0]),
    }
    content = netcdf(variables, kind=kind, units={"frequency": "Hz", "modal_mass": "kg"})
    check(read(tmp_path, "modes.nc", content), masses=MASSES, damping=True)


@pytest.mark.parametrize("turned", [False, True])
def test_complex_shapes_of_netcdf_are_made_real(tmp_path: Path, turned: bool) -> None:
    turn = np.exp(0.7j) * np.array([[3.0], [-4.0]])
    dimensions = ("mode", "point") if turned else ("point", "mode")
    variables: dict[str, Any] = {
        "angular_frequency": (("mode",), [5.0]),
        "point": (("point",), ["a", "b"]),
        "shape": (dimensions, turn.real.T if turned else turn.real),
        "shape_imaginary": (dimensions, turn.imag.T if turned else turn.imag),
    }
    found = read(tmp_path, "modes.nc", netcdf(variables))
    np.testing.assert_allclose([found.shapes["a"], found.shapes["b"]], [[-3.0], [4.0]], rtol=1e-14)
    assert found.natural.tolist() == [5.0]
    assert found.remarks == ()


def test_modes_written_as_toml_are_read_back_to_the_bit_with_their_origin(tmp_path: Path) -> None:
    path = tmp_path / "modes.toml"
    draw = np.random.default_rng(3)
    known = Modes(
        2.0 * np.pi * np.sort(draw.random(4)) * 1e3,
        draw.standard_normal(4),
        np.diag(draw.random(4)),
        {"tip": draw.standard_normal(4), "812.z": draw.standard_normal(4)},
        draw.standard_normal(4),
        2,
        1.5e-4,
        {"bracket.sti": "ab" * 32},
        ("One remark.",),
    )
    write_modes(path, known)
    found = read_modes(path)
    for name in ("natural", "damping_ratios", "damping", "participation"):
        np.testing.assert_array_equal(getattr(found, name), getattr(known, name))
    assert list(found.shapes) == list(known.shapes)
    np.testing.assert_array_equal(found.shapes["812.z"], known.shapes["812.z"])
    assert (found.residual_vectors, found.error, found.remarks) == (2, 1.5e-4, ("One remark.",))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    assert dict(found.files) == {"bracket.sti": "ab" * 32, "modes.toml": digest}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"frequencies": [1.0, "a", 2.0]}, "frequencies: expected an array of numbers, got"),
        ({"frequencies": []}, "shapes.tip: expected 0 numbers, one for each mode, got 3"),
        ({"frequencies": [1.0, float("nan"), 2.0]}, "frequency: expected finite numbers, got nan"),
        ({"frequencies": [1.0, -5.0, 2.0]}, "frequency: expected numbers >= 0, got -5.0"),
        ({"frequencies": [1.0, True, 2.0]}, "frequencies: expected an array of numbers"),
        ({"angular_frequencies": FREQUENCIES}, "expected frequencies or angular_frequencies, got both"),
        ({"shapes": {}}, "shapes: expected a table of points, got none"),
        ({"shapes": {"a b": [1.0, 2.0, 3.0]}}, "expected a point's name of at most 40 letters.*, got 'a b'"),
        ({"shapes": {"tip": [1.0, 2.0]}}, "shapes.tip: expected 3 numbers, one for each mode, got 2"),
        (
            {"shapes": {"tip": [1.0, 2.0, float("inf")]}},
            "tip: expected finite numbers, got another in mode 3",
        ),
        ({"damping_ratio": [0.1, 0.2]}, "damping_ratio: expected 3 numbers, one for each mode, got 2"),
        ({"damping_matrix": [[1.0]]}, "damping_matrix: expected 3 rows, one for each mode, got 1"),
        ({"damping_matrix": [[0.0, 1.0, 0.0], [0.0] * 3, [0.0] * 3]}, "damping_matrix: expected a symmetric"),
        ({"participation": [1.0]}, "participation: expected 3 numbers, one for each mode, got 1"),
        ({"mass": 1.0}, "mass: expected one of kind, name, frequencies, .*, got another key"),
        ({"kind": "chain"}, "kind: expected 'modes', got 'chain'"),
        ({"origin": {"files": 3}}, "origin: expected a table of files, residual_vectors, error and remarks"),
        ({"origin": {"residual_vectors": 1}}, "expected ascending frequencies beside residual vectors"),
    ],
)
def test_mistakes_of_a_table_are_told_by_name(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=rf"modes.toml: {said}"):
        read(tmp_path, "modes.toml", tomli_w.dumps(TABLE | changed).encode())


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("tip,1,2\n", "expected a row frequency or angular_frequency, got neither"),
        ("frequency,1,2\nangular_frequency,1,2\ntip,1,2\n", "angular_frequency, got both"),
        ("frequency,1,2\n", "expected a row for each point, got none"),
        ("frequency,1,2\ntip,1\n", "line 2: expected 2 numbers, one for each mode, got 1"),
        ("frequency,1,2\ntip,1,x\n", "line 2: expected a number, got 'x'"),
        ("frequency,1,2\ntip,1,\n", "line 2: expected a number, got ''"),
        ("frequency,1,2\ntip,1,2\n\ntip,3,4\n", "line 4: expected one row of 'tip', got another"),
        ("frequency,1,2\nmodal_mass,1,0\ntip,1,2\n", "mode 2: expected a modal mass > 0, got 0. It is 1 for"),
        ("frequency\ntip\n", "expected 1 to 1000 modes, got 0"),
        ("", "expected a file of 1 to"),
    ],
)
def test_mistakes_of_a_table_of_text_are_told_with_their_line(
    tmp_path: Path, content: str, said: str
) -> None:
    with pytest.raises(UsageError, match=rf"modes.csv: .*{said}"):
        read(tmp_path, "modes.csv", content.encode())


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"frequency": (("one", "mode"), [[1.0, 2.0]])}, "frequency: expected 1 dimensions, got 2"),
        (
            {"damping_ratio": (("other",), [1.0, 2.0])},
            "damping_ratio: expected the dimension mode, got other",
        ),
        ({"shape": (("a", "b"), np.ones((2, 2)))}, "shape: expected the dimensions mode and point, got a, b"),
        ({"shape": (("three", "mode"), np.ones((3, 2)))}, "shapes: expected 2 points x 2 modes, got 3 x 2"),
        ({"point": (("point",), [1.0, 1.0])}, "expected each point once, got '1.0' again"),
        ({"frequency": (("mode",), ["a", "b"])}, "frequency: expected numbers, got"),
        ({"point": None}, "expected a variable point, got frequency, shape"),
        (
            {"frequency": None},
            "expected a variable frequency or angular_frequency, got variables point, shape",
        ),
    ],
)
def test_mistakes_of_netcdf_are_told_by_name(tmp_path: Path, changed: dict[str, Any], said: str) -> None:
    variables: dict[str, Any] = {
        "frequency": (("mode",), [1.0, 2.0]),
        "point": (("point",), ["a", "b"]),
        "shape": (("point", "mode"), np.ones((2, 2))),
        **changed,
    }
    content = netcdf({name: value for name, value in variables.items() if value is not None})
    with pytest.raises(UsageError, match=rf"modes.nc: .*{said}"):
        read(tmp_path, "modes.nc", content)


def test_another_unit_and_another_kind_of_file_are_refused(tmp_path: Path) -> None:
    variables: dict[str, Any] = {"frequency": (("mode",), [1.0])}
    with pytest.raises(UsageError, match="frequency: expected the unit Hz, got 'rpm'"):
        read(tmp_path, "modes.nc", netcdf(variables, units={"frequency": "rpm"}))
    with pytest.raises(UsageError, match=r"modes.dat: expected a file of modes .*, got another kind"):
        read(tmp_path, "modes.dat", b"1 2 3\n")
    with pytest.raises(UsageError, match=r"none.toml: expected a file that can be read"):
        read_modes(tmp_path / "none.toml")


@settings(max_examples=60)
@given(st.sampled_from(["toml", "csv"]), st.data())
def test_a_damaged_text_is_read_or_refused_in_one_line(kind: str, data: st.DataObject) -> None:
    reader = toml_table.read if kind == "toml" else csv_table.read
    content = data.draw(damaged(tomli_w.dumps(TABLE).encode() if kind == "toml" else TEXT.encode()))
    found = read_or_refused(lambda: checked_modes(reader(content)))
    if found is not None:
        assert all(
            np.isfinite(row).all() and row.shape == found.natural.shape for row in found.shapes.values()
        )


@settings(max_examples=12)
@given(data=st.data())
def test_a_damaged_netcdf_file_is_read_or_refused_in_one_line(
    data: st.DataObject, tmp_path_factory: Any
) -> None:
    variables: dict[str, Any] = {
        "frequency": (("mode",), [1.0, 2.0]),
        "point": (("point",), ["a", "b"]),
        "shape": (("point", "mode"), np.ones((2, 2))),
    }
    kind: Kind = data.draw(st.sampled_from(("NETCDF4", "NETCDF3_CLASSIC")))
    content = data.draw(damaged(netcdf(variables, kind=kind))) or b"\0"
    found = read_or_refused(lambda: read(tmp_path_factory.getbasetemp(), "modes.nc", content))
    if found is not None:
        assert all(np.isfinite(row).all() for row in found.shapes.values())
