"""No curve of thesis figures 3.5 and 3.10 is missing: between them the orbits P(1,1) are the same everywhere.

The closed form of P(1,1) counts the orbits on a grid, equations.md 4.3. Two neighbours between which no curve passes
have equally many, as many of them stable. Across one curve the numbers change as its bifurcation says.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr
from numpy.typing import NDArray
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form

SCENE = EXAMPLES / "bifurcation.toml"
FREQUENCY, AMPLITUDE, POSITION = "forcing.angular_frequency", "forcing.amplitude", "stop[1].position"
CHANGES = {
    SpecialOrbit.fold: (2, 1),
    SpecialOrbit.period_doubling: (0, 1),
    SpecialOrbit.graze: (1, 0),
    SpecialOrbit.graze_between_impacts: (1, None),
}
"""Change of the number of orbits and of stable orbits across a curve."""
NEAR = 1e-3
"""Distance from a curve, over the ranges, below which a point is next to it."""
Floats = NDArray[np.float64]


def oscillator(frequency: float, force: float, position: float) -> ImpactingBody:
    one = np.ones(1)
    stop = Contact(one, 1.0, position, 0.7)
    return ImpactingBody(one, 0.05 * one, force * one, 0.0 * one, frequency, 0.0, (stop,), one)


def counted(body: ImpactingBody) -> tuple[int, int]:
    """Return the number of physical orbits P(1,1), and of those that are stable."""
    orbits = [each for each in closed_form(body) if each.is_physical]
    return len(orbits), sum(each.is_stable for each in orbits)


def crossings(one: Floats, other: Floats, path: Floats) -> NDArray[np.int_]:
    """Return the number of crossings of a path with each line from one point to the other, shape (lines,)."""

    def side(a: Floats, b: Floats, c: Floats) -> Floats:
        ab, ac = b - a, c - a
        return np.sign(ab[..., 0] * ac[..., 1] - ab[..., 1] * ac[..., 0])

    p, q = one[:, None], other[:, None]
    a, b = path[None, :-1], path[None, 1:]
    meets = (side(p, q, a) != side(p, q, b)) & (side(a, b, p) != side(a, b, q))
    return np.asarray(meets.sum(axis=1))


def distances(points: Floats, path: Floats) -> Floats:
    """Return the distance of each point from a path, shape (points,)."""
    steps = np.diff(path, axis=0)
    apart = points[:, None] - path[None, :-1]
    shares = np.clip((apart * steps).sum(axis=-1) / np.maximum((steps**2).sum(axis=-1), 1e-300), 0.0, 1.0)
    return np.asarray(np.linalg.norm(apart - shares[..., None] * steps, axis=-1).min(axis=1))


def unexplained(
    loci: xr.Dataset, names: tuple[str, str], grid: tuple[Floats, Floats], body: Callable[..., ImpactingBody]
) -> tuple[list[str], set[tuple[int, int]]]:
    """Return the pairs of neighbours whose orbits change otherwise than the curves say, and all counts.

    Pairs across several curves say nothing, nor does a point next to a curve, which is drawn as a chain of lines.
    """
    found = np.array([[counted(body(x, y)) for y in grid[1]] for x in grid[0]])
    points = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1)
    first = np.concatenate([points[:-1].reshape(-1, 2), points[:, :-1].reshape(-1, 2)])
    last = np.concatenate([points[1:].reshape(-1, 2), points[:, 1:].reshape(-1, 2)])
    changes = np.concatenate([np.diff(found, axis=0).reshape(-1, 2), np.diff(found, axis=1).reshape(-1, 2)])
    runs = loci.vibroimpact.runs
    passed, span = [], np.ptp(points.reshape(-1, 2), axis=0)
    is_clear = np.ones(len(first), dtype=bool)
    for number in np.unique(runs["orbit_branch"].values):
        chosen = runs["orbit_branch"].values == number
        path = np.column_stack([runs[name].values[chosen] for name in names])
        kind = SpecialOrbit(int(runs["orbit_special"].values[chosen][0]))
        passed.append((kind, crossings(first, last, path)))
        for ends in (first, last):
            is_clear &= distances(ends / span, path / span) > NEAR
    assert is_clear.mean() > 0.9
    wrong = []
    for place, (orbits, stable) in enumerate(np.abs(changes)):
        kinds = [kind for kind, count in passed for _ in range(count[place])]
        if len(kinds) > 1 or not is_clear[place]:
            continue
        expected = CHANGES[kinds[0]] if kinds else (0, 0)
        if orbits != expected[0] or (expected[1] is not None and stable != expected[1]):
            wrong.append(f"{first[place]} {last[place]} {changes[place]} {kinds}")
    return wrong, {tuple(each) for each in found.reshape(-1, 2).tolist()}


@pytest.mark.long
def test_the_curves_around_a_point_of_codimension_two_bound_the_regions_of_figure_3_10() -> None:
    """Regions: no impacts, stable P(1,1), unstable P(1,1), and both orbits of the hysteresis."""
    scene = vi.Scene.from_file(SCENE).with_values({"sweep": {}, FREQUENCY: 0.7, AMPLITUDE: 0.55})
    loci = vi.follow(
        scene,
        FREQUENCY,
        0.6,
        0.75,
        impacts=1,
        doublings=0,
        grazes=0,
        step=0.03,
        second=AMPLITUDE,
        second_range=(0.5, 0.62),
    )
    grid = np.linspace(0.601, 0.749, 40), np.linspace(0.501, 0.619, 25)
    wrong, counts = unexplained(
        loci, ("angular_frequency", "amplitude"), grid, lambda w, force: oscillator(w, force, 1.0)
    )
    assert wrong == []
    assert counts == {(0, 0), (1, 1), (1, 0), (2, 1)}
    assert set(np.unique(loci["orbit_special"].values)) == {1, 2, 4}


@pytest.mark.long
@pytest.mark.parametrize(
    ("second", "name", "bounds", "body"),
    [
        (AMPLITUDE, "amplitude", (0.02, 1.2), lambda w, force: oscillator(w, force, 1.0)),
        (POSITION, "position", (0.4, 5.5), lambda w, position: oscillator(w, 0.5, position)),
    ],
)
def test_the_curves_of_figure_3_5_bound_its_regions(
    second: str, name: str, bounds: tuple[float, float], body: Callable[..., ImpactingBody]
) -> None:
    loci = vi.follow(
        *(SCENE, FREQUENCY, 0.3, 2.2),
        impacts=1,
        doublings=0,
        grazes=0,
        step=0.02,
        second=second,
        second_range=bounds,
    )
    grid = np.linspace(0.301, 2.199, 90), np.linspace(bounds[0] + 0.003, bounds[1] - 0.003, 60)
    wrong, counts = unexplained(loci, ("angular_frequency", name), grid, body)
    assert wrong == []
    assert counts >= {(0, 0), (1, 1), (1, 0), (2, 1)}
