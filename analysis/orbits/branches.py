"""Branches of periodic orbits as a dataset: each orbit is a run, so that sweeps and branches have the same figures."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord, build_dataset
from vibroimpact.analysis.dataset.schema import CurvePoint, SpecialOrbit, UnitSystem, attributes_of, unit_in
from vibroimpact.analysis.orbits.bifurcations import Locus
from vibroimpact.analysis.orbits.branch import Branch, BranchOrbit, SpecialPoint
from vibroimpact.analysis.orbits.index_sum import index
from vibroimpact.analysis.orbits.periodic import TURN, PeriodicOrbit
from vibroimpact.analysis.orbits.symmetry import is_symmetric, mirror_image
from vibroimpact.fmus.bodies.impacting_body import Floats

SAMPLES = 256
"""Samples of a forcing period; a cubic between two samples gives an extremum to 1e-8 of the displacement."""

MISSING_ORBITS = "missing_orbits"
"""Attribute with the ranges in which orbits are missing: a line with two values of the parameter for each."""
_CURVE_POINTS = {str(each.name).replace("_", " "): each for each in CurvePoint} | {
    "another": CurvePoint.another_graze_between_impacts
}
"""Flags of points of loci by their kinds."""


def mirror_images(branches: Sequence[Branch]) -> dict[int, Branch]:
    """Return the branch of mirror images for the place of each branch whose orbits are not their own images.

    A body that has the mirror symmetry at single values of the parameter only has no such branch.
    """
    pairs = ((place, _mirrored(branch)) for place, branch in enumerate(branches))
    return {place: image for place, image in pairs if image is not None}


def _mirrored(branch: Branch) -> Branch | None:
    if not branch.orbits or mirror_image(branch.orbits[0].orbit) is None or branch.is_symmetric:
        return None
    images: dict[int, BranchOrbit] = {}
    for each in (*branch.orbits, *(point.at for point in branch.points)):
        image = mirror_image(each.orbit)
        if image is None:
            return None
        images[id(each)] = BranchOrbit(each.value, image, each.tangent, each.border)
    return Branch(
        f"mirror images of {branch.full_name}",
        [images[id(each)] for each in branch.orbits],
        [SpecialPoint(point.kind, images[id(point.at)], point.place) for point in branch.points],
        branch.ends,
    )


def dataset_of_branches(
    branches: Sequence[Branch],
    *,
    coordinate: str,
    unit: str,
    units: UnitSystem = "SI",
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Return the orbits of branches as the runs of a dataset, one branch after the other.

    Parameters
    ----------
    branches : sequence of Branch
    coordinate, unit : str
        Name of the parameter in the dataset, and its SI unit.
    units : {"SI", "nondimensional"}
    attrs : mapping, optional
        Attributes of the file.

    Returns
    -------
    xarray.Dataset
        With `schema.ORBIT_COLUMNS`. Impacts are those of one orbit, from phase 0 on; periods are forcing periods.
    """
    orbits = [each for branch in branches for each in branch.orbits]
    return _dataset(
        [each.orbit for each in orbits],
        [number for number, branch in enumerate(branches, start=1) for _ in branch.orbits],
        [_special(branches, each) for each in orbits],
        {coordinate: np.array([each.value for each in orbits])},
        {coordinate: unit},
        units,
        attrs,
    )


def dataset_of_orbits(
    orbits: Sequence[PeriodicOrbit], *, units: UnitSystem = "SI", attrs: Mapping[str, Any] | None = None
) -> xr.Dataset:
    """Return orbits of one body, at least one, as the runs of a dataset over their forcing frequency.

    Each orbit is a branch of its own; `attrs` are attributes of the file. Without a force the frequency is the orbit's.
    """
    return _dataset(
        orbits,
        range(1, len(orbits) + 1),
        [SpecialOrbit.none] * len(orbits),
        {"angular_frequency": np.array([each.body.angular_frequency for each in orbits])},
        {"angular_frequency": "rad s-1" if units == "SI" else "1"},
        units,
        attrs,
    )


def dataset_of_loci(
    loci: Sequence[Locus],
    *,
    coordinates: tuple[str, str],
    unit_of: Mapping[str, str],
    units: UnitSystem = "SI",
    attrs: Mapping[str, Any] | None = None,
) -> xr.Dataset:
    """Return the orbits of loci as the runs of a dataset, over two parameters.

    Parameters
    ----------
    loci : sequence of Locus
    coordinates : tuple of str
        Names of both parameters in the dataset.
    unit_of : mapping of str to str
        Their SI units.
    units : {"SI", "nondimensional"}
    attrs : mapping, optional
        Attributes of the file.

    Returns
    -------
    xarray.Dataset
        As `dataset_of_branches`; `orbit_special` is the bifurcation at each orbit, `orbit_branch` counts the loci. The
        points of codimension 2, and the extrema of folds over the second parameter, are on `curve_point`.
    """
    points = [each for locus in loci for each in locus.points]
    kinds = [SpecialOrbit[locus.kind.replace(" ", "_")] for locus in loci for _ in locus.points]
    found = _dataset(
        [each.orbit for each in points],
        [number for number, locus in enumerate(loci, start=1) for _ in locus.points],
        kinds,
        {name: np.array([each.values[place] for each in points]) for place, name in enumerate(coordinates)},
        unit_of,
        units,
        attrs,
    )
    return found.assign(_curve_points(loci, coordinates, unit_of, units))


def _curve_points(
    loci: Sequence[Locus], coordinates: tuple[str, str], unit_of: Mapping[str, str], units: UnitSystem
) -> dict[str, xr.Variable]:
    """Return the points of codimension 2 of loci as variables."""
    met = [(number, *each) for number, locus in enumerate(loci, start=1) for each in locus.special]
    columns: dict[str, NDArray[Any]] = {
        "curve_point_curve": np.array([number for number, _, _ in met], dtype=np.int32),
        "curve_point_kind": np.array([_CURVE_POINTS[kind] for _, kind, _ in met], dtype=np.int8),
    }
    for place, name in enumerate(("curve_point_first", "curve_point_second")):
        columns[name] = np.array([point.values[place] for _, _, point in met], dtype=np.float64)
    attributes = {name: attributes_of(name, units) for name in columns}
    for name, coordinate in zip(list(columns)[2:], coordinates, strict=True):
        attributes[name] |= {
            "units": unit_in(units, unit_of[coordinate]),
            "long_name": f"{coordinate} at the point",
        }
    return {name: xr.Variable("curve_point", column, attributes[name]) for name, column in columns.items()}


def _dataset(
    orbits: Sequence[PeriodicOrbit],
    numbers: Sequence[int],
    special: Sequence[SpecialOrbit],
    coordinates: Mapping[str, Floats],
    unit_of: Mapping[str, str],
    units: UnitSystem,
    attrs: Mapping[str, Any] | None,
) -> xr.Dataset:
    largest = np.array([each.multipliers[0] for each in orbits])
    columns: dict[str, NDArray[Any]] = {
        "orbit_branch": np.array(numbers, dtype=np.int32),
        "orbit_period": np.array([each.period for each in orbits]),
        "orbit_periods": np.array([each.periods for each in orbits], dtype=np.int32),
        "orbit_stable": np.array([each.is_stable for each in orbits], dtype=np.int8),
        "orbit_symmetric": np.array([is_symmetric(each) for each in orbits], dtype=np.int8),
        "orbit_special": np.array(special, dtype=np.int8),
        "orbit_multiplier_real": largest.real,
        "orbit_multiplier_imaginary": largest.imag,
        "orbit_index": np.array([index(each, each.periods) for each in orbits], dtype=np.int8),
    }
    most = max(each.periods for each in orbits)
    return build_dataset(
        [_record(each, most) for each in orbits],
        coordinates=coordinates,
        direction=[Direction.independent] * len(orbits),
        run_index=range(len(orbits)),
        unit_of=unit_of,
        units=units,
        measured=columns,
        attrs=attrs,
    )


def extrema(orbit: PeriodicOrbit) -> Floats:
    """Return the highest and the lowest displacement of the observed point in each forcing period, shape (q, 2)."""
    periods = TURN * orbit.periods
    ends = np.append(orbit.phases, orbit.phases[0] + periods)
    per_flight = [
        np.linspace(first, last, max(int(SAMPLES * (last - first) / TURN), 8) + 1)
        for first, last in itertools.pairwise(ends)
    ]
    found = np.full((orbit.periods, 2), np.nan)
    for phases in per_flight:
        before_impact = np.append(phases[:-1], np.nextafter(phases[-1], 0.0))
        x, v = orbit.at(before_impact)
        tops, at = _turns(before_impact, x, v / orbit.body.angular_frequency)
        # an instant between two forcing periods belongs to both
        edges = np.arange(np.ceil(phases[0] / TURN), np.floor(phases[-1] / TURN) + 1.0)
        turns = np.concatenate([np.floor(np.append(at, phases) / TURN), edges - 1.0, edges])
        places = (turns % orbit.periods).astype(int)
        values = np.concatenate([tops, x, *[orbit.at(TURN * edges)[0]] * 2])
        np.fmax.at(found[:, 0], places, values)
        np.fmin.at(found[:, 1], places, values)
    return found


def _turns(phases: Floats, x: Floats, slope: Floats) -> tuple[Floats, Floats]:
    """Return the extrema of the displacement between samples, and their phases, from cubics between samples."""
    here = np.flatnonzero(slope[:-1] * slope[1:] < 0.0)
    h, x0, x1 = phases[here + 1] - phases[here], x[here], x[here + 1]
    d0, d1 = slope[here] * h, slope[here + 1] * h
    a, b, c = 3.0 * (2.0 * (x0 - x1) + d0 + d1), 2.0 * (3.0 * (x1 - x0) - 2.0 * d0 - d1), d0
    root = np.sqrt(np.fmax(b * b - 4.0 * a * c, 0.0))
    q = -0.5 * (b + np.copysign(root, b))
    with np.errstate(divide="ignore", invalid="ignore"):
        both = np.stack([q / a, c / q])
    inside = np.where((both >= 0.0) & (both <= 1.0), both, np.nan)
    s = np.where(np.isfinite(inside[0]), inside[0], inside[1])
    value = x0 + s * (d0 + s * (b / 2.0 + s * a / 3.0))
    good = np.isfinite(value)
    return value[good], (phases[here] + s * h)[good]


def _record(orbit: PeriodicOrbit, most: int) -> RunRecord:
    w, q = orbit.body.angular_frequency, orbit.periods
    strobes = TURN * np.arange(q)
    later = np.sort(np.where(strobes < orbit.phases[0], strobes + TURN * q, strobes))
    x, v = orbit.at(later)
    order = np.argsort(later % (TURN * q))
    periods = np.full((most, 5), np.nan)
    periods[:q, :2] = extrema(orbit)
    periods[:q, 2], periods[:q, 3] = x[order], v[order]
    phases = np.mod(orbit.phases, TURN * q)
    periods[:q, 4] = np.bincount((phases // TURN).astype(int), minlength=q)
    order = np.argsort(phases)
    impacts = np.column_stack(
        [
            phases / w,
            np.mod(phases, TURN),
            orbit.velocities,
            orbit.impulses,
            orbit.contacts + 1.0,
            orbit.restitutions,
            orbit.durations,
        ]
    )
    return RunRecord(
        Outcome.ok,
        "",
        periods,
        impacts[order],
        final_displacement=float(periods[0, 2]),
        final_velocity=float(periods[0, 3]),
        final_phase=0.0,
    )


def _special(branches: Sequence[Branch], orbit: BranchOrbit) -> SpecialOrbit:
    for branch in branches:
        for point in branch.points:
            if point.at.orbit is orbit.orbit:
                return SpecialOrbit[point.kind.replace(" ", "_")]
    return SpecialOrbit.none


def multiplier_text(value: complex) -> str:
    """Return a Floquet multiplier in words."""
    if not np.isfinite(value):
        return "unbounded"
    return f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g}{value.imag:+.6g}i"
