"""Basins of mirrored scenes: the mirror image of an attractor has the share of the attractor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi

POINTS = 8
LIKE = 0.1
"""Largest difference of shares: rounding decides starts of long transients next to a border."""

Stop = tuple[float, str, float]


def basins(stops: list[Stop], force: dict[str, float], ends: tuple[float, float]) -> Any:
    tables = {
        "scene": {"units": "nondimensional"},
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
        "forcing": force,
        "stop": [{"position": at, "side": side, "restitution": r} for at, side, r in stops],
        "record": {"recorded_periods": 8},
    }
    return vi.basins(tables, ends, (-2.0, 2.0), (POINTS, POINTS))


def shares(found: Any) -> dict[str, list[float]]:
    """Return the shares of the attractors of each class, ascending."""
    classes: dict[str, list[float]] = {}
    for name, share in zip(found.attractor_name.values, found.basin_fraction.values, strict=True):
        classes.setdefault(str(name).split(" ")[0], []).append(float(share))
    return {name: sorted(each) for name, each in classes.items()}


@given(
    st.floats(0.2, 1.0),
    st.floats(0.5, 0.9),
    st.floats(0.3, 1.2),
    st.floats(0.6, 2.5),
    st.one_of(st.none(), st.floats(1.0, 2.0)),
)
@settings(max_examples=6)
def test_a_mirrored_scene_has_mirrored_shares(
    position: float, restitution: float, amplitude: float, frequency: float, opposite: float | None
) -> None:
    force = {"amplitude": amplitude, "angular_frequency": frequency}
    stops: list[Stop] = [(position, "upper", restitution)]
    mirrored: list[Stop] = [(-position, "lower", restitution)]
    if opposite is not None:
        stops.append((-opposite, "lower", restitution))
        mirrored.append((opposite, "upper", restitution))
    low = -2.0 if opposite is None else -opposite
    one = basins(stops, force, (0.99 * low, 0.99 * position))
    other = basins(mirrored, {**force, "phase": np.pi}, (-0.99 * position, -0.99 * low))
    here, there = shares(one), shares(other)
    assert {name for name, each in here.items() if max(each) > LIKE} <= set(there)
    for name, each in here.items():
        if len(each) == len(there.get(name, [])):
            assert there[name] == pytest.approx(each, abs=LIKE)
    assert one.attrs["decided"] == pytest.approx(other.attrs["decided"], abs=LIKE)


@given(st.floats(0.2, 1.0), st.floats(0.5, 0.9), st.floats(0.3, 1.2), st.floats(0.6, 2.5))
@settings(max_examples=6)
def test_partners_between_equal_stops_have_mirrored_motions(
    position: float, restitution: float, amplitude: float, frequency: float
) -> None:
    stops: list[Stop] = [(position, "upper", restitution), (-position, "lower", restitution)]
    force = {"amplitude": amplitude, "angular_frequency": frequency}
    found = basins(stops, force, (-0.99 * position, 0.99 * position))
    partner = found.attractor_partner.values
    for place, other in enumerate(partner):
        if other >= 0:
            assert partner[other] == place
            ends = float(found.attractor_lowest[place]), float(found.attractor_highest[place])
            image = -float(found.attractor_highest[other]), -float(found.attractor_lowest[other])
            assert image == pytest.approx(ends, abs=0.1)
