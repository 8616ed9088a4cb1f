"""A body and a stop as two FMUs move like one FMU, and like the closed form, at any macro step."""

import math
import re
from collections.abc import Mapping

import numpy as np
import pytest
from support.coupled_parts import (
    EXCHANGES,
    P11,
    P11_PHASE,
    P11_VELOCITY,
    VERSIONS,
    body,
    contact,
    external,
    phase_error,
    stop,
)
from support.places import EXAMPLES
from support.tolerance import SEQUENCE

from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.run import PointRunner
from vibroimpact.orchestrator.scene import Scene, load_scene, parse_scene

PERIOD = 2.0 * math.pi
ORBIT = 1e-12
"""Largest error of the orbit at any macro step, from the issue: 1e-12."""
TIME, PHASE, SPEED, CONTACT = 0, 1, 2, 4
"""Columns of a record's impacts."""


def p11(
    versions: tuple[str, str], macro_step: float, exchange: str, periods: float
) -> tuple[float, float, int]:
    """Return phase, velocity and number of impacts of the coupled P(1,1), settled from rest."""
    importer = Importer(
        [body("body", {**P11, **external(1.0)}, versions[0]), stop("stop", 0.7, versions[1])],
        contact("body", "stop"),
        exchange=exchange,  # type: ignore[arg-type]
        macro_step=macro_step,
    )
    try:
        importer.begin()
        importer.advance(periods * PERIOD)
        owner = importer.components["body"]
        phase, velocity = owner.group("Float64", ["contact[1].last_phase", "contact[1].last_velocity"]).get()
        return float(phase), float(velocity), int(owner.group("Int64", ["contact[1].count"]).get()[0])
    finally:
        importer.free()


@pytest.mark.parametrize("macro_step", [PERIOD / 1000, PERIOD / 7.3, 10 * PERIOD, math.inf])
@pytest.mark.parametrize("versions", [(b, s) for b in VERSIONS for s in VERSIONS], ids="+".join)
def test_the_coupled_orbit_is_the_exact_one_at_any_macro_step(
    versions: tuple[str, str], macro_step: float
) -> None:
    phase, velocity, count = p11(versions, macro_step, "gauss_seidel", 80.4)
    assert count == 80
    assert phase_error(phase, P11_PHASE) <= ORBIT
    assert abs(velocity - P11_VELOCITY) <= ORBIT


@pytest.mark.parametrize("exchange", EXCHANGES)
@pytest.mark.parametrize("versions", [("3.0", "3.0"), ("2.0", "2.0"), ("2.0", "3.0")], ids="+".join)
def test_the_coupled_orbit_does_not_depend_on_the_exchange(versions: tuple[str, str], exchange: str) -> None:
    phase, velocity, _ = p11(versions, PERIOD / 7.3, exchange, 80.4)
    assert max(phase_error(phase, P11_PHASE), abs(velocity - P11_VELOCITY)) <= ORBIT


# ---- coupled equals fused: every shipped scene of the short form ----


def example(name: str, periods: int, macro_step: float | None = None) -> Scene:
    """Return a shipped scene with `periods` recorded periods, without samples; a macro step makes it coupled."""
    text = (EXAMPLES / name).read_text(encoding="utf-8")
    text = re.sub(r"recorded_periods = \d+", f"recorded_periods = {periods}", text)
    text = re.sub(r"time_series = .*", "", text)
    text = re.sub(r"\[execution\][^\[]*", "", text)
    if macro_step is not None:
        text += f'\n[execution]\nhow = "coupled"\nmacro_step = {macro_step!r}\n'
    return parse_scene(text, name)


def run(scene: Scene, execution: str, values: Mapping[str, float]) -> RunRecord:
    runner = PointRunner(scene, execution=execution)
    try:
        return runner.run(values)
    finally:
        runner.close()


def impacts_of(record: RunRecord) -> np.ndarray:
    assert record.impacts is not None
    return record.impacts


def assert_same_motion(one: RunRecord, other: RunRecord, tolerance: float = SEQUENCE) -> None:
    a, b = impacts_of(one), impacts_of(other)
    assert len(a) == len(b)
    phases = np.abs(a[:, PHASE] - b[:, PHASE]) if len(a) else np.zeros(1)
    around = np.minimum(phases, np.abs(2.0 * math.pi - phases))
    assert np.nanmax(around, initial=0.0) <= tolerance
    assert np.abs(a[:, SPEED] - b[:, SPEED]).max(initial=0.0) <= tolerance
    assert np.array_equal(a[:, CONTACT], b[:, CONTACT])
    # rounding of an absolute time is relative to the time
    assert np.all(np.abs(a[:, TIME] - b[:, TIME]) <= tolerance * (1.0 + np.abs(a[:, TIME])))
    assert one.outcome is other.outcome


SHORT_FORM: dict[str, list[dict[str, float]]] = {
    "basins.toml": [{}],
    "bifurcation.toml": [{"forcing.angular_frequency": w} for w in (0.85, 0.95, 1.1, 1.3)],
    "chatter.toml": [{}],
    "coupled_p11.toml": [{}],
    "free_decay.toml": [{}],
    "gap_sweep.toml": [
        {"stop[1].position": gap, "forcing.frequency": f}
        for gap, f in ((0.001, 4.9), (0.002, 5.5), (0.003, 6.1))
    ],
    "single_run.toml": [{}],
    "tolerances.toml": [{"stop[1].position": 0.0021, "body.stiffness": 103.0}],
    "two_stops.toml": [{}],
    "yielding_stop.toml": [{}],
}


def test_every_shipped_scene_of_the_short_form_is_compared() -> None:
    short = {
        path.name
        for path in EXAMPLES.glob("*.toml")
        if "\n[body]" in path.read_text(encoding="utf-8")
        and (scene := load_scene(path)).is_one_body
        and not scene.lists_forces  # several forces and moving stops run fused only
    }
    assert short == set(SHORT_FORM)


@pytest.mark.parametrize("name", SHORT_FORM)
def test_a_thousand_impacts_coupled_are_those_of_the_fused_body(name: str) -> None:
    for point in SHORT_FORM[name]:
        # at least one impact in two periods; chatter has forty per period
        periods = 50 if name == "chatter.toml" else 2010
        fused = run(example(name, periods), "fused", point)
        coupled = run(example(name, periods), "coupled", point)
        if name != "free_decay.toml":
            assert len(impacts_of(fused)) >= 1000, point
        assert_same_motion(fused, coupled)
        if fused.periods is not None:
            assert coupled.periods is not None
            assert np.abs(fused.periods - coupled.periods).max() <= SEQUENCE


@pytest.mark.parametrize("name", ["bifurcation.toml", "two_stops.toml"])
@pytest.mark.parametrize("macro_step", [0.37, 2.0])
def test_a_thousand_impacts_are_the_same_with_communication_points_between_them(
    name: str, macro_step: float
) -> None:
    point = SHORT_FORM[name][0]
    fused = run(example(name, 1010), "fused", point)
    coupled = run(example(name, 1010, macro_step), "coupled", point)
    assert_same_motion(fused, coupled)


@pytest.mark.parametrize("transient", [1000, 1001, 1002])
def test_no_row_is_lost_wherever_an_impact_fills_the_record(transient: int) -> None:
    """Impacts are written between steps, periods within steps: a row of either kind may be the last that fits."""
    scene = example("bifurcation.toml", 900)
    scene = scene.model_copy(
        update={"record": scene.record.model_copy(update={"transient_periods": transient})}
    )
    record = run(scene, "coupled", {"forcing.angular_frequency": 0.85})  # an impact in every second period
    assert record.periods is not None
    assert len(record.periods) == 900
    assert len(impacts_of(record)) == record.periods[:, 4].sum() == 450


def test_no_row_is_lost_of_a_stop_that_yields_and_fills_the_record_several_times() -> None:
    """A contact has a row of its own and one for its peak: the record of 496 rows is full after some 160 periods."""
    text = (EXAMPLES / "bifurcation.toml").read_text(encoding="utf-8")
    text = text.replace('law = "restitution"', 'law = "kelvin_voigt"\nstiffness = 500.0\ndamping = 0.5')
    text = text.replace("restitution = 0.7", "").replace("transient_periods = 1000", "transient_periods = 10")
    scene = parse_scene(text.replace("recorded_periods = 20", "recorded_periods = 340"), "yielding.toml")
    found = run(scene, "coupled", {"forcing.angular_frequency": 1.0})
    assert found.periods is not None
    assert len(found.periods) == 340
    assert len(impacts_of(found)) == found.periods[:, 4].sum() >= 340
    assert np.isfinite(impacts_of(found)[:, -1]).sum() >= 339


def test_a_record_of_more_periods_than_the_body_keeps_loses_none_without_impacts() -> None:
    scene = example("bifurcation.toml", 2000)
    records = [run(scene, how, {"forcing.angular_frequency": 1.6}) for how in ("fused", "coupled")]
    assert [len(impacts_of(record)) for record in records] == [0, 0]
    fused, coupled = (record.periods for record in records)
    assert fused is not None
    assert coupled is not None
    assert fused.shape == (2000, 5)
    np.testing.assert_array_equal(fused, coupled)


@pytest.mark.parametrize("macro_step", [None, 0.037, 0.5, 40.0])
@pytest.mark.parametrize("name", ["chatter.toml", "free_decay.toml"])
def test_chatter_stick_and_release_come_at_the_same_times(name: str, macro_step: float | None) -> None:
    fused = run(example(name, 4), "fused", {})
    coupled = run(example(name, 4, macro_step), "coupled", {})
    assert fused.sticks is not None
    assert coupled.sticks is not None
    assert len(fused.sticks) == (1 if name == "free_decay.toml" else 5)
    np.testing.assert_allclose(coupled.sticks, fused.sticks, rtol=SEQUENCE, atol=SEQUENCE)
    assert_same_motion(fused, coupled)
    assert abs(fused.final_displacement - coupled.final_displacement) <= SEQUENCE
    assert abs(fused.final_velocity - coupled.final_velocity) <= SEQUENCE


# ---- the graze ladder ----

ZETA, W = 0.05, 0.8
SIZE = math.hypot(1.0 - W * W, 2.0 * ZETA * W)
LAG = math.atan2(2.0 * ZETA * W, 1.0 - W * W)


def grazing(excess: float, phase: float) -> dict[str, float]:
    """Return start values of a steady motion of amplitude 1 + excess that starts at a forcing phase."""
    amplitude = 1.0 + excess
    return {
        "damping": 2.0 * ZETA,
        "forcing.amplitude": amplitude * SIZE,
        "forcing.angular_frequency": W,
        "forcing.phase": phase,
        "displacement_start": min(1.0, amplitude * math.cos(phase - LAG)),
        "velocity_start": -W * amplitude * math.sin(phase - LAG),
    }


@pytest.mark.parametrize("macro_step", [math.inf, 0.3])
@pytest.mark.parametrize("version", VERSIONS)
def test_every_peak_over_the_stop_is_an_impact_from_eight_start_phases(
    version: str, macro_step: float
) -> None:
    importer = Importer(
        [body("body", external(1.0), version), stop("stop", 0.7, version)],
        contact("body", "stop"),
        macro_step=macro_step,
    )
    count: VariableGroup = importer.components["body"].group("Int64", ["contact[1].count"])
    found = {}
    for exponent in range(2, 11):
        met = 0
        for i in range(8):
            start = grazing(10.0**-exponent, 2.0 * math.pi * i / 8)
            importer.begin(0.0, {("body", name): value for name, value in start.items()})
            importer.advance(2.0 * math.pi / W)
            met += int(count.get()[0]) > 0
        found[exponent] = met
    importer.free()
    assert found == dict.fromkeys(range(2, 11), 8)


# ---- chaos ----

CHAOS = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
displacement_start = 0.1
[forcing]
amplitude = 0.5
angular_frequency = 0.72
[[stop]]
position = 1.0
restitution = 0.7
[record]
recorded_periods = 20000
"""


def test_in_chaos_the_first_ten_impacts_agree_and_then_the_statistics() -> None:
    fused = run(parse_scene(CHAOS, "chaos.toml"), "fused", {})
    # the fused run lacks these communication points: other roundings, and soon another orbit
    text = f'{CHAOS}[execution]\nhow = "coupled"\nmacro_step = 1.9\n'
    coupled = run(parse_scene(text, "chaos.toml"), "coupled", {})
    a, b = impacts_of(fused), impacts_of(coupled)
    assert a[:10] == pytest.approx(
        b[:10], rel=0.0, abs=1e-10, nan_ok=True
    )  # a rigid stop has no largest force
    shorter = min(len(a), len(b))
    assert np.abs(a[:shorter, SPEED] - b[:shorter, SPEED]).max() > 0.1  # the motion is chaotic
    assert abs(len(a) / len(b) - 1.0) <= 0.02
    assert abs(a[:, SPEED].mean() / b[:, SPEED].mean() - 1.0) <= 0.02
    assert abs(a[:, SPEED].std() / b[:, SPEED].std() - 1.0) <= 0.02
    assert fused.outcome is coupled.outcome is Outcome.ok
