"""Files of CalculiX 2.20: `examples/bracket` gives the frequencies that CalculiX itself finds for it."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse.linalg import eigsh

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.structures.readers import Sources, read_matrices
from vibroimpact.orchestrator.structures.readers.calculix import read, read_freedoms, read_nodes
from vibroimpact.orchestrator.structures.readers.wanted import Wanted

BRACKET = Path(__file__).parents[5] / "examples" / "bracket"
FREQUENCIES = (949.7605, 4427.662, 5695.376, 6044.491)
"""`*FREQUENCY` of the same model in CalculiX 2.20, Hz."""


def test_the_bracket_has_the_frequencies_of_calculix() -> None:
    found = read_matrices(Sources(file="bracket.sti.gz", folder=BRACKET))
    squares = eigsh(found.stiffness, 4, found.mass, sigma=0.0, v0=np.ones(216), return_eigenvectors=False)
    np.testing.assert_allclose(np.sort(np.sqrt(squares)) / (2.0 * np.pi), FREQUENCIES, rtol=1e-6)
    assert abs(found.stiffness - found.stiffness.T).max() == 0.0


def test_the_bracket_has_nodes_and_directions_with_their_places() -> None:
    found = read_matrices(Sources(file="bracket.sti.gz", folder=BRACKET))
    assert found.freedoms[:4] == ("2.x", "2.y", "2.z", "3.x")
    assert found.coordinates is not None
    tip = found.freedoms.index("42.z")
    np.testing.assert_array_equal(found.coordinates[tip], [0.06, 0.02, 0.004])
    inner = [int(name.partition(".")[0]) > 42 for name in found.freedoms]
    np.testing.assert_array_equal(
        np.isnan(found.coordinates[:, 0]), inner
    )  # incompatible modes have no nodes
    assert sum(inner) == 108


def unpack(folder: Path, *ends: str) -> None:
    for end in ends:
        (folder / f"bracket{end}").write_bytes(gzip.decompress((BRACKET / f"bracket{end}.gz").read_bytes()))


def test_the_files_of_a_job_are_taken_together_or_one_by_one(tmp_path: Path) -> None:
    unpack(tmp_path, ".sti", ".mas", ".dof")
    job = read_matrices(Sources(file="bracket.sti", folder=tmp_path))
    assert job.coordinates is None
    shutil.copy(BRACKET / "bracket.inp", tmp_path)
    parts = Sources("bracket.sti", "bracket.mas", freedoms="bracket.dof", folder=tmp_path)
    assert {path.name for path in parts.all_paths()} == {
        f"bracket{end}" for end in (".sti", ".mas", ".dof", ".inp")
    }
    one_by_one = read_matrices(parts)
    assert one_by_one.freedoms == job.freedoms
    assert one_by_one.coordinates is not None
    assert (one_by_one.mass != job.mass).nnz == 0


def test_a_job_that_lacks_a_file_is_refused(tmp_path: Path) -> None:
    unpack(tmp_path, ".sti", ".dof")
    with pytest.raises(UsageError, match=r"bracket\.mas: expected a file that can be read, got"):
        read_matrices(Sources(file="bracket.sti", folder=tmp_path))
    with pytest.raises(UsageError, match="mass: expected no name beside a file of CalculiX, got 'M'"):
        read_matrices(Sources(file="bracket.sti", mass="M", folder=tmp_path))


def unknowns_of(content: bytes, end: str) -> int | str:
    """Return the number of unknowns of a file, or the refusal."""
    try:
        if end == ".dof":
            return len(read_freedoms(content).freedoms)
        return int(read(content, Wanted({"mass": ""})).matrices["mass"].shape[0])
    except UsageError as refused:
        return str(refused)


@pytest.mark.parametrize("end", [".sti", ".mas", ".dof"])
def test_a_file_that_is_cut_off_anywhere_is_refused_or_has_fewer_unknowns(end: str) -> None:
    content = gzip.decompress((BRACKET / f"bracket{end}.gz").read_bytes())
    places = np.random.default_rng(1).integers(1, len(content), 20)
    ends_of_lines = [content.rfind(b"\n", 0, place) + 1 for place in places]
    for place in (*places, *ends_of_lines, len(content) - 1):
        found = unknowns_of(content[:place], end)
        assert found < 216 if isinstance(found, int) else "expected" in found


def test_a_file_with_fewer_unknowns_is_refused_with_its_name(tmp_path: Path) -> None:
    unpack(tmp_path, ".sti", ".mas", ".dof")
    lines = (tmp_path / "bracket.mas").read_bytes().splitlines(keepends=True)
    (tmp_path / "bracket.mas").write_bytes(b"".join(lines[:3]))
    with pytest.raises(
        UsageError, match=r"bracket\.mas: expected 216 unknowns, as in bracket\.sti, got 2 in the mass"
    ):
        read_matrices(Sources(file="bracket.sti", folder=tmp_path))


def test_half_the_freedoms_are_those_of_a_cyclic_symmetry(tmp_path: Path) -> None:
    unpack(tmp_path, ".sti", ".mas", ".dof")
    lines = (tmp_path / "bracket.dof").read_text().splitlines(keepends=True)
    (tmp_path / "bracket.dof").write_text("".join(lines[:108]))
    with pytest.raises(UsageError, match=r"bracket\.dof: .*got 108\. Matrices of a cyclic symmetry are not"):
        read_matrices(Sources(file="bracket.sti", folder=tmp_path))


@pytest.mark.parametrize("line", ["12.0", "12.7", "12", "a.1", "-1.2", "1 2", "1.1.1"])
def test_a_line_that_is_no_freedom_is_refused(line: str) -> None:
    with pytest.raises(UsageError, match=r"line 3: expected a node and a direction such as 12\.3, got"):
        read_freedoms(f"1.1\n\n{line}\n".encode())


def test_nodes_are_read_wherever_a_model_has_them() -> None:
    text = (
        "*Heading\n1, 2, 3, 4\n*NODE, NSET=ALL\n1, 0.5, 1e-3, -2.\n** a comment\n7,1,,3\n8, 1,\n\n"
        "*NODE PRINT, NSET=ALL\nU\n* node\r\n9, 1, 2, 3, \r\n*ELEMENT, TYPE=C3D8\n1, 2, 3, 4\n*NODE FILE\nU\n"
    )
    numbers, places = read_nodes(text.encode())
    assert numbers.tolist() == [1, 7, 8, 9]
    assert places.tolist() == [[0.5, 1e-3, -2.0], [1.0, 0.0, 3.0], [1.0, 0.0, 0.0], [1.0, 2.0, 3.0]]
    assert read_nodes(b"no model")[1].shape == (0, 3)


@pytest.mark.parametrize(
    "line", ["1, x", "one, 1, 2, 3", "1, nan, 0, 0", "0, 1, 2, 3", "99999999999, 1, 2, 3"]
)
def test_a_line_that_is_no_node_is_refused(line: str) -> None:
    with pytest.raises(UsageError, match="line 2: expected a node and three coordinates, got"):
        read_nodes(f"*NODE\n{line}\n".encode())
