"""Write the matrices of tube.toml and frame.toml, made of beam elements: `python examples/beam_models.py`."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
STEEL = {"modulus": 2.1e11, "density": 7850.0}  # Pa, kg/m^3


def element(
    length: float, area: float, inertia: float, modulus: float, density: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return stiffness and consistent mass of a plane beam: u, w and rotation at both ends (axis along u)."""
    axial = modulus * area / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    slope = length * np.array(
        [[0.0, 1.0, 0.0, 1.0], [1.0, 0.0, -1.0, 0.0], [0.0, -1.0, 0.0, -1.0], [1.0, 0.0, -1.0, 0.0]]
    )
    bending = (
        modulus
        * inertia
        / length**3
        * (
            np.diag([12.0, 4.0 * length**2, 12.0, 4.0 * length**2])
            + 6.0 * slope
            + np.diag([0.0, 2.0 * length**2], 2)
            + np.diag([0.0, 2.0 * length**2], -2)
            - 12.0 * (np.eye(4, k=2) * [[1], [0], [0], [0]] + np.eye(4, k=-2) * [[0], [0], [1], [0]])
        )
    )
    mass = density * area * length
    rod = mass / 6.0 * np.array([[2.0, 1.0], [1.0, 2.0]])
    moving = (
        mass
        / 420.0
        * np.array(
            [
                [156.0, 22.0 * length, 54.0, -13.0 * length],
                [22.0 * length, 4.0 * length**2, 13.0 * length, -3.0 * length**2],
                [54.0, 13.0 * length, 156.0, -22.0 * length],
                [-13.0 * length, -3.0 * length**2, -22.0 * length, 4.0 * length**2],
            ]
        )
    )
    stiffness, inertial = np.zeros((6, 6)), np.zeros((6, 6))
    for whole, along, across in ((stiffness, axial, bending), (inertial, rod, moving)):
        whole[np.ix_([0, 3], [0, 3])], whole[np.ix_([1, 2, 4, 5], [1, 2, 4, 5])] = along, across
    return stiffness, inertial


def assembled(nodes: np.ndarray, section: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrices of a polygon of beams over x, z and rotation at each node; nodes has the shape (node, 2)."""
    size = 3 * len(nodes)
    stiffness, mass = np.zeros((size, size)), np.zeros((size, size))
    for first, (start, end) in enumerate(pairwise(nodes)):
        length = float(np.hypot(*(end - start)))
        cosine, sine = (end - start) / length
        turn = np.kron(np.eye(2), [[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        place = slice(3 * first, 3 * first + 6)
        for whole, own in zip((stiffness, mass), element(length, **section, **STEEL), strict=True):
            whole[place, place] += turn.T @ own @ turn
    return stiffness, mass


def tube() -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
    """Return the matrices of a tube of a heat exchanger, 19 x 2 mm and 2.4 m long, on two hinges."""
    outer, inner = 0.019, 0.015
    section = {"area": np.pi / 4.0 * (outer**2 - inner**2), "inertia": np.pi / 64.0 * (outer**4 - inner**4)}
    nodes = np.column_stack([np.linspace(0.0, 2.4, 25), np.zeros(25)])
    stiffness, mass = assembled(nodes, section)
    bends = [freedom for freedom in range(75) if freedom % 3 and freedom not in (1, 73)]
    return stiffness, mass, nodes, bends


def frame() -> tuple[np.ndarray, np.ndarray, np.ndarray, list[int]]:
    """Return the matrices of a portal frame, 3 m x 4 m, of tubes 60 x 60 x 3 mm, clamped at its feet."""
    section = {"area": 0.06**2 - 0.054**2, "inertia": (0.06**4 - 0.054**4) / 12.0}
    left = [(0.0, height) for height in np.arange(0.0, 3.0, 0.5)]
    top = [(place, 3.0) for place in np.arange(0.0, 4.0, 0.5)]
    right = [(4.0, height) for height in np.arange(3.0, -0.25, -0.5)]
    nodes = np.array([*left, *top, *right])
    return *assembled(nodes, section), nodes, list(range(3, 3 * len(nodes) - 3))


def write_table(path: Path, nodes: np.ndarray, kept: list[int]) -> None:
    """Write the table of the degrees of freedom: node from 1, direction, and the place of the node."""
    rows = []
    for node, direction in (divmod(freedom, 3) for freedom in kept):
        x, z = nodes[node]
        rows.append(f"{node + 1}, {('x', 'z', 'ry')[direction]}, {x:g}, 0, {z:g}")
    path.write_text("\n".join(["node, direction, x, y, z", *rows, ""]), encoding="utf-8")


def write_text(path: Path, matrix: np.ndarray) -> None:
    """Write the lower triangle of a symmetric matrix as a Matrix Market file."""
    lines = [
        f"{row + 1} {column + 1} {float(matrix[row, column])!r}"
        for column in range(len(matrix))
        for row in range(column, len(matrix))
        if matrix[row, column] != 0.0
    ]
    head = "%%MatrixMarket matrix coordinate real symmetric", f"{len(matrix)} {len(matrix)} {len(lines)}"
    path.write_text("\n".join([*head, *lines, ""]), encoding="utf-8")


def main(folder: Path = HERE) -> None:
    """Write the files of both models."""
    for name, (stiffness, mass, nodes, kept) in {"tube": tube(), "frame": frame()}.items():
        (folder / name).mkdir(exist_ok=True)
        write_table(folder / name / f"{name}.csv", nodes, kept)
        places = np.ix_(kept, kept)
        if name == "tube":
            write_text(folder / name / "stiffness.mtx", stiffness[places])
            write_text(folder / name / "mass.mtx", mass[places])
        else:
            np.savez_compressed(folder / name / "frame.npz", K=stiffness[places], M=mass[places])


if __name__ == "__main__":
    main()
