"""Energies and resonances of scenes, campaigns and datasets: by the commands and in Python, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_measured
from vibroimpact.fmus.errors import DatasetError

THESIS = ROOT / "examples" / "thesis"
CHAIN = """
[body]
kind = "chain"
masses = [1.0, 1.0]
stiffnesses = [1.0, 1.0]
dampings = [0.1, 0.1]
[forcing]
amplitude = [0.5, 0.0]
angular_frequency = 0.9
[[stop]]
mass = 2
position = 0.1
restitution = 0.7
[record]
transient_periods = 300
recorded_periods = 12
extrema = true
"""
SWEEP = '[sweep]\n"forcing.angular_frequency" = { start = 0.2, stop = 2.3, points = 43, path = "up-down" }\n'


@pytest.fixture(scope="module")
def swept() -> xr.Dataset:
    return vi.run(vi.Scene.from_text(CHAIN + SWEEP), progress=False)


@pytest.fixture
def scene_file(tmp_path: Path) -> Path:
    file = tmp_path / "chain.toml"
    file.write_text(CHAIN, encoding="utf-8")
    return file


def test_figure_6_15_by_the_command_says_who_gives_and_who_takes(tmp_path: Path) -> None:
    output, figure = tmp_path / "e.nc", tmp_path / "e.png"
    done = in_this_process("energies", THESIS / "figure_6_15.toml", "-o", output, "--figure", figure)
    assert done.returncode == 0, done.stderr
    assert "Impacts meet 0.310205 and lose 0.158204; identity (6.32) closed to" in done.stdout
    assert "Restitution from the residual energy: 0.7, -2.303 per unit" in done.stdout
    assert "0.859039" in done.stdout
    assert figure.stat().st_size > 10_000
    found = open_measured(output)
    assert found.identity_error.item() < 1e-14
    assert found.transient.item() < 1e-12
    np.testing.assert_allclose(found.impact_change, [-0.32460411, 0.16639966], atol=5e-9)
    again = in_this_process("plot", output, "-o", tmp_path / "again.svg")
    assert again.returncode == 0, again.stderr


def test_the_energies_of_a_chain_are_those_that_its_fmu_has_at_the_impacts() -> None:
    """The FMU's own energies of the modes, sampled on both sides of an impact, against the exact ones."""
    series = 'time_series = { rate = 20000, variables = ["modal_energy[1]", "modal_energy[2]"] }\n'
    run = vi.run(vi.Scene.from_text(CHAIN.replace("recorded_periods = 12", "recorded_periods = 2") + series))
    found = vi.energies(run)
    time, impact = run.time.values, run.vibroimpact.impacts().impact_time.values[0]
    place = int(np.searchsorted(time, impact))
    for mode in (1, 2):
        sampled = run[f"modal_energy_{mode}"].values
        exact = float(found.energy_before[0, mode - 1]), float(found.energy_after[0, mode - 1])
        # a sample is 1/20000 s off; in that time less than 5e-5 is exchanged
        assert (sampled[place - 1], sampled[place]) == pytest.approx(exact, abs=5e-5)


def test_a_campaign_has_energies_along_its_sweep_and_a_reason_where_it_has_none(swept: xr.Dataset) -> None:
    found = vi.energies(swept)
    assert found.residual_energy.dims == ("direction", "angular_frequency", "mode")
    has = found.reason == ""
    assert float(found.identity_error.max()) < 1e-12
    assert (np.isfinite(found.residual_energy).all("mode") == has).all()
    np.testing.assert_allclose(found.residual_restitution.where(has).values[has.values], 0.7, atol=1e-12)
    at = found.sel(direction="up")
    one = at.sel(angular_frequency=0.9, method="nearest")
    assert (one.impacts, one.periods) == (1, 1)
    assert str(at.sel(angular_frequency=0.2, method="nearest").reason.item()).startswith("sticking")
    assert at.sel(angular_frequency=2.3, method="nearest").reason.item() == "no impacts"
    # the gain of a mode from force and damping is its loss at impacts
    np.testing.assert_allclose(found.residual_energy, -found.impact_change, atol=1e-13)


def test_one_run_of_a_campaign_is_what_its_scene_alone_is(swept: xr.Dataset, tmp_path: Path) -> None:
    runs = swept.vibroimpact.runs
    place = int(np.argmin(np.abs(runs.angular_frequency.values - 0.9)))
    found = vi.energies(swept, run=int(runs.run_index[place]))
    alone = vi.energies(vi.run(vi.Scene.from_text(CHAIN)))
    np.testing.assert_allclose(found.energy_change, alone.energy_change, atol=1e-10)
    with pytest.raises(DatasetError, match="run: expected one of run_index 0 to 85, got 99"):
        vi.energies(swept, run=99)


def test_a_dataset_is_told_by_the_command_as_its_scene_is(tmp_path: Path) -> None:
    file = tmp_path / "swept.nc"
    vi.run(vi.Scene.from_text(CHAIN + SWEEP), file, progress=False)
    done = in_this_process("energies", file, "-o", tmp_path / "e.nc", "--figure", tmp_path / "e.png")
    assert done.returncode == 0, done.stderr
    assert "runs have energies of a periodic orbit" in done.stdout
    assert "without: sticking" in done.stdout
    peaks = in_this_process("resonances", file, "-o", tmp_path / "p.nc", "--figure", tmp_path / "p.png")
    assert peaks.returncode == 0, peaks.stderr
    assert (tmp_path / "p.png").stat().st_size > 10_000
    assert in_this_process("plot", tmp_path / "p.nc", "-o", tmp_path / "p.svg").returncode == 0
    refused = in_this_process("energies", file, "--set", "body.masses=[1,2]")
    assert refused.returncode == 2
    assert "--set: expected a scene, which can be changed, got a dataset" in refused.stderr


def test_a_beam_feeds_its_higher_modes_by_impacts_and_closes_the_identity() -> None:
    found = vi.energies(vi.run(THESIS / "figure_7_11.toml"))
    assert found.identity_error.item() < 1e-12
    assert (found.residual_energy.values > 0.0).tolist() == [True, False, False, False]
    assert found.residual_energy.attrs["units"] == "J"


def test_resonances_of_the_chain_are_told_with_their_motion_and_shift(swept: xr.Dataset) -> None:
    found = vi.resonances(swept)
    mine = found.isel(peak=(found.quantity == "mean_kinetic_energy_1") & (found.peak_branch == 0))
    main = mine.isel(peak=int(np.argmax(mine.peak_height.values)))
    # thesis: the main resonance at 1.17, close to double the first natural frequency
    assert main.peak_frequency.item() == pytest.approx(1.175, abs=0.03)
    assert main.motion.item() == "P(1,1)"
    depth = -float(
        swept.displacement_min.sel(direction="up").sel(angular_frequency=1.15, method="nearest").min()
    )
    assert main.stop_ratio.item() == pytest.approx(0.1 / depth, rel=0.1)
    assert main.shifted_frequency.values[0] == pytest.approx(
        0.618034 * np.pi / np.arccos(-main.stop_ratio.item())
    )


def test_resonances_of_a_stop_below_are_those_of_its_mirror_image(swept: xr.Dataset) -> None:
    below = CHAIN.replace("position = 0.1", 'position = -0.1\nside = "lower"') + "\n" + SWEEP
    found = vi.resonances(vi.run(vi.Scene.from_text(below), progress=False))
    mirror = vi.resonances(swept)
    np.testing.assert_allclose(found.displacement_range, mirror.displacement_range, rtol=0.2)
    first = found.isel(peak=found.quantity == "mean_kinetic_energy_1")
    other = mirror.isel(peak=mirror.quantity == "mean_kinetic_energy_1")
    np.testing.assert_allclose(first.stop_ratio.max(), other.stop_ratio.max(), rtol=1e-3)


def test_dashpots_that_couple_the_modes_pass_energy_between_them() -> None:
    one = vi.Scene.from_text(CHAIN).with_values({"body.dampings": [0.0, 0.3], "body.far_damping": 0.05})
    found = vi.energies(vi.run(one))
    assert float(found.identity_error) < 1e-12
    np.testing.assert_allclose(found.residual_energy, -found.impact_change, atol=1e-12)
    assert float(found.damping_loss.sum()) > 0.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("stop[1].law=hertz", "stop[1]"),
        ("forcing.angular_frequency=2.3", "expected a run with a periodic orbit, got none: no impacts"),
        ("forcing.angular_frequency=0.2", "got none: sticking: impacts without number"),
        ("record.impacts=false", "expected recorded impacts, got no impact_time"),
        ("record.recorded_periods=1", "got none: not periodic: 1 recorded impacts do not repeat"),
    ],
)
def test_scenes_without_energies_of_an_orbit_are_refused_in_one_line(
    change: str, message: str, scene_file: Path
) -> None:
    done = in_this_process("energies", scene_file, "--set", change)
    assert done.returncode == 2, done.stdout
    assert message in done.stderr
    assert done.stderr.strip().count("\n") <= 2


def test_resonances_need_a_sweep_of_the_frequency_alone(scene_file: Path, swept: xr.Dataset) -> None:
    done = in_this_process("resonances", scene_file)
    assert done.returncode == 2
    assert "expected a sweep of forcing.angular_frequency or forcing.frequency alone, got none" in done.stderr
    other = vi.Scene.from_text(CHAIN + '[sweep]\n"stop[1].position" = { values = [0.1, 0.2] }\n')
    with pytest.raises(DatasetError, match=r"got stop\[1\].position"):
        vi.resonances(vi.run(other, progress=False))


def test_what_is_no_dataset_of_a_scene_is_refused(swept: xr.Dataset, tmp_path: Path) -> None:
    bare = swept.copy()
    bare.attrs = {}
    with pytest.raises(DatasetError, match="expected the scene text in the attribute scene, got none"):
        vi.energies(bare)
    for command in ("energies", "resonances"):
        done = in_this_process(command, tmp_path / "absent.nc")
        assert done.returncode != 0
        assert "absent.nc" in done.stderr


def test_without_impacts_modes_have_the_kinetic_energy_of_their_steady_response() -> None:
    """The FMU's kinetic energy of a chain that swings free, averaged over whole periods, against the modes' own."""
    series = 'time_series = { rate = 400, variables = ["energy.kinetic"] }\n'
    lines = '[sweep]\n"forcing.angular_frequency" = { start = 2.2, stop = 2.4, points = 3 }\n'
    free = CHAIN.replace("position = 0.1", "position = 10.0") + series
    run = vi.run(vi.Scene.from_text(free + lines.replace("2.2", "0.5").replace("2.4", "0.7")), progress=False)
    found = vi.resonances(run)
    for place, rate in enumerate(found.forcing.values):
        sampled = run.vibroimpact.samples(angular_frequency=rate).energy_kinetic.values
        period = 2.0 * np.pi / rate * 400.0
        whole = sampled[: round(10 * period)]
        exact = sum(float(found[f"mean_kinetic_energy_{mode}"][0, place]) for mode in (1, 2))
        assert float(whole.mean()) == pytest.approx(exact, rel=1e-2)


def test_a_folder_or_file_will_do_in_python(tmp_path: Path) -> None:
    file = tmp_path / "run.nc"
    vi.run(vi.Scene.from_text(CHAIN), file)
    assert vi.energies(file).contact_mass.values == pytest.approx([1.0])
    with pytest.raises(DatasetError, match="alone, got none"):
        vi.resonances(file)
