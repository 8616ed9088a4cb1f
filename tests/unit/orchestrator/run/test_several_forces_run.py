"""Runs under several forces: superposition, constant loads, the base, common periods, continuations, exports."""

from __future__ import annotations

import math
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from fmpy import simulate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st

import vibroimpact as vi
from vibroimpact.analysis.landmarks.exact import ImpactOscillator
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.run.export import export_scene
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.study.effects import effects_of, shares_of

MASS, STIFFNESS, RATIO = 4.0, 4.0, 0.05
BODY = {"mass": MASS, "stiffness": STIFFNESS, "damping_ratio": RATIO}
STOP = [{"position": 0.3, "restitution": 0.7}]
SINE = {"amplitude": 3.0, "angular_frequency": 0.9}
TWO = [
    {"amplitude": 1.0, "angular_frequency": 1.0, "phase": 0.3},
    {"amplitude": 2.0, "angular_frequency": 1.5},
]
MEAN = {"signal": "constant", "amplitude": -1.3}
MOTION = {"rate": 4.0, "variables": ["displacement", "velocity", "acceleration"]}
TABLES: dict[str, Any] = {"body": BODY, "stop": STOP, "forcing": TWO, "record": {"recorded_periods": 40}}


def scene(**changes: Any) -> Scene:
    return Scene.from_dict(deepcopy(TABLES) | changes)


def run(**changes: Any) -> xr.Dataset:
    return vi.run(scene(**changes))


def exact_motion(forces: list[dict[str, Any]], times: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """Return displacement and velocity of the free body from rest under forces, shape (2, time): superposition."""
    natural = math.sqrt(STIFFNESS / MASS)
    motion, rest = np.zeros((2, len(times)), dtype=complex), np.zeros(2, dtype=complex)
    for force in forces:
        w, phase = force.get("angular_frequency", 0.0), force.get("phase", 0.0)
        steady = force["amplitude"] / MASS / (natural**2 - w**2 + 2j * RATIO * natural * w)
        motion += steady * np.array([[1.0], [1j * w]]) * np.exp(1j * (w * times + phase))
        rest += steady * np.array([1.0, 1j * w]) * np.exp(1j * phase)
    start, decay = -rest.real, RATIO * natural
    turns = natural * math.sqrt(1.0 - RATIO**2)
    cosine, sine = np.cos(turns * times), np.sin(turns * times)
    displacement = start[0] * cosine + (start[1] + decay * start[0]) / turns * sine
    velocity = start[1] * cosine - (natural**2 * start[0] + decay * start[1]) / turns * sine
    return np.asarray(motion.real + np.exp(-decay * times) * np.array([displacement, velocity]))


sines = st.builds(
    lambda a, w, p: {"amplitude": a, "angular_frequency": w, "phase": p},
    st.floats(-3.0, 3.0),
    st.floats(0.1, 5.0),
    st.floats(-7.0, 7.0),
)
constants = st.floats(-3.0, 3.0).map(lambda a: {"signal": "constant", "amplitude": a})


# ---- superposition ----


@given(st.lists(sines, min_size=1, max_size=15), st.lists(constants, max_size=1))
@settings(max_examples=12)
def test_the_motion_of_a_free_body_is_the_sum_of_its_motions(
    moving: list[dict[str, Any]], steady: list[dict[str, Any]]
) -> None:
    forces = [*moving, *steady]
    found = run(forcing=forces, stop=[], record={"recorded_periods": 3, "time_series": MOTION})
    times = found.time.values
    expected = exact_motion(forces, times)
    size = sum(abs(force["amplitude"]) for force in forces) / MASS / RATIO
    for name, exact in zip(("displacement", "velocity"), expected, strict=True):
        bound = 1e-13 * size * (1.0 + times.max() * 5.0)
        assert found[name].values == pytest.approx(exact, abs=max(bound, 1e-300)), name


def test_a_million_periods_of_two_frequencies_keep_their_phases() -> None:
    forces = [SINE, SINE | {"angular_frequency": math.sqrt(2.0), "phase": 0.4}]
    record = {"transient_periods": 10**6, "recorded_periods": 1, "time_series": MOTION}
    found = run(forcing=forces, stop=[], record=record)
    # the phases in 40 digits: the period of the clock is 2 pi / 0.9 of the number 0.9 in binary
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(40):
        begin = mpmath.mpf(10**6) * 2 * mpmath.pi / mpmath.mpf(0.9)
        exact = mpmath.mpf(0)
        for force in forces:
            w = mpmath.mpf(force["angular_frequency"])
            steady = mpmath.mpf(force["amplitude"]) / MASS / (1 - w**2 + 2j * mpmath.mpf(RATIO) * w)
            exact += mpmath.re(steady * mpmath.expj(w * begin + force.get("phase", 0.0)))
    assert found.displacement.values[0] == pytest.approx(float(exact), abs=1e-12)


# ---- constant loads ----


@pytest.mark.parametrize("load", [-1.3, 0.9])
def test_a_constant_load_is_a_stop_that_has_moved(load: float) -> None:
    shift = load / STIFFNESS
    loaded = run(forcing=[SINE, MEAN | {"amplitude": load}])
    moved = run(
        forcing=SINE,
        body=BODY | {"displacement_start": -shift},
        stop=[STOP[0] | {"position": 0.3 - shift}],
    )
    assert loaded.sizes["impact"] == moved.sizes["impact"] >= 40
    for name in ("impact_time", "impact_velocity", "impact_phase"):
        assert loaded[name].values == pytest.approx(moved[name].values, abs=1e-12), name
    assert loaded.displacement_max.values - shift == pytest.approx(moved.displacement_max.values, abs=1e-12)


def test_a_constant_alone_is_a_sine_of_frequency_0() -> None:
    record = {"recorded_time": 30.0}
    alone = run(forcing={"signal": "constant", "amplitude": 2.0}, record=record)
    sine = run(forcing={"amplitude": 2.0, "angular_frequency": 0.0}, record=record)
    assert alone.impact_time.values[:20] == pytest.approx(sine.impact_time.values[:20], rel=1e-12)
    assert alone.outcome == sine.outcome


# ---- the base ----


def test_a_moving_base_is_a_force_on_the_mass_and_moves_the_accelerations() -> None:
    names = ["displacement", "acceleration", *(f"forcing[{number}]" for number in (1, 2, 3))]
    record = {"recorded_periods": 10, "time_series": {"rate": 10.0, "variables": names}}
    forces = [SINE, TWO[1] | {"phase": 1.0}, MEAN]
    based = run(forcing=[force | {"kind": "base_acceleration"} for force in forces], record=record)
    pushed = [force | {"amplitude": -MASS * force["amplitude"]} for force in forces]
    forced = run(forcing=pushed, record=record)
    assert based.displacement.values == pytest.approx(forced.displacement.values, abs=1e-12)
    base = sum(based[f"forcing_{number}"].values for number in (1, 2, 3))
    assert based.acceleration.values == pytest.approx(forced.acceleration.values + base, abs=1e-11)
    assert based.forcing_2.attrs["units"] == "m s-2"
    assert forced.forcing_2.attrs == {"units": "N", "long_name": "force 2 of the scene, sine"} | {
        "_FillValue": forced.forcing_2.attrs["_FillValue"]
    }
    times = based.time.values
    assert based.forcing_2.values == pytest.approx(2.0 * np.cos(1.5 * times + 1.0), abs=1e-12)
    assert (based.forcing_3.values == -1.3).all()


# ---- chains, beams and several bodies ----


def test_two_forces_on_one_mass_are_one_force_of_their_sum() -> None:
    chain = {"kind": "chain", "masses": [1.0, 2.0], "stiffnesses": 1.0, "dampings": 0.1}
    half = SINE | {"amplitude": [0.5, -0.2]}
    record = {
        "recorded_periods": 20,
        "time_series": {"rate": 2.0, "variables": ["displacement[1]", "velocity[2]"]},
    }
    several = run(body=chain, forcing=[half, half], record=record)
    one = run(body=chain, forcing=SINE | {"amplitude": [1.0, -0.4]}, record=record)
    for name in ("displacement_1", "velocity_2", "strobe_displacement", "impact_time"):
        assert several[name].values == pytest.approx(one[name].values, abs=1e-11), name


@pytest.mark.parametrize(
    "load",
    [{"location": 0.4}, {"kind": "uniform"}, {"kind": "mode", "mode": 1}, {"kind": "base_acceleration"}],
    ids=["force", "uniform", "mode", "base"],
)
def test_a_load_of_a_beam_is_the_one_of_its_own_fmu(load: dict[str, Any]) -> None:
    beam = {"kind": "beam", "length": 1.0, "mass_per_length": 1.0, "flexural_rigidity": 0.1, "modes": 3}
    beam |= {"damping_ratio": 0.05}
    force = SINE | load | {"amplitude": 0.4}
    stop = [STOP[0] | {"position": 0.01, "location": 0.7}]
    several = run(body=beam, stop=stop, forcing=[force, MEAN | load | {"amplitude": 0.0}])
    one = run(body=beam, stop=stop, forcing=force)
    assert one.sizes["impact"] > 10
    for name in ("impact_time", "impact_velocity", "displacement_max"):
        assert several[name].values == pytest.approx(one[name].values, abs=1e-9), name


def test_gravity_on_several_bodies_is_a_constant_base_acceleration() -> None:
    bodies = [
        {"name": name, "mass": mass, "stiffness": 1.0, "damping": 0.4}
        for name, mass in (("a", 1.0), ("b", 2.0))
    ]
    contact = [{"between": ["a", "b"], "restitution": 0.5, "clearance": 10.0}]
    weight = {"signal": "constant", "kind": "base_acceleration", "amplitude": 0.5}
    series = {"rate": 1.0, "variables": ["displacement", "contact_displacement[1]"]}
    found = run(
        body=bodies,
        contact=contact,
        stop=[],
        forcing=weight,
        record={"recorded_time": 300.0, "time_series": series},
    )
    assert found.displacement.values[-1] == pytest.approx(-0.5)
    assert found.contact_displacement_1.values[-1] == pytest.approx(0.5)


# ---- the forcing period ----


def test_a_common_period_shows_one_point_of_a_periodic_motion() -> None:
    found = run(record={"transient_periods": 300, "recorded_periods": 40})
    assert found.attrs["clock_periods"] == 2
    assert np.ptp(found.strobe_displacement.values) < 1e-13
    assert vi.classify(found)[0].name == "P(3,1)"


def test_sines_without_a_common_period_have_a_class() -> None:
    found = run(forcing=[SINE, TWO[1] | {"angular_frequency": math.sqrt(2.0)}])
    assert found.attrs["clock_periods"] == 0
    assert "quasi-periodic: 2 sines without a common period" in found.attrs["engine"]
    assert vi.classify(found)[0].kind.name == "unknown"


def test_a_record_begins_where_the_first_sine_is_at_phase_0() -> None:
    found = run(stop=[], record={"recorded_periods": 1, "time_series": MOTION})
    assert found.time.values[0] == pytest.approx((4.0 * math.pi - 0.3) % (4.0 * math.pi))


def test_a_continuation_goes_on_from_the_phase_of_the_first_sine() -> None:
    axis = {"start": 2.0, "stop": 2.2, "points": 2, "path": "up"}
    whole = run(record={"recorded_periods": 5}, sweep={"forcing[2].amplitude": axis})
    state = whole.final_displacement.values.flat[0], whole.final_velocity.values.flat[0]
    turned = [TWO[0] | {"phase": 0.0}, {"amplitude": 2.2, "angular_frequency": 1.5, "phase": -0.45}]
    start = {"displacement_start": float(state[0]), "velocity_start": float(state[1])}
    second = run(body=BODY | start, forcing=turned, record={"recorded_periods": 5})
    assert whole.strobe_displacement.values.reshape(2, -1)[1] == pytest.approx(
        second.strobe_displacement.values, abs=1e-12
    )


def test_points_of_a_sweep_run_as_alone() -> None:
    sweep = {"forcing[2].amplitude": {"values": [1.0, 1.5]}, "body.mass": {"values": [3.0, 4.0]}}
    swept = scene(record={"recorded_periods": 4}, sweep=sweep, execution={"how": "fused"})
    found = vi.run(swept)
    alone = vi.run(swept.with_values({"sweep": {}, "forcing[2].amplitude": 1.5, "body.mass": 3.0}))
    assert found.strobe_displacement.values[1, 0].tolist() == alone.strobe_displacement.values.tolist()


@pytest.mark.parametrize(
    ("forces", "engine"),
    [
        (TWO, "lanes"),
        ([*TWO, {"signal": "constant", "amplitude": 0.3}], "lanes"),
        ([TWO[0] | {"angular_frequency": 1.1}, *TWO], "lanes"),
        ([*TWO, {"signal": "pulse", "shape": "half_sine", "amplitude": 1.0, "duration": 2.0}], "fused"),
        ([TWO[1] | {"angular_frequency": 0.1 * k} for k in range(1, 10)], "fused"),
    ],
)
def test_sines_and_constants_run_in_lanes_as_fused(forces: list[dict[str, Any]], engine: str) -> None:
    axes = {
        "forcing[2].amplitude": {"values": [0.5, 1.0, 1.5]},
        "stop[1].restitution": {"values": [0.5, 0.8]},
    }
    given = {"forcing": forces, "record": {"recorded_periods": 4}, "sweep": axes}
    found, fused = (run(**given, execution={"how": how}) for how in ("auto", "fused"))
    assert found.attrs["execution"] == engine
    assert found.impact_count.values.tolist() == fused.impact_count.values.tolist()
    assert found.impact_count.values.sum() > 6
    for name in ("strobe_displacement", "displacement_max", "final_displacement"):
        assert found[name].values == pytest.approx(fused[name].values, abs=1e-11)


def test_a_path_of_several_sines_runs_in_lanes_as_fused() -> None:
    path = {"start": 1.0, "stop": 1.3, "points": 4, "path": "up"}
    axes = {"forcing[2].amplitude": path, "stop[1].restitution": {"values": [0.5, 0.8]}}
    found, fused = (
        run(record={"recorded_periods": 2}, sweep=axes, execution={"how": how}) for how in ("auto", "fused")
    )
    assert found.attrs["execution"] == "lanes"
    assert found.final_displacement.values == pytest.approx(fused.final_displacement.values, abs=1e-9)


# ---- studies and exports ----


def test_effects_list_each_force() -> None:
    found = {effect.name: effect for effect in effects_of(scene(forcing=[*TWO, MEAN]))}
    assert found["force 1, sine"].without.value("forcing[1].amplitude") == 0.0  # it sets the clock
    assert len(found["force 3, constant"].without.forces) == 2
    one = scene(forcing=[SINE, MEAN])
    (share,) = shares_of(one, [each for each in effects_of(one) if each.name == "force 2, constant"])
    assert share.effect.without.body.FMU == "Oscillator"
    assert share.changes != "nothing"


def test_studies_of_one_force_refuse_several_by_name() -> None:
    with pytest.raises(
        UsageError, match=r"simulated in one way\. It is exact: several bodies, several forces"
    ):
        vi.accuracy(scene())
    with pytest.raises(DatasetError, match="expected a scene with one sine, got 2 forces"):
        ImpactOscillator.from_scene(scene().text)


@pytest.mark.parametrize("fmi", ["2.0", "3.0"])
def test_an_export_moves_as_its_scene_in_another_tool(fmi: str, tmp_path: Path) -> None:
    series = {"rate": 10, "variables": ["displacement"]}
    forces = [SINE, TWO[1] | {"angular_frequency": math.sqrt(2.0)}, MEAN]
    several = scene(forcing=forces, record={"recorded_periods": 6, "time_series": series})
    ours = vi.run(several)
    file = export_scene(several, tmp_path / "forces.fmu", fmi=fmi)
    theirs = simulate_fmu(file, stop_time=float(ours.time[-1]), output_interval=0.1, output=["displacement"])
    count = min(len(theirs), ours.sizes["sample"])
    assert count > 300
    assert ours.sizes["impact"] > 5
    assert theirs["displacement"][:count] == pytest.approx(ours.displacement.values[:count], abs=1e-9)
