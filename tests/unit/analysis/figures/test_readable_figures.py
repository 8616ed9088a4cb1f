"""Readability of figures for a reviewer: layers, stops, classes, whole sentences, short instants."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from support.dataset_examples import dataset_of, opened, record
from support.impact_sweep import SCENE
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord
from vibroimpact.analysis.dataset.schema import CLASS_COLUMNS, OrbitClass
from vibroimpact.analysis.figures.sweep.classes import OTHER_COLOUR, OWN_COLOURS
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.hard_cases.loose import ball_in_cavity, symmetric_orbit

TWO_STOPS = SCENE + '[[stop]]\nposition = -1.0\nside = "lower"\nrestitution = 0.7\n'
NONDIMENSIONAL = {"units": "nondimensional"}


def long_run(turns: int, start: float = 0.0) -> xr.Dataset:
    """Return a run of circles of slowly varying size, 30 samples a turn."""
    phase = 2.0 * np.pi * np.arange(30 * turns) / 30
    size = 1.0 + 0.3 * np.sin(0.37 * phase)
    rows = np.column_stack([start + phase, size * np.sin(phase), size * np.cos(phase)])
    nothing = np.empty((0, 3))
    run = RunRecord(Outcome.ok, "", None, np.empty((0, 7)), nothing, rows, 0.0, 0.0, 0.0, 1e-3)
    return dataset_of([run], coordinates={}, attrs={"scene": SCENE}, **NONDIMENSIONAL)


def hits_of_two_stops(directions: list[Direction] | None = None) -> xr.Dataset:
    """Return a sweep of three runs: impacts on both stops, on the first, on the second."""
    runs = [record(float(k), impacts=4) for k in range(3)]
    for run, stops in zip(runs, ([1, 2, 1, 2], [1, 1, 1, 1], [2, 2, 2, 2]), strict=True):
        assert run.impacts is not None
        run.impacts[:, 4] = stops
    more = {"direction": directions} if directions else {}
    return dataset_of(runs, attrs={"scene": TWO_STOPS}, **NONDIMENSIONAL, **more)


@pytest.mark.parametrize("kind", ["run", "portrait"])
def test_turns_of_a_long_motion_are_layers_that_add_up(kind: str, tmp_path: Path) -> None:
    few = figures.draw(opened(long_run(12), tmp_path), kind)
    assert not [one for axis in few.axes for one in axis.collections if isinstance(one, LineCollection)]
    many = figures.draw(opened(long_run(200), tmp_path), kind)
    (layers,) = (one for one in many.axes[-1].collections if isinstance(one, LineCollection))
    assert len(layers.get_segments()) >= 199  # one line does not darken where it crosses itself
    assert layers.get_alpha() == pytest.approx(2.0 / np.sqrt(200), rel=0.01)
    points = np.concatenate([each for each in layers.get_segments()])
    assert points.min() >= -1.31
    assert many.axes[-1].get_xlim()[1] > 1.25  # all of it is in view


def bouncing(turns: int) -> xr.Dataset:
    """Return a run that meets its stop at 1 in each turn, 30 samples a turn."""
    phase = 2.0 * np.pi * np.arange(30 * turns) / 30
    rows = np.column_stack([phase, 1.0 - np.abs(np.sin(0.5 * phase)), -np.cos(0.5 * phase % np.pi)])
    hits = record(0.0, impacts=turns - 1).impacts
    assert hits is not None
    hits[:, 0] = 2.0 * np.pi * np.arange(1, turns) - 0.01
    run = RunRecord(Outcome.ok, "", None, hits, np.empty((0, 3)), rows, 0.0, 0.0, 0.0, 1e-3)
    return dataset_of([run], coordinates={}, attrs={"scene": SCENE}, **NONDIMENSIONAL)


@pytest.mark.parametrize(("turns", "are_joined"), [(12, True), (200, False)])
def test_jumps_of_a_long_motion_are_gaps_not_a_solid_band(
    turns: int, are_joined: bool, tmp_path: Path
) -> None:
    (axis,) = figures.draw(opened(bouncing(turns), tmp_path), "portrait").axes
    assert bool([line for line in axis.lines if line.get_linestyle() == ":"]) is are_joined
    assert len(axis.collections) == (0 if are_joined else 1)


def test_impacts_on_two_stops_have_two_colours_in_a_diagram(tmp_path: Path) -> None:
    axis = figures.draw(opened(hits_of_two_stops(), tmp_path), "bifurcation").axes[1]
    drawn = {str(line.get_label()): line for line in axis.lines}
    assert set(drawn) == {"stop 1", "stop 2"}
    assert len({to_rgb(line.get_color()) for line in drawn.values()}) == 2
    assert [len(np.asarray(line.get_xdata())) for line in drawn.values()] == [6, 6]
    assert axis.get_legend() is not None
    up_and_down = hits_of_two_stops([Direction.up, Direction.up, Direction.down])
    axis = figures.draw(opened(up_and_down, tmp_path), "bifurcation").axes[1]
    assert {str(line.get_label()) for line in axis.lines} >= {"up sweep, stop 1", "down sweep, stop 2"}


STRUCTURE = """[[body]]
name = "frame"
[[body]]
name = "ball"
[[stop]]
at = "frame"
position = 1.0
[[contact]]
between = ["frame", "ball"]
"""


def test_contacts_of_several_bodies_are_named_by_their_points(tmp_path: Path) -> None:
    sweep = hits_of_two_stops()
    sweep.attrs["scene"] = STRUCTURE
    axis = figures.draw(opened(sweep, tmp_path), "bifurcation").axes[1]
    assert {str(line.get_label()) for line in axis.lines} == {"stop 1", "frame - ball"}
    coupled = sweep.isel(run=slice(None))
    coupled.attrs["scene"] = "[component.a]"
    coupled["impact_contact"].attrs.update(flag_values=np.array([1, 2], dtype=np.int8), flag_meanings="a b")
    axis = figures.draw(opened(coupled, tmp_path), "bifurcation").axes[1]
    assert {str(line.get_label()) for line in axis.lines} == {"a", "b"}


def test_lines_of_several_bodies_name_their_points(tmp_path: Path) -> None:
    names = ["displacement", "velocity", "contact_displacement[2]", "contact_force[2]"]
    scene = vi.Scene.from_file(EXAMPLES / "impact_damper_cavity.toml").with_values(
        {"record": {"recorded_periods": 8, "time_series": {"rate": 20, "variables": names}}}
    )
    run = vi.run(scene)
    labels = [{str(line.get_label()) for line in axis.lines} for axis in figures.draw(run).axes]
    assert {"frame", "ball relative to frame"} <= labels[0]
    assert "frame" in labels[1]
    assert "ball and frame" in labels[2]
    assert run.impact_contact.attrs["flag_meanings"] == run.stick_contact.attrs["flag_meanings"]
    assert run.impact_contact.attrs["flag_meanings"] == "contact_1 contact_2"


def test_extremes_of_all_periods_together_are_no_period(tmp_path: Path) -> None:
    scene = vi.Scene.from_file(EXAMPLES / "inverted_pendulum.toml").unswept()
    together = vi.run(scene.with_values({"record.each_period": False, "record.transient_periods": 10}))
    axis = figures.draw(together, "run").axes[0]
    assert axis.get_xlabel() == "all recorded forcing periods together"
    assert [str(line.get_label()) for line in axis.lines].count("stop") == 1


def test_a_portrait_draws_the_stops_of_its_point_alone() -> None:
    (phase, _), scene = symmetric_orbit(0.1, 1.4), vi.Scene.from_dict(ball_in_cavity(0.1, 1.4))
    cavity = vi.find_orbits(scene, seed=[(phase, 1), (phase + np.pi, 2)])
    assert [orbit.full_name for orbit in cavity][:1] == ["P(2,1), 1 at contact 1, 1 at contact 2"]
    assert len(figures.draw(cavity).axes[0].lines) == len(cavity)  # a clearance is no place of the frame
    one = vi.find_orbits(vi.Scene.from_file(EXAMPLES / "single_run.toml"), 1)
    assert len(figures.draw(one).axes[0].lines) == len(one) + 1


def classified(kinds: list[tuple[OrbitClass, int, int]], runs: list[RunRecord]) -> xr.Dataset:
    columns = {
        "class_kind": np.array([int(kind) for kind, _, _ in kinds], dtype=np.int8),
        "class_impacts": np.array([impacts for _, impacts, _ in kinds], dtype=np.int32),
        "class_periods": np.array([periods for _, _, periods in kinds], dtype=np.int32),
        CLASS_COLUMNS[-1]: np.array([""] * len(kinds), dtype=object),
    }
    return dataset_of(runs, attrs={"scene": TWO_STOPS}, measured=columns, **NONDIMENSIONAL)


def test_a_class_names_the_only_stop_that_its_runs_hit(tmp_path: Path) -> None:
    runs = [record(float(k), impacts=4) for k in range(3)]
    for run, stops in zip(runs, ([1, 2, 1, 2], [1, 1, 1, 1], [2, 2, 2, 2]), strict=True):
        assert run.impacts is not None
        run.impacts[:, 4] = stops
    kinds = [(OrbitClass.periodic, 2, 1), (OrbitClass.periodic, 1, 1), (OrbitClass.periodic, 1, 1)]
    figure = figures.draw(opened(classified(kinds, runs), tmp_path), "classes")
    names = [text.get_text() for text in figure.legends[0].get_texts()]
    assert names == ["P(1,1) at stop 1", "P(1,1) at stop 2", "P(2,1)"]


def test_rare_classes_are_not_taken_for_chaos(tmp_path: Path) -> None:
    kinds = [(OrbitClass.periodic, k, 1) for k in range(1, 13)] + [(OrbitClass.chaos, -1, -1)]
    runs = [record(float(k)) for k in range(len(kinds))]
    figure = figures.draw(opened(classified(kinds, runs), tmp_path), "classes")
    colours = {
        text.get_text(): np.array(to_rgb(patch.get_facecolor()))
        for text, patch in zip(figure.legends[0].get_texts(), figure.legends[0].get_patches(), strict=True)
    }
    assert {"other", "chaos"} <= set(colours)

    def lightness(colour: np.ndarray) -> float:
        return float(colour @ [0.2126, 0.7152, 0.0722])

    assert lightness(colours["other"]) - lightness(colours["chaos"]) > 0.4
    for own in OWN_COLOURS.values():
        assert np.abs(np.array(to_rgb(own)) - to_rgb(OTHER_COLOUR)).max() > 0.1


def test_what_effects_change_is_written_out(tmp_path: Path) -> None:
    words = "loses 69 of 69 impacts, 6 impacts more, and the time of the last is 12.5 % later"
    dataset = xr.Dataset(
        {
            "name": ("effect", np.array(["forcing", "damping"], dtype=object)),
            "share": ("effect", np.array([0.2, 0.1])),
            "seconds": (("effect", "pair"), np.full((2, 3), 0.1)),
            "run_seconds": ("effect", np.ones(2)),
            "changes": ("effect", np.array([words, "nothing"], dtype=object)),
            "displacement_range": (("effect", "end"), np.array([[1.0, 0.2], [np.nan, np.nan]])),
        },
        attrs={"results_kind": "effects"},
    )
    figure = figures.draw(dataset)
    (axis,) = figure.axes
    shown = {text.get_text().replace("\n", " "): text for text in axis.texts}
    assert set(shown) == {f"{words} range \N{MINUS SIGN}80 %", "nothing"}
    assert all(text.get_fontsize() >= 6 for text in axis.texts)
    figure.draw_without_rendering()
    box = axis.get_window_extent()
    extents = [text.get_window_extent() for text in axis.texts]
    assert all(box.x0 < each.x0 and each.x1 <= box.x1 for each in extents)
    assert all(box.y0 < each.y0 and each.y1 < box.y1 for each in extents)
    assert extents[0].y0 > extents[1].y1  # no text is written over another
    assert max(axis.get_xticks()) == 100.0 < axis.get_xlim()[1]  # no share is more than all


def ticks(figure: figures.Figure) -> list[str]:
    figure.draw_without_rendering()
    return [text.get_text() for text in figure.axes[1].get_xticklabels()]


def test_time_counts_from_the_first_sample_after_a_long_transient(tmp_path: Path) -> None:
    early, late = (figures.draw(opened(long_run(6, start), tmp_path), "run") for start in (0.0, 2100.53))
    assert early.axes[1].get_xlabel() == "time (-)"
    assert late.axes[1].get_xlabel() == "time from 2100.53 on (-)"
    assert [tick for tick in ticks(late) if tick] == [tick for tick in ticks(early) if tick]
    asked = figures.draw(opened(long_run(6, 2100.53), tmp_path), "run", start=2110.0, stop=2130.0)
    assert asked.axes[1].get_xlabel() == "time (-)"
    assert "2120" in ticks(asked)
    assert (
        float(np.asarray(late.axes[1].lines[0].get_xdata()).min()) >= 2100.53
    )  # data stay those of the file


@pytest.mark.parametrize("variable", ["displacement_max", "strobe_velocity", "impact_phase"])
def test_a_diagram_draws_the_variable_that_is_asked_for(variable: str, tmp_path: Path) -> None:
    dataset = opened(hits_of_two_stops(), tmp_path)
    (axis,) = figures.draw(dataset, variable=variable).axes
    drawn = np.concatenate([np.asarray(line.get_ydata()) for line in axis.lines])
    assert variable.replace("_", " ") in axis.get_ylabel()
    values = dataset[variable].values.ravel()
    np.testing.assert_array_equal(np.sort(drawn), np.sort(values[np.isfinite(values)]))


def test_a_variable_that_was_not_recorded_is_refused_with_those_that_were(tmp_path: Path) -> None:
    dataset = opened(hits_of_two_stops(), tmp_path)
    with pytest.raises(
        DatasetError, match=r"variable: expected one that the sweep recorded \(displacement_range"
    ):
        figures.draw(dataset, variable="impact_run")
    with pytest.raises(UsageError, match=r"variable: expected none .*It goes with bifurcation, branches"):
        figures.draw(dataset, "strobe", variable="displacement_max")
