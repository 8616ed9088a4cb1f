"""Effects that a scene does not ask for cost and change nothing: absent or switched off, it is the same run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from vibroimpact.analysis.dataset import RunRecord
from vibroimpact.orchestrator.run import open_runner
from vibroimpact.orchestrator.scene import Scene

Tables = dict[str, Any]
OSCILLATOR: Tables = {
    "body": {"mass": 1.0, "stiffness": 4.0, "displacement_start": -0.5},
    "stop": [{"position": 0.1, "restitution": 0.7}],
    "record": {"recorded_time": 20.0},
}
BEAM: Tables = {
    "body": {
        "kind": "beam",
        "length": 1.0,
        "mass_per_length": 1.0,
        "flexural_rigidity": 1.0,
        "displacement_start": [-0.2],
    },
    "stop": [{"position": 0.05, "law": "kelvin_voigt", "stiffness": 1e4}],
    "record": {"recorded_time": 20.0},
}
CHAIN: Tables = {
    "body": {
        "kind": "chain",
        "masses": [1.0, 2.0],
        "stiffnesses": [3.0, 4.0],
        "displacement_start": [-0.3, -0.6],
    },
    "stop": [{"position": 0.1, "restitution": 0.5}],
    "record": {"recorded_time": 20.0},
}
GENERAL: Tables = {
    "component": {
        "a": {"fmu": "Oscillator", "parameters": {"stiffness": 1.0, "displacement_start": 1.0}},
        "b": {"fmu": "Oscillator", "parameters": {"stiffness": 2.0}},
    },
    "connection": [{"from": "a.displacement", "to": "b.force", "gain": 1.0, "gain_unit": "N/m"}],
    "record": {"recorded_time": 10.0, "variables": ["b.displacement"], "rate": 10.0},
    "execution": {"macro_step": 0.1},
}
NO_FORCE = {"forcing": {"amplitude": 0.0, "angular_frequency": 0.0}}
READING = {"sensor": {"gain": 1.0, "offset": 0.0}}
PLAIN = {"execution": {"how": "auto", "impact_limit": 10_000_000}}


def changed(tables: Tables, more: Mapping[str, Any]) -> Tables:
    """Return tables with more keys; the keys of the first stop are in `stop`."""
    found = {name: dict(table) if isinstance(table, dict) else table for name, table in tables.items()}
    for name, keys in more.items():
        if name == "stop":
            found["stop"] = [{**tables["stop"][0], **keys}]
        else:
            found[name] = {**found.get(name, {}), **keys}
    return found


def ran(tables: Tables) -> tuple[RunRecord, dict[str, str]]:
    scene = Scene.from_dict(tables)
    runner = open_runner(scene, scene.execution.how)
    try:
        return runner.run({}), dict(runner.fmu_hashes)
    finally:
        runner.close()


@pytest.mark.parametrize(
    ("tables", "switched_off"),
    [
        (OSCILLATOR, NO_FORCE),
        (OSCILLATOR, READING),
        (OSCILLATOR, PLAIN),
        (OSCILLATOR, {"body": {"damping": 0.0}}),
        (OSCILLATOR, {"body": {"damping_ratio": 0.0}}),
        (OSCILLATOR, {"stop": {"yield_velocity": 0.0}}),
        (OSCILLATOR, {"record": {"impacts": True, "extrema": False, "strobe": False}}),
        (BEAM, NO_FORCE),
        (BEAM, READING),
        (BEAM, PLAIN),
        (BEAM, {"body": {"damping_ratio": 0.0, "rayleigh": {"mass": 0.0, "stiffness": 0.0}}}),
        (BEAM, {"body": {"frequency_slope": 0.0, "damping_slope": 0.0, "damping_reciprocal": 0.0}}),
        (BEAM, {"stop": {"damping": 0.0, "relaxation_time": 0.0}}),
        (BEAM, {"execution": {"contact_tolerance": 1e-10}}),
        (CHAIN, {"forcing": {"amplitude": [0.0, 0.0], "angular_frequency": 0.0}}),
        (CHAIN, {"body": {"dampings": [0.0, 0.0]}}),
        (GENERAL, {"execution": {"guard": False}}),
        (GENERAL, {"record": {"events": True, "transient_time": 0.0}}),
    ],
)
def test_absent_and_switched_off_are_one_run_by_the_same_fmus(
    tables: Tables, switched_off: Mapping[str, Any]
) -> None:
    absent, own = ran(tables)
    off, others = ran(changed(tables, switched_off))
    assert own == others
    for name in ("impacts", "sticks", "samples", "events", "final_state", "energy_residual"):
        first, second = getattr(absent, name), getattr(off, name)
        assert (first is None) == (second is None)
        if first is not None:
            np.testing.assert_array_equal(first, second)
    assert absent.outcome == off.outcome
    np.testing.assert_array_equal(
        [absent.final_displacement, absent.final_velocity], [off.final_displacement, off.final_velocity]
    )
    assert absent.impacts is None or len(absent.impacts) > 3


@pytest.mark.parametrize("tables", [OSCILLATOR, BEAM, CHAIN])
def test_what_is_recorded_changes_nothing_of_what_moves(tables: Tables) -> None:
    # a time series cuts the run into steps, so rounding differs: the comparison is up to rounding
    whole, _ = ran(tables)
    bare, _ = ran(changed(tables, {"record": {"impacts": False}}))
    assert bare.impacts is None
    assert (bare.final_displacement, bare.final_velocity) == (
        whole.final_displacement,
        whole.final_velocity,
    )
    series = {"variables": ["displacement"], "rate": 10.0}
    sampled, _ = ran(changed(tables, {"record": {"time_series": series}}))
    assert sampled.impacts is not None
    assert whole.impacts is not None
    first = slice(10)  # rounding grows from impact to impact
    np.testing.assert_allclose(sampled.impacts[first, 0], whole.impacts[first, 0], rtol=1e-10)
