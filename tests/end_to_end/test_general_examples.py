"""The shipped scenes of several FMUs run from the command line; some of them need an FMU to be written first."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process, vibroimpact
from support.fmu_factory import bouncing_ball
from support.places import EXAMPLES

from vibroimpact.analysis.dataset import Outcome, read_flat
from vibroimpact.fmus.core.measuring import exciter_force, gaussian, sensor_reading

SECONDS = ("point_seconds",)
"""Variables that differ between any two runs."""


def ran(folder: Path, name: str) -> Path:
    """Run a copy of an example in a folder and return its dataset."""
    shutil.copy(EXAMPLES / f"{name}.toml", folder)
    output = folder / f"{name}.nc"
    done = in_this_process("run", folder / f"{name}.toml", "-o", output)
    assert done.returncode == 0, done.stderr
    return output


def comes_back(folder: Path, name: str, *options: str) -> None:
    """Compare the dataset of an example with the dataset of its copy that went through an SSP archive."""
    system, back = folder / f"{name}.ssp", folder / f"{name}_back.toml"
    for command in (
        ("ssp", "export", folder / f"{name}.toml", "-o", system, *options),
        ("ssp", "import", system, "-o", back, "--force"),
        ("run", back, "-o", back.with_suffix(".nc"), "--force"),
    ):
        done = in_this_process(*command)
        assert done.returncode == 0, done.stderr
    ours, theirs = read_flat(folder / f"{name}.nc"), read_flat(back.with_suffix(".nc"))
    assert set(ours.variables) == set(theirs.variables)
    assert [v for v in ours.variables if v not in SECONDS and not ours[v].equals(theirs[v])] == []


def test_two_oscillators_follow_the_exact_two_mass_solution(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "two_oscillators"))
    t = dataset.time.values
    exact = 0.5 * (np.cos(t) + np.cos(math.sqrt(1.2) * t))
    assert np.abs(dataset.a_displacement.values - exact).max() < 0.01
    comes_back(tmp_path, "two_oscillators")
    comes_back(tmp_path, "two_oscillators", "--gains", "component", "--ssp", "2.0")


def test_in_the_cradle_one_ball_goes_in_and_one_comes_out(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "newtons_cradle"))
    assert dataset.ball1_displacement.values[50] == pytest.approx(
        -0.1 * math.cos(math.sqrt(9.81) * 0.5), abs=1e-12
    )
    late = dataset.time.values > 7.6
    assert np.abs(dataset.ball3_displacement.values).max() < 1e-11
    assert np.abs(dataset.ball5_displacement.values).max() == pytest.approx(0.1, rel=1e-3)
    assert np.abs(dataset.ball5_displacement.values[late]).max() < 1e-11
    times = dataset.event_time.values
    assert len(times) == 32
    assert np.allclose(np.diff(times[::4]), math.pi / math.sqrt(9.81), atol=1e-11)
    comes_back(tmp_path, "newtons_cradle")


def test_the_buildings_pound_and_never_pass_each_other(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "pounding"))
    gap = 0.02 + dataset.soft_displacement_2.values - dataset.stiff_displacement_2.values
    assert gap.min() > -1e-6
    assert dataset.event_time.sizes["event"] > 50


def test_a_body_and_a_stop_of_two_fmi_versions_keep_the_period_one_orbit(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "mixed_versions"))
    assert np.allclose(np.diff(dataset.event_time.values), 2.0 * math.pi, atol=1e-11)
    comes_back(tmp_path, "mixed_versions")


def test_a_body_in_model_exchange_keeps_the_period_one_orbit(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "model_exchange"))
    assert np.allclose(np.diff(dataset.event_time.values), 2.0 * math.pi, atol=1e-8)
    assert dataset.impact_velocity.values == pytest.approx(0.79105, abs=1e-5)
    comes_back(tmp_path, "model_exchange")


def test_a_phase_of_the_last_impact_has_no_value_before_the_first(tmp_path: Path) -> None:
    text = (EXAMPLES / "mixed_versions.toml").read_text()
    from_rest = text.replace("transient_time = 1256.6370614359173", "transient_time = 0")
    assert from_rest != text
    (tmp_path / "from_rest.toml").write_text(from_rest)
    assert in_this_process("run", tmp_path / "from_rest.toml", "-o", tmp_path / "run.nc").returncode == 0
    dataset = read_flat(tmp_path / "run.nc")
    phase, first = dataset.body_contact_1_last_phase.values.ravel(), dataset.event_time.values.min()
    before = dataset.time.values < first
    assert before.sum() > 50
    assert np.array_equal(np.isnan(phase), before)


def test_the_instruments_of_a_rig_say_what_their_equations_say(tmp_path: Path) -> None:
    dataset = read_flat(ran(tmp_path, "measuring_chain"))
    assert dataset.outcome.values[0] == Outcome.ok
    time, x = dataset.time.values, dataset.body_displacement.values
    volts = dataset.generator_displacement.values
    assert volts == pytest.approx(4.0 * np.cos(40.0 * math.pi * time), abs=1e-12)
    assert np.array_equal(dataset.exciter_force.values, exciter_force(volts, x, 2.0, 0.5, 0.02))
    reading = sensor_reading(x, 1000.0, 0.1, 5.0)
    assert np.array_equal(dataset.sensor_output.values, reading)
    numbers = gaussian(16, 0, 0, 501)[np.floor(time * 1000.0 + 1e-4).astype(int)]
    assert np.array_equal(dataset.noise_output.values, reading + 0.01 * numbers)
    steps = dataset.input_output.values / (10.0 / 4096)
    assert np.array_equal(steps, np.round(steps))
    assert np.array_equal(dataset.input_sample.values, np.ceil((time - 1.2e-5 - 1e-12) * 1000.0) - 1)
    impulse = dataset.body_contact_1_total_impulse.values[-1]
    assert dataset.body_contact_1_total_impulse.values[0] == 0.0
    shown = np.trapezoid(dataset.cell_output.values - 0.02, time) / 0.01
    assert shown == pytest.approx(impulse, rel=0.02)  # a half sine has five samples
    comes_back(tmp_path, "measuring_chain")


def test_a_ball_without_events_bounces_where_it_must(tmp_path: Path) -> None:
    shutil.copy(bouncing_ball(tmp_path), tmp_path / "BouncingBall.fmu")
    dataset = read_flat(ran(tmp_path, "bouncing_ball"))
    assert dataset.outcome.values[0] == Outcome.ok
    assert dataset.event_time.values[0] == pytest.approx(math.sqrt(2.0 / 9.81), abs=1e-10)
    comes_back(tmp_path, "bouncing_ball")


def test_a_campaign_over_a_single_component_finishes(tmp_path: Path, cluster: str) -> None:
    shutil.copy(bouncing_ball(tmp_path), tmp_path / "BouncingBall.fmu")
    expected = read_flat(ran(tmp_path, "bouncing_ball"))
    folder = tmp_path / "campaign"
    done = vibroimpact("campaign", tmp_path / "bouncing_ball.toml", "-o", folder, "--scheduler", cluster)
    assert done.returncode == 0, done.stderr
    dataset = read_flat(folder / "dataset.nc")
    assert np.array_equal(dataset.event_time.values, expected.event_time.values)
    assert np.array_equal(dataset.event_component.values, expected.event_component.values)
    assert dataset.event_component.flag_meanings == "ball"


def test_a_law_in_python_is_exported_by_the_command_line_and_answers(tmp_path: Path) -> None:
    pytest.importorskip("pythonfmu", reason="needs pip install 'vibroimpact[python-fmus]'")
    law = EXAMPLES / "user_contact_law.py"
    target = tmp_path / "user_contact_law.fmu"
    done = vibroimpact("fmu", "export", "user-contact-law", "--law", law, "-o", target)
    assert done.returncode == 0, done.stderr
    dataset = read_flat(ran(tmp_path, "user_contact_law"))
    assert np.allclose(np.diff(dataset.event_time.values), 2.0 * math.pi, atol=1e-9)
    comes_back(tmp_path, "user_contact_law")
