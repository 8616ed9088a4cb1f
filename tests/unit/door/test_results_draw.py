"""`vi.draw` draws every result of the door: datasets of each kind, lists of orbits and of classes."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.text import Text
from support.command_line import in_this_process
from support.places import EXAMPLES
from support.replay_scenes import BOARD, hit

import vibroimpact as vi
from vibroimpact.analysis.figures.families import FAMILIES, Family, register
from vibroimpact.fmus.errors import DatasetError
from vibroimpact.orchestrator.hard_cases import measuring
from vibroimpact.orchestrator.orbits import basins, control, energies, lyapunov, maps, resonances, transients
from vibroimpact.orchestrator.study import effects
from vibroimpact.orchestrator.study.accuracy import results as accuracy

FORCED: dict[str, Any] = {
    "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.05},
    "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
    "stop": [{"position": 1.0, "restitution": 0.7}],
    "record": {"transient_periods": 100, "recorded_periods": 60},
}
OVER = {"forcing.angular_frequency": np.linspace(0.8, 1.1, 7)}
BOTH = OVER | {"stop[1].restitution": [0.7, 0.8]}
NO_SCENE = {"square-root"}
TABLES = (
    *(measuring.TABLE, basins.TABLE, control.TABLE, energies.TABLE, lyapunov.TABLE, resonances.TABLE),
    *(
        maps.STATES,
        maps.IMPACTS,
        maps.NORDMARK,
        maps.SQUARE_ROOT,
        effects.TABLE,
        accuracy.TABLE,
        transients.TABLE,
    ),
)


@pytest.fixture(scope="module")
def scene() -> vi.Scene:
    return vi.Scene.from_dict(FORCED)


@pytest.fixture(scope="module")
def runs(scene: vi.Scene) -> dict[str, xr.Dataset]:
    sweeps = {"one": {}, "swept": OVER, "map": BOTH}
    return {name: vi.run(scene.with_sweep(sweep), progress=False) for name, sweep in sweeps.items()}


def assert_shown(found: Any, *words: str) -> None:
    """Assert that the figure of a result has data on its axes, and these texts."""
    figure = vi.draw(found)
    axes = [axis for axis in figure.axes if axis.get_xlabel() or axis.get_ylabel()]
    assert any(axis.lines or axis.collections or axis.patches for axis in axes)
    texts = {text.get_text() for text in figure.findobj(Text)}
    assert set(words) <= texts, texts


RANGES = ("angular frequency (rad/s)", "displacement range (m)", "impact velocity (m/s)", "natural", "peaks")
OVER_PLANE = ("angular frequency (rad/s)", "restitution (-)")
OF_RUNS: tuple[tuple[Callable[[xr.Dataset], Any], str, tuple[str, ...]], ...] = (
    (vi.energies, "one", ("energy over the orbit (J)", "force", "damping", "impacts")),
    (vi.energies, "swept", ("angular frequency (rad/s)", "residual energy (J)", "mode 1")),
    (vi.lyapunov, "one", ("exponent, the largest first", "exponent per impact (-)")),
    (vi.lyapunov, "swept", ("angular frequency (rad/s)", "largest exponent per impact (-)")),
    (vi.lyapunov, "map", (*OVER_PLANE, "largest exponent per impact (-)")),
    (vi.classify, "one", ("impact velocity (m/s)", "strobe velocity (m/s)", "stop")),
    (vi.classify, "swept", ("angular frequency (rad/s)", "P(1,1)", "P(1,2)", "P(2,2)")),
    (vi.classify, "map", (*OVER_PLANE, "P(1,1)", "P(1,2)", "P(2,2)")),
    (vi.resonances, "swept", RANGES),
)


@pytest.mark.parametrize(
    ("study", "which", "words"), OF_RUNS, ids=[f"{study.__name__}-{which}" for study, which, _ in OF_RUNS]
)
def test_what_is_found_of_runs_is_drawn(
    study: Callable[[xr.Dataset], Any], which: str, words: tuple[str, ...], runs: dict[str, xr.Dataset]
) -> None:
    found = study(runs[which])
    assert_shown(found, *words)
    assert_shown(getattr(found, "dataset", found), *words)


PHASE = "forcing phase of an impact (rad)"
MAPS = {
    "impact": (PHASE, "velocity (m/s)", "long run", "stable focus P(1,1)"),
    "strobe": ("displacement (m)", "velocity (m/s)", "long run", "stable focus P(1,1)"),
    "discontinuity": (PHASE, "velocity (m/s)", "S", "W"),
    "nordmark": ("rho (-)", "X (-)", "forcing amplitude (N)"),
    "square-root": ("d (-)", "x (-)", "lambda 0.5"),
}


@pytest.mark.parametrize("kind", maps.MAP_KINDS)
def test_each_map_is_drawn(kind: str, scene: vi.Scene) -> None:
    found = vi.maps(None, kind) if kind in NO_SCENE else vi.maps(scene, kind, points=60)
    assert_shown(found, *MAPS[kind])


def test_basins_are_drawn_and_bear_their_kind(scene: vi.Scene, tmp_path: Path) -> None:
    found = vi.basins(scene, (-1.0, 1.0), (-1.0, 1.0), (6, 6))
    words = ("displacement start (m)", "velocity start (m/s)", "P(1,1): 100 % (90.3 to 100 %)")
    assert_shown(found, *words)
    vi.write_results(found, tmp_path / "basins.nc", kind=found.attrs["results_kind"])
    with vi.open_measured(tmp_path / "basins.nc") as opened:
        assert opened.attrs["results_kind"] == "basins"
        assert_shown(opened, *words)


@pytest.mark.skipif(importlib.util.find_spec("pythonfmu") is None, reason="the controller is in Python")
def test_a_kept_orbit_is_drawn(scene: vi.Scene) -> None:
    found = vi.control(scene, 1.0, 0.97, step=1e-2)
    assert_shown(found, "angular frequency (rad/s)", "impact velocity (m/s)", "kept", "unstable orbit")


def test_estimates_spikes_and_intervals_are_drawn() -> None:
    record = {"transient_periods": 50, "recorded_periods": 40}
    sampled = record | {"time_series": {"rate": 20, "variables": ["displacement"]}}
    run = vi.run(vi.Scene.from_dict(FORCED | {"record": sampled}), progress=False)
    tip = run.vibroimpact.samples().displacement
    impacts = vi.estimate_impacts(tip, vi.Forcing(angular_frequency=1.0), methods=("trajectory",))
    assert_shown(impacts, "restitution (-)", "damping ratio (-)", "trajectory", "fitted motion", "impacts")
    assert_shown(vi.spike_report(tip), "robust score (-)", "spike ends below", "threshold")
    decay = vi.estimate_decay(tip.copy(data=np.exp(-0.02 * tip.time) * np.cos(3.0 * tip.time)))
    assert_shown(decay, "frequency (Hz)", "damping ratio (-)", "best law", "turning points")
    intervals = vi.interval_report(np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 200)))
    assert_shown(intervals, "interval (s)", "density (1/s)", "peaks: 1")


def test_a_replay_is_drawn_before_it_is_written(tmp_path: Path) -> None:
    (tmp_path / "board.toml").write_text(BOARD)
    hit(tmp_path)
    found = vi.replay(tmp_path / "board.toml", tmp_path / "hit.nc")
    assert_shown(found, "time (ms)", "VAF (%)", "measured", "simulated", "hit.nc")
    assert found.attrs["results_kind"] == "replay"


def test_a_dataset_that_nobody_here_made_is_refused_by_what_it_lacks() -> None:
    with pytest.raises(
        DatasetError, match=r"expected runs \(run_index\) or a result .* got a dataset with neither"
    ):
        vi.draw(xr.Dataset({"a": ("x", [1.0, 2.0])}))


def test_transients_are_drawn(scene: vi.Scene) -> None:
    found = vi.transients(scene, starts=2)
    assert_shown(found, "periods of the force", "distance (-)", "body without impacts", "forgotten")


def test_hard_cases_are_drawn() -> None:
    found = vi.hard_cases("grazing-from-below")
    assert_shown(found, "grazing-from-below", "peak below the stop (-)", "impacts in 50 periods (-)")


def test_orbits_are_a_list_with_a_dataset_and_both_are_drawn(scene: vi.Scene) -> None:
    orbits = vi.find_orbits(scene, 1, 1)
    assert_shown(orbits, "displacement (m)", "velocity (m/s)", "P(1,1), stable")
    assert_shown(orbits.dataset, "recorded forcing period (-)", "displacement (m)", "impact velocity (m/s)")
    assert orbits.dataset.sizes["run"] == len(orbits)
    assert orbits.dataset.impact_velocity.values[0] == orbits[0].velocities[0]
    assert len(repr(orbits[0])) < 100
    assert repr(orbits[0]).startswith("<P(1,1), ")
    assert "<td>P(1,1)</td>" in orbits._repr_html_()
    none = type(orbits)([], orbits.units, dict)
    with pytest.raises(DatasetError, match="expected orbits, got none"):
        vi.draw(none)
    with pytest.raises(DatasetError, match="expected one that is nowhere beyond a stop, got none"):
        _ = none.dataset


def test_classes_are_a_list_with_the_dataset_of_the_command(
    runs: dict[str, xr.Dataset], tmp_path: Path
) -> None:
    vi.run(vi.Scene.from_dict(FORCED).with_sweep(BOTH), tmp_path / "runs.nc", progress=False)
    in_this_process("classify", str(tmp_path / "runs.nc"), "-o", str(tmp_path / "classes.nc"))
    found = vi.classify(runs["map"])
    assert len(found) == 14
    assert repr(found).startswith("<classes of 14 runs: ")
    names = [name for name in found.dataset.variables if str(name).startswith("class_")]
    with vi.open_dataset(tmp_path / "classes.nc") as opened:
        for name in names:
            xr.testing.assert_identical(found.dataset[name], opened[name])


def test_classes_of_no_run_on_a_grid_are_missing(runs: dict[str, xr.Dataset]) -> None:
    some = runs["map"].copy()
    some["run_id"] = some.run_id.where(some.run_id < 13, -1)
    classes = vi.classify(runs["map"])
    placed = type(classes)(classes[:13], some).dataset
    assert placed.class_kind.values.ravel().tolist().count(-1) == 1
    assert placed.class_reason.values.ravel().tolist().count("") >= 1


def test_every_table_of_results_is_of_a_kind_that_is_drawn() -> None:
    for table in TABLES:
        assert FAMILIES[table.kind].is_of_results
        assert all(rule.long_name and rule.unit for rule in table.rules.values())


def test_a_family_registers_once() -> None:
    with pytest.raises(ValueError, match="basins: expected a family of another name, got one twice"):
        register(Family("basins", "others", {}))


def test_a_variable_that_is_in_no_table_is_refused() -> None:
    with pytest.raises(DatasetError, match="lyapunov: speed: expected a variable of its table, got another"):
        lyapunov.TABLE.dataset({"speed": 1.0})


def test_orbits_of_one_frequency_are_seen_as_branches() -> None:
    figure = vi.draw(vi.find_orbits(EXAMPLES / "bifurcation.toml").dataset, "branches")
    assert {line.get_marker() for axis in figure.axes for line in axis.lines} == {"o"}
    assert figure.axes[0].get_ylabel() == "displacement range (-)"
