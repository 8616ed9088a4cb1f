"""`vibroimpact estimate` as a person uses it: tables, dataset, figure, and its messages on misuse."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.decay_motion import Damped

from vibroimpact.analysis.recording import Channel, Recording, TimeAxis, write_recording
from vibroimpact.orchestrator.commands.cli import main
from vibroimpact.orchestrator.running import run_scene
from vibroimpact.orchestrator.scene import parse_scene

TIME = np.arange(0.0, 25.0, 0.05)
TRUTH = Damped(omega=4.0, viscous=0.03, coulomb=0.3)
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(scope="module")
def decay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("decay") / "decay.nc"
    noise = np.random.default_rng(0).normal(size=(2, len(TIME)))
    flags, axis = np.zeros(len(TIME), np.uint8), TimeAxis(TIME, 0.05)
    arm = Channel("arm", TRUTH.motion(10.0, TIME) + 0.03 * noise[0], "m", axis, flags)
    force = Channel("force", noise[1], "N", axis, flags)
    write_recording(Recording({"arm": arm, "force": force}), path)
    return path


def estimate(*arguments: str | Path) -> int:
    with pytest.raises(SystemExit) as left:
        main(["estimate", *map(str, arguments)])
    return int(left.value.code or 0)


def test_a_decay_is_printed_written_and_drawn(
    decay: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output, figure = tmp_path / "estimates.nc", tmp_path / "estimates.png"
    assert estimate("decay", decay, "--channel", "arm", "-o", output, "--figure", figure) == 0
    printed = capsys.readouterr().out
    assert "viscous + Coulomb has the lowest AIC." in printed
    assert "95 % interval" in printed
    assert "logarithmic decrement" in printed
    assert figure.read_bytes().startswith(PNG)
    with xr.open_dataset(output) as found:
        assert found.attrs["results_kind"] == "estimates"
        assert found.attrs["best_law"] == "viscous+coulomb"
        row = found.sel(estimator="law", quantity="coulomb")
        assert float(row.interval_low) < TRUTH.coulomb < float(row.interval_high)
        assert str(row.unit.values) == "m s-2"
        # The motion under the law is the measured motion except for its noise of .03.
        assert float(np.std(found.measured - found.law_fit)) == pytest.approx(0.03, rel=0.1)
        assert set(found.law.values) == {
            "viscous", "coulomb", "quadratic", "viscous+coulomb", "viscous+quadratic", "coulomb+quadratic",
            "viscous+coulomb+quadratic",
        }  # fmt: skip
        assert all(variable.attrs.get("long_name") for variable in found.variables.values())


def test_one_law_or_none_can_be_asked_for(decay: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert estimate("decay", decay, "--channel", "arm", "--law", "viscous", "--from", "0", "--to", "20") == 0
    assert "viscous was asked for." in capsys.readouterr().out
    assert estimate("decay", decay, "--channel", "arm", "--law", "none") == 0
    assert "Damping laws" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("decay", "expected one to be named, got 2: arm, force"),
        ("decay --channel arm --law dry", "expected a sum of viscous, coulomb, quadratic"),
        ("decay --channel arm --law none --from 70", "the channel runs from 0 to 24.95 s"),
        ("decay --channel arm --stop 1", "No such option: --stop"),
        ("impacts --channel arm", "--forcing-frequency: expected the frequency of the force, got none"),
        ("impacts --channel arm --amplitude 2 --angular-frequency 3", "--amplitude: expected --mass"),
        ("impacts --damping-ratio -1", "--damping-ratio: expected a number >= 0, got -1"),
        ("impacts --natural-frequency nan", "--natural-frequency: expected a number > 0, got nan"),
        ("impacts --mass 0", "--mass: expected a number > 0, got 0"),
        ("impacts --offset inf", "--offset: expected a finite number, got inf"),
        ("response", "--drive: expected the channel that drives, got none. Name it."),
        ("response --drive force --window flat", "--window: expected one of bartlett, hann, boxcar"),
        ("response --drive force --estimator h3", '--estimator: expected h1 or h2, got "h3".'),
        ("decay --channel arm -o /nowhere/estimates.nc", "expected a place where a file can be written"),
        ("decay --channel arm --run 3", "--run: expected none of a recording, got 3"),
        ("decay --channel arm --figure estimates.bmp", "expected a name ending in .png"),
    ],
)  # fmt: skip
def test_misuse_leaves_with_2_and_says_what_to_do(
    decay: Path, arguments: str, told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    kind, *options = arguments.split()
    assert estimate(kind, decay, *options) == 2
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("{} --kind impacts --stop 0.4 -o a.nc", "impacts {} --stop 0.4 -o a.nc"),
        ("--kind=response {} --drive force", "response {} --drive force"),
        ("{} --drive force --band 1 2", "response {} --drive force --band 1 2"),
        ("{} --forcing-frequency 10", "impacts {} --forcing-frequency 10"),
        ("{} --channel arm --law none", "decay {} --channel arm --law none"),
        # the data decide where the options leave the kind open
        ("{} --channel arm --from 3 -o a.nc", "decay {} --channel arm --from 3 -o a.nc"),
        ("--from 3 {}", "decay --from 3 {}"),
        (
            "absent.nc --run 1",
            "decay absent.nc --run 1, or vibroimpact estimate impacts absent.nc --run 1, "
            "or vibroimpact estimate response absent.nc --run 1",
        ),
    ],
)
def test_the_old_form_is_refused_with_the_command_to_write(
    decay: Path, old: str, new: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert estimate(*old.format(decay).split()) == 2
    told = capsys.readouterr().err
    assert told.endswith(f" Write: vibroimpact estimate {new.format(decay)}\n")
    assert len(told.splitlines()) == 1


def test_a_misspelt_kind_of_estimation_is_no_file_in_the_old_form(capsys: pytest.CaptureFixture[str]) -> None:
    assert estimate("decai", "a.nc") == 2
    assert "Did you mean 'decay'?" in capsys.readouterr().err


def test_a_simulated_free_decay_and_a_swept_resonance_need_no_options(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    free, swept = tmp_path / "free.nc", tmp_path / "swept.nc"
    run_scene(parse_scene(BODY + FREE, "free.toml"), free)
    assert estimate("decay", free, "--law", "none", "-o", tmp_path / "one.nc") == 0
    run_scene(parse_scene(BODY + SWEPT, "swept.toml"), swept)
    assert estimate("response", swept, "-o", tmp_path / "two.nc", "--figure", tmp_path / "two.png") == 0
    # Numbers of the scene: stiffness 800, mass 2, damping ratio .03.
    for name, method in (("one.nc", "exponential"), ("two.nc", "response")):
        with xr.open_dataset(tmp_path / name) as found:
            values = found.estimate.sel(estimator=method)
            assert float(values.sel(quantity="natural_angular_frequency")) == pytest.approx(20.0, rel=1e-9)
            assert float(values.sel(quantity="damping_ratio")) == pytest.approx(0.03, rel=1e-7)
    assert "modal constant" in capsys.readouterr().out
    assert (tmp_path / "two.png").read_bytes().startswith(PNG)


def test_an_impacting_run_takes_forcing_and_stop_from_its_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = tmp_path / "impacts.nc"
    run_scene(parse_scene(BODY + IMPACTING, "impacts.toml"), run)
    assert estimate("impacts", run, "-o", tmp_path / "found.nc", "--figure", tmp_path / "found.png") == 0
    assert "restitution" in capsys.readouterr().out
    with xr.open_dataset(tmp_path / "found.nc") as found:
        best = found.estimate.sel(estimator="trajectory")
        assert float(best.sel(quantity="restitution")) == pytest.approx(0.8, abs=1e-4)
        assert float(best.sel(quantity="damping_ratio")) == pytest.approx(0.03, abs=1e-4)
    assert (tmp_path / "found.png").read_bytes().startswith(PNG)


def test_each_run_of_a_sweep_of_the_stop_is_estimated_with_its_own_stop(tmp_path: Path) -> None:
    swept = tmp_path / "stops.nc"
    run_scene(parse_scene(BODY + IMPACTING + SWEPT_STOP, "stops.toml"), swept)
    assert estimate("impacts", swept, "--run", "1", "-o", tmp_path / "found.nc") == 0
    with xr.open_dataset(tmp_path / "found.nc") as found:
        best = found.estimate.sel(estimator="trajectory")
        # With the stop that the scene text has, the trajectories would not follow the motion.
        assert float(best.sel(quantity="restitution")) == pytest.approx(0.8, abs=1e-4)


def test_an_accelerated_base_is_the_force_of_the_mass_turned_round(tmp_path: Path) -> None:
    # The load per mass of the scene above, 4 N on 2 kg: relative to the base only the sign of the motion differs.
    based = IMPACTING.replace("amplitude = 4.0", 'kind = "base_acceleration"\namplitude = 2.0')
    run_scene(parse_scene(BODY + based, "base.toml"), tmp_path / "base.nc")
    assert estimate("impacts", tmp_path / "base.nc", "-o", tmp_path / "found.nc") == 0
    with xr.open_dataset(tmp_path / "found.nc") as found:
        best = found.estimate.sel(estimator="trajectory")
        assert float(best.sel(quantity="restitution")) == pytest.approx(0.8, abs=1e-4)
        assert float(best.sel(quantity="damping_ratio")) == pytest.approx(0.03, abs=1e-4)


def test_a_clock_that_drifts_has_its_frequency_fitted_when_asked_for(tmp_path: Path) -> None:
    run = tmp_path / "impacts.nc"
    run_scene(parse_scene(BODY + IMPACTING, "impacts.toml"), run)
    # The scene has 35 rad/s; the generator of an experiment would state another frequency.
    assert (
        estimate(
            "impacts", run, "--angular-frequency", "35.03", "--clock-drifts", "-o", tmp_path / "found.nc"
        )
        == 0
    )
    with xr.open_dataset(tmp_path / "found.nc") as found:
        best = found.estimate.sel(estimator="trajectory")
        assert float(best.sel(quantity="angular_frequency")) == pytest.approx(35.0, rel=1e-6)


BODY = """
[scene]
title = "an oscillator"
units = "SI"
[body]
kind = "oscillator"
mass = 2.0
stiffness = 800.0
damping_ratio = 0.03
displacement_start = -0.1
"""
FREE = """
[record]
transient_time = 0.0
recorded_time = 4.0
time_series = { rate = 100, variables = ["displacement"] }
"""
FORCED = """
[forcing]
amplitude = 4.0
angular_frequency = 35.0
"""
SWEPT = (
    FORCED
    + """
[record]
transient_periods = 250
recorded_periods = 2
extrema = true
[sweep]
"forcing.angular_frequency" = { start = 15.0, stop = 25.0, points = 31 }
"""
)
IMPACTING = (
    FORCED
    + """
[[stop]]
law = "restitution"
position = 0.0
side = "upper"
restitution = 0.8
[record]
transient_periods = 100
recorded_periods = 10
impacts = true
time_series = { rate = 1200, variables = ["displacement"] }
"""
)
SWEPT_STOP = """
[sweep]
"stop[1].position" = { values = [-0.002, 0.002] }
"""
