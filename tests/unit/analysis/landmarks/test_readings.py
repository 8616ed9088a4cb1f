from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from support.impact_sweep import SCENE, up_down_sweep

from vibroimpact.analysis import open_dataset, write_dataset
from vibroimpact.analysis.dataset import Outcome
from vibroimpact.analysis.landmarks import (
    ImpactOscillator,
    bifurcation_readings,
    folds,
    grazing_frequencies,
    period_doublings,
)
from vibroimpact.fmus.errors import DatasetError

THESIS = ImpactOscillator.from_scene(SCENE)
# Step .0125; one point is .001 above the period doubling, where transients alternate for a long time.
POINTS = 81


@pytest.fixture(scope="module")
def sweep(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    path = tmp_path_factory.mktemp("sweep") / "dataset.nc"
    write_dataset(up_down_sweep(POINTS, transient=60, recorded=12), path)
    return open_dataset(path)


def test_grazing_frequencies_are_those_of_the_thesis_oscillator() -> None:
    # 40-digit values of the closed form, sheet of equations 1.8 and 9.
    assert grazing_frequencies(THESIS) == pytest.approx((0.7106873690939, 1.2185743569476), abs=1e-13)


def test_the_lower_graze_keeps_its_digits_when_the_force_nearly_reaches_the_stop() -> None:
    oscillator = replace(THESIS, amplitude=1 - 1e-12)
    middle = 1 - 2 * 0.05**2
    # To first order in the small difference 1 - F^2/a^2.
    rest = 1 - oscillator.amplitude**2
    assert grazing_frequencies(oscillator)[0] == pytest.approx(math.sqrt(rest / (2 * middle)), rel=1e-9)


@pytest.mark.parametrize(("amplitude", "number"), [(0.05, 0), (0.5, 2), (1.5, 1)])
def test_the_number_of_grazes_follows_the_force(amplitude: float, number: int) -> None:
    assert len(grazing_frequencies(replace(THESIS, amplitude=amplitude))) == number


def test_p11_doubles_its_period_and_folds_where_the_multipliers_say() -> None:
    (doubling,) = period_doublings(THESIS, 0.72, 1.21)
    (fold,) = folds(THESIS, 1.22, 2.4)
    assert doubling.angular_frequency == pytest.approx(0.9364931207406931, abs=1e-13)
    assert fold.angular_frequency == pytest.approx(1.516611086118225, abs=1e-12)


def test_loci_pass_through_fresh_points_of_the_force_frequency_plane() -> None:
    # Sheet of equations 4.5: zeta=.04, a=.8, r=.75.
    fresh = ImpactOscillator(1.0, 0.08, 1.0, 0.450214238658253, 0.8, 0.75)
    (doubling,) = period_doublings(fresh, 0.86, 0.90)
    assert doubling.angular_frequency == pytest.approx(0.88, abs=1e-12)
    assert doubling.impact_velocity == pytest.approx(0.603188578597231, abs=1e-11)
    (fold,) = folds(replace(fresh, amplitude=0.180607698844102), 1.3, 1.4)
    assert fold.angular_frequency == pytest.approx(1.35, abs=1e-11)
    assert fold.impact_velocity == pytest.approx(0.914676801783975, abs=1e-10)


def test_landmarks_scale_with_the_natural_frequency_and_not_with_the_unit_of_length() -> None:
    scaled = ImpactOscillator(2.0, 2 * 0.05 * math.sqrt(2.0 * 800.0), 800.0, 0.5 * 800.0 * 1e-3, 1e-3, 0.7)
    assert grazing_frequencies(scaled) == pytest.approx(
        np.multiply(20.0, grazing_frequencies(THESIS)), rel=1e-12
    )
    (doubling,) = period_doublings(scaled, 20 * 0.72, 20 * 1.21)
    assert doubling.angular_frequency == pytest.approx(20 * 0.9364931207406931, rel=1e-12)


def test_a_scene_with_a_lower_stop_is_the_mirror_image() -> None:
    mirrored = SCENE.replace("position = 1.0", "position = -1.0").replace('"upper"', '"lower"')
    assert ImpactOscillator.from_scene(mirrored) == THESIS


def test_a_body_without_a_kind_is_an_oscillator() -> None:
    assert ImpactOscillator.from_scene(SCENE.replace('kind = "oscillator"\n', "")) == THESIS


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('kind = "oscillator"', 'kind = "beam"', "expected a forced oscillator with one stop"),
        ("[body]", "[bodies]", "expected a forced oscillator with one stop"),
        ("position = 1.0", "position = 0.0", "expected an impulsive stop at a positive distance"),
        ("damping_ratio = 0.05", "damping_ratio = 1.5", "expected damping_ratio < 1"),
    ],
)
def test_scenes_without_closed_form_landmarks_are_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        ImpactOscillator.from_scene(SCENE.replace(old, new))


def test_every_landmark_is_read_within_two_grid_steps(sweep: xr.Dataset) -> None:
    readings = bifurcation_readings(sweep)
    assert [reading.name for reading in readings] == [
        "lower graze",
        "loss of P(1,1) by period doubling",
        "upper graze",
        "fold of P(1,1)",
    ]
    assert [reading.exact for reading in readings] == pytest.approx(
        [0.7106873690939, 0.9364931207407, 1.2185743569476, 1.5166110861182], abs=1e-12
    )
    for reading in readings:
        assert reading.grid_step == pytest.approx(1.0 / (POINTS - 1))
        assert reading.steps <= 2, reading


def test_the_lower_graze_is_extrapolated_far_inside_one_grid_step(sweep: xr.Dataset) -> None:
    # Inverse squared amplitude is a parabola in squared frequency; only the decaying transient deviates.
    assert bifurcation_readings(sweep)[0].steps < 1e-3


def test_a_decaying_alternation_near_the_doubling_is_still_p11(sweep: xr.Dataset) -> None:
    near = sweep.vibroimpact.impacts(direction="down", angular_frequency=0.9375).impact_velocity.values
    assert np.ptp(near) > 1e-3
    assert bifurcation_readings(sweep)[1].value < 0.9375


def test_a_failed_run_beside_a_landmark_coarsens_the_grid_and_spoils_nothing(sweep: xr.Dataset) -> None:
    broken = sweep.load().copy(deep=True)
    at = {"direction": "up", "angular_frequency": broken["angular_frequency"].values[73]}
    broken["outcome"].loc[at] = Outcome.error
    broken["impact_count"].loc[at] = 0
    fold = bifurcation_readings(broken)[3]
    assert fold.grid_step == pytest.approx(2 / (POINTS - 1))
    assert fold.steps <= 1


def test_a_sweep_in_one_direction_is_refused_with_advice(sweep: xr.Dataset) -> None:
    with pytest.raises(DatasetError, match='Set path = "up-down"'):
        bifurcation_readings(sweep.sel(direction=["up"]))


def test_a_sweep_that_misses_a_landmark_says_which(sweep: xr.Dataset) -> None:
    with pytest.raises(DatasetError, match="fold: expected impacts to end within the up sweep"):
        bifurcation_readings(sweep.isel(angular_frequency=slice(0, 60)))
    with pytest.raises(DatasetError, match="lower graze: expected at least 3 non-impacting runs"):
        bifurcation_readings(sweep.isel(angular_frequency=slice(12, None)))
