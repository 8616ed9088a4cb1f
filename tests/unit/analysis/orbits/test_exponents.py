"""Lyapunov exponents against the worked examples of equations.md, and multipliers of orbits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.command_line import in_this_process

import vibroimpact as vi

CHAOS: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": {"amplitude": 1.0, "angular_frequency": 2.8},
    "stop": [{"position": 0.0, "restitution": 0.8}],
    "record": {"transient_periods": 300, "recorded_periods": 20_000, "impacts": True, "extrema": False},
}
CHAIN: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"kind": "chain", "masses": [1.0, 1.0], "stiffnesses": [1.0, 1.0], "dampings": [0.1, 0.1]},
    "forcing": {"amplitude": [0.5, 0.0], "angular_frequency": 0.9},
    "stop": [{"position": 0.1, "restitution": 0.7}],
    "record": {"transient_periods": 50, "recorded_periods": 1000, "impacts": True},
}


def test_the_known_exponent_of_a_chaotic_oscillator() -> None:
    # the motion depends on the last bits of the engine; this many periods give the exponent to a quarter of the
    # tolerance
    found = vi.lyapunov(vi.run({**CHAOS, "record": CHAOS["record"] | {"recorded_periods": 200_000}}))
    assert float(found.lyapunov_exponent[0]) == pytest.approx(0.322, abs=0.006)
    assert float(found.standard_error[0]) < 0.002
    assert float(found.sum_error) < 1e-12
    assert 1.0 < float(found.dimension) < 2.0


def test_the_sum_rule_of_the_worked_example() -> None:
    scene = {
        **CHAOS,
        "body": {
            "mass": 1.0,
            "stiffness": 1.0,
            "damping_ratio": 0.03,
            "displacement_start": 0.2,
            "velocity_start": -0.6,
        },
        "forcing": {"amplitude": 0.9, "angular_frequency": 1.6},
        "stop": [{"position": 0.2, "restitution": 0.75}],
        "record": {"transient_periods": 0, "recorded_periods": 600, "impacts": True},
    }
    found = vi.lyapunov(vi.run(scene))
    expected = 2.0 * np.log(0.75) - 2.0 * 0.03 * float(found.impact_interval)
    assert float(found.lyapunov_exponent.sum()) == pytest.approx(expected, abs=1e-12)


def test_exponents_of_coupled_modes_keep_the_sum_rule_and_are_those_of_their_orbit() -> None:
    coupled = CHAIN | {"body": CHAIN["body"] | {"dampings": [0.0, 0.3], "far_damping": 0.05}}
    found = vi.lyapunov(vi.run(coupled))
    assert int(found.impacts) > 800
    assert float(found.sum_error) < 1e-12
    (orbit,) = vi.find_orbits(coupled)
    # a part of a round stays at both ends of the run
    np.testing.assert_allclose(found.lyapunov_exponent, np.log(np.abs(orbit.multipliers)), atol=3e-3)
    exact = 2.0 * np.log(0.7) - 0.65 * float(found.impact_interval)
    assert float(found.lyapunov_exponent.sum()) == pytest.approx(exact, abs=1e-12)


def test_exponents_of_a_periodic_orbit_of_a_chain_are_the_logarithms_of_its_multipliers() -> None:
    found = vi.lyapunov(vi.run(CHAIN))
    (orbit,) = vi.find_orbits(CHAIN, 1)
    np.testing.assert_allclose(found.lyapunov_exponent, np.log(np.abs(orbit.multipliers)), atol=2e-3)
    assert float(found.lyapunov_exponent.sum()) == pytest.approx(np.log(orbit.exact_determinant), rel=1e-9)


@pytest.mark.parametrize("given", [CHAIN, {**CHAOS, "forcing": {"amplitude": 1.0, "angular_frequency": 2.0}}])
def test_a_periodic_run_of_few_impacts_has_the_multipliers_of_its_orbit(given: dict[str, Any]) -> None:
    record = {"transient_periods": 600, "impacts": True}
    few, many = (
        vi.lyapunov(vi.run({**given, "record": record | {"recorded_periods": count}})) for count in (20, 2000)
    )
    assert str(few.reason.item()) == ""
    assert int(few.impacts) < 20
    np.testing.assert_allclose(few.lyapunov_exponent, many.lyapunov_exponent, atol=3e-3)
    np.testing.assert_allclose(few.impact_interval, many.impact_interval, rtol=1e-9)
    assert not few.standard_error.any()


def test_reasons_are_counted_and_the_commonest_comes_first(tmp_path: Path) -> None:
    sweep = {"forcing.angular_frequency": {"values": [2.6, 2.7, 2.8, 2.75]}}
    scene = {
        **CHAOS,
        "record": {"transient_periods": 5, "recorded_periods": 20, "impacts": True},
        "sweep": sweep,
    }
    vi.run(scene, tmp_path / "runs.nc")
    done = in_this_process("lyapunov", tmp_path / "runs.nc")
    assert done.returncode == 2
    assert "got none. 4 of 4: expected 200 impacts after the 51 of a transient" in " ".join(
        done.stderr.split()
    )


def test_the_exponents_of_a_sweep_are_a_variable_and_a_figure(tmp_path: Path) -> None:
    sweep = {"forcing.angular_frequency": {"values": [0.72, 0.8, 1.2, 1.58]}}
    record = {"transient_periods": 300, "recorded_periods": 400, "impacts": True}
    body = {"body": CHAOS["body"], "forcing": {"amplitude": 0.5, "angular_frequency": 1.0}}
    scene = {
        **CHAOS,
        **body,
        "stop": [{"position": 1.0, "restitution": 0.7}],
        "record": record,
        "sweep": sweep,
    }
    runs, output, figure = (tmp_path / name for name in ("runs.nc", "exponents.nc", "exponents.png"))
    vi.run(scene, runs)
    done = in_this_process("lyapunov", runs, "-o", output, "--figure", figure)
    assert (done.returncode, done.stderr) == (0, "")
    assert "1 without: expected impacts with a speed" in done.stdout
    assert figure.stat().st_size > 4000
    with vi.open_measured(output) as found:
        largest = found.lyapunov_exponent.values[:, 0]
        assert largest[0] > 0.2
        assert (largest[1:3] < 0.0).all()
        assert np.isnan(largest[3])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"record": {"transient_periods": 5, "recorded_periods": 20, "impacts": True}}, "expected 200 impacts after"),
        ({"forcing": {"amplitude": 1e-9, "angular_frequency": 2.8}, "stop": [{"position": 1.0, "restitution": 0.8}]},
         "expected impacts with a speed"),
    ],
)  # fmt: skip
def test_a_run_without_exponents_says_why(change: dict[str, Any], said: str) -> None:
    found = vi.lyapunov(vi.run({**CHAOS, **change}))
    assert said in str(found.reason.item())
    assert np.isnan(found.lyapunov_exponent).all()
