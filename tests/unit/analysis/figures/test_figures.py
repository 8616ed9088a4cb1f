"""Figures of runs and sweeps: axes, colours, legends, and what a run or a map shows."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from support.campaign_scenes import scene_of
from support.command_line import in_this_process
from support.dataset_examples import coupled_dataset, coupled_record, dataset_of, opened, record, up_down
from support.figure_texts import smallest_font, texts
from support.impact_sweep import SCENE, Oscillator

import vibroimpact as vi
from vibroimpact.analysis import figures, open_dataset
from vibroimpact.analysis.dataset import Direction, Outcome, RunRecord
from vibroimpact.analysis.dataset.derived import largest_impact_velocity
from vibroimpact.analysis.figures.scene_text import fixed_positions, limits
from vibroimpact.fmus.errors import DatasetError, UsageError
from vibroimpact.orchestrator.running import run_scene

PNG = b"\x89PNG\r\n"


def sampled_run() -> xr.Dataset:
    """One period of the P(1,1) motion at angular frequency 1, sampled, with its impact."""
    oscillator = Oscillator(1.0, 0.0, 0.0)
    for _ in range(100):
        oscillator.advance(None, 0.0)
    start = (oscillator.displacement, oscillator.velocity)
    impacts: list[list[float]] = []
    oscillator.advance(impacts, 0.0)
    before = impacts[0][0]
    rows = []
    for t in np.linspace(0.0, oscillator.period, 200):
        if t < before:
            rows.append([t, *oscillator.flow(*start, 0.0, t)])
        else:
            rows.append([t, *oscillator.flow(1.0, -0.7 * impacts[0][2], before, t - before)])
    run = RunRecord(
        Outcome.ok, "", None, np.array(impacts[:1]), np.empty((0, 3)), np.array(rows), 0.0, 0.0, 0.0, 1e-3
    )
    return dataset_of([run], coordinates={}, units="nondimensional", attrs={"scene": SCENE})


BOUNCES = np.sqrt(2.0 / 9.81) * np.array([1.0, 2.4, 3.38])


def bouncing_ball() -> xr.Dataset:
    """A ball dropped from 1 m that loses 30 % of its velocity at each bounce, sampled; another rests."""
    rows = []
    for t in np.linspace(0.0, BOUNCES[-1], 300):
        bounce = int(np.searchsorted(BOUNCES, t, side="right"))
        begin = BOUNCES[bounce - 1] if bounce else -BOUNCES[0]
        up = 0.7**bounce * 9.81 * BOUNCES[0]
        age = t - begin
        rows.append([t, up * age - 9.81 * age**2 / 2, up - 9.81 * age, 0.2, 0.1])
    events = np.column_stack([BOUNCES[:2], np.zeros(2), np.ones(2)])
    run = RunRecord(
        Outcome.ok, "", None, None, None, np.array(rows), np.nan, np.nan, np.nan, 1e-3, events=events
    )
    names = ["ball.h", "ball.v", "other.h", "other.energy[1].kinetic"]
    return coupled_dataset(
        [run],
        coordinates={},
        sample_variables=names,
        unit_of=dict(zip(names, ["m", "m/s", "m", "J"], strict=True)),
        event_components=["ball", "other"],
        connections=(),
    )


def test_a_bifurcation_diagram_is_one_column_wide_with_fonts_that_can_be_read(tmp_path: Path) -> None:
    figure = figures.draw(opened(up_down(), tmp_path))
    assert figure.get_figwidth() == pytest.approx(85 / 25.4)
    assert smallest_font(figure) >= 7


def test_axes_name_quantities_and_units(tmp_path: Path) -> None:
    assert texts(figures.draw(opened(up_down(), tmp_path))) == [
        "displacement range (m)",
        "angular frequency (rad/s)",
        "impact velocity (m/s)",
    ]


def test_nondimensional_axes_say_so(tmp_path: Path) -> None:
    runs = [record(float(k), impacts=1) for k in range(3)]
    figure = figures.draw(opened(dataset_of(runs, units="nondimensional"), tmp_path))
    assert "angular frequency (-)" in texts(figure)


def test_up_and_down_differ_in_colour_and_marker_and_the_legend_covers_no_point(tmp_path: Path) -> None:
    figure = figures.draw(opened(up_down(), tmp_path))
    up, down = figure.axes[0].get_lines()
    assert up.get_color() != down.get_color()
    assert up.get_marker() != down.get_marker()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["up sweep", "down sweep"]
    figure.draw_without_rendering()
    below = legend.get_window_extent().y0
    assert all(axis.get_window_extent().y1 <= below for axis in figure.axes)


def test_every_impact_is_one_point_at_the_parameter_of_its_run(tmp_path: Path) -> None:
    figure = figures.draw(opened(up_down(), tmp_path))
    up, down = figure.axes[1].get_lines()
    assert up.get_xdata().tolist() == [0.0, 1.0, 1.0, 2.0, 2.0, 2.0]
    assert down.get_xdata().tolist() == [2.0] * 4 + [1.0] * 5 + [0.0] * 6


def test_a_selection_of_a_dataset_draws_only_its_own_impacts(tmp_path: Path) -> None:
    chosen = opened(up_down(), tmp_path).sel(direction=["down"]).isel(angular_frequency=slice(0, 2))
    (down,) = figures.draw(chosen).axes[1].get_lines()
    assert sorted(down.get_xdata().tolist()) == [0.0] * 6 + [1.0] * 5


def test_two_swept_parameters_give_colour_maps_of_the_grid(tmp_path: Path) -> None:
    mass, position = np.meshgrid([1.0, 2.0], [0.1, 0.2, 0.3], indexing="ij")
    runs = [record(float(k), impacts=k) for k in range(6)]
    grid = {"mass": mass.ravel(), "position": position.ravel()}
    dataset = opened(dataset_of(runs, coordinates=grid), tmp_path)
    largest = largest_impact_velocity(dataset)
    np.testing.assert_allclose(largest, [[np.nan, 1.0, 2.01], [3.02, 4.03, 5.04]])
    figure = figures.draw(dataset)
    assert {"mass (kg)", "position (m)", "largest impact velocity (m/s)"} <= set(texts(figure))


def test_a_map_of_an_up_down_sweep_has_a_column_for_each_direction(tmp_path: Path) -> None:
    grid = {"mass": np.array([1.0, 1.0, 2.0, 2.0] * 2), "position": np.array([0.1, 0.2] * 4)}
    directions = [Direction.up] * 4 + [Direction.down] * 4
    runs = [record(float(k), impacts=1) for k in range(8)]
    figure = figures.draw(opened(dataset_of(runs, coordinates=grid, direction=directions), tmp_path))
    assert {axis.get_title() for axis in figure.axes} >= {"up sweep", "down sweep"}


def test_the_points_of_a_crowd_are_small_and_faint_and_all_there(tmp_path: Path) -> None:
    # 300 impacts of chaos next to 300 of one periodic orbit and three of another
    runs = [record(1.0, impacts=300), record(2.0, impacts=300), record(3.0, impacts=3)]
    assert runs[1].impacts is not None
    runs[1].impacts[:, 2] = 2.0
    axis = figures.draw(opened(dataset_of(runs), tmp_path)).axes[1]
    single = np.concatenate([line.get_xdata() for line in axis.get_lines()])
    (dots,) = axis.collections
    assert single.tolist() == [1.0] * 300 + [2.0] * 3
    assert len(dots.get_offsets()) == 300
    assert np.all(dots.get_alpha() < 0.5)


def noisy(count: int, missing: tuple[int, ...] = ()) -> list[RunRecord]:
    """Runs on one orbit, whose numbers differ by rounding; some without an impact."""
    runs = [record(3.0037242956, impacts=0 if k in missing else 1) for k in range(count)]
    for k, run in enumerate(runs):
        assert run.periods is not None
        run.periods[:, 0] *= 1.0 + 4e-16 * (k % 3)
    return runs


def test_a_map_of_rounding_is_one_colour_and_says_so(tmp_path: Path) -> None:
    # drawn over its own range of 3e-15, the map looked like a fractal basin
    grid = {"mass": np.repeat([1.0, 2.0, 3.0], 3), "position": np.tile([0.1, 0.2, 0.3], 3)}
    figure = figures.draw(opened(dataset_of(noisy(9, missing=(4,)), coordinates=grid), tmp_path))
    above, below, bar, _ = figure.axes
    (mesh,) = above.collections
    assert mesh.get_clim()[1] - mesh.get_clim()[0] > 1.0
    assert above.get_title() == "one value, to 1e-09 of it"
    assert len(bar.get_yticks()) == 1
    assert below.get_title() == "one value, to 1e-09 of it; gray: no impact"


def test_a_diagram_of_rounding_keeps_its_points_within_the_frame(tmp_path: Path) -> None:
    runs = noisy(4)
    figure = figures.draw(opened(dataset_of(runs), tmp_path))
    for axis in figure.axes:
        for line in axis.get_lines():
            assert np.max(line.get_ydata()) < 0.99 * axis.get_ylim()[1]
        assert axis.get_title(loc="left").startswith("one value, to 1e-09 of it: ")


GAP = """
[scene]
units = "nondimensional"
[body]
mass = 1.0
stiffness = 1.0
damping_ratio = 0.05
[forcing]
amplitude = 0.5
angular_frequency = 0.8
[[stop]]
position = 0.5
restitution = 0.8
[[stop]]
side = "lower"
position = -0.5
restitution = 0.8
[record]
transient_periods = 50
recorded_periods = 4
[sweep]
"forcing.angular_frequency" = { values = [0.5, 1.0, 1.5] }
"""


@pytest.mark.parametrize(
    ("first", "second", "axis", "edges"),
    [
        ([0.2, 0.8, 0.4], [-0.2, -0.8, -0.4], "stop 1 position (-)", [0.1, 0.3, 0.6, 1.0]),
        ([0.2, 0.2, 0.4], [-0.2, -0.8, -0.4], "stop 2 position (-)", [-1.0, -0.6, -0.3, -0.1]),
        ([0.2, 0.2, 0.4], [-0.2, -0.8, -0.8], "place along gap (-)", [-0.5, 0.5, 1.5, 2.5]),
    ],
)
def test_a_map_of_keys_that_move_together_has_the_values_of_one_that_tells_its_points_apart(
    tmp_path: Path, first: list[float], second: list[float], axis: str, edges: list[float]
) -> None:
    sweep = "".join(
        f'"stop[{k}].position" = {{ values = {values}, zip = "gap" }}\n'
        for k, values in ((1, first), (2, second))
    )
    run_scene(scene_of(GAP + sweep), tmp_path / "gap.nc")
    in_this_process("classify", str(tmp_path / "gap.nc"), "-o", str(tmp_path / "classes.nc"))
    with open_dataset(tmp_path / "classes.nc") as dataset:
        for kind in ("map", "classes"):
            panel = figures.draw(dataset, kind).axes[0]
            (cells,) = panel.collections
            assert panel.get_ylabel() == axis
            np.testing.assert_allclose(cells.get_coordinates()[:, 0, 1], edges, atol=1e-12)
        # the row of a value is the row of its runs
        (cells,) = figures.draw(dataset, "map").axes[0].collections
        place = np.argsort(dataset.gap.values)
        np.testing.assert_array_equal(cells.get_array(), dataset.displacement_range.values[:, place].T)


@pytest.mark.parametrize(
    ("keys", "x"),
    [
        (("body.velocity_start", "body.displacement_start"), "displacement start (m)"),
        (("stop[1].restitution", "forcing.angular_frequency"), "restitution (-)"),
        (("forcing.angular_frequency", "stop[1].restitution"), "angular frequency (rad/s)"),
    ],
)
def test_a_map_has_the_first_key_of_the_scene_across_and_a_phase_plane_its_displacement(
    tmp_path: Path, keys: tuple[str, str], x: str
) -> None:
    names = [key.rpartition(".")[2] for key in keys]
    grid = {name: values for name, values in zip(names, ([1.0, 1.0, 2.0, 2.0], [0.1, 0.2] * 2), strict=True)}
    scene = "[sweep]\n" + "".join(f'"{key}" = {{ values = [1] }}\n' for key in keys)
    dataset = dataset_of(
        [record(float(k), impacts=1) for k in range(4)],
        coordinates={name: np.array(values) for name, values in grid.items()},
        unit_of={"displacement_start": "m", "velocity_start": "m s-1"},
        attrs={"scene": scene},
    )
    figure = figures.draw(opened(dataset, tmp_path))
    assert figure.axes[1].get_xlabel() == x


def test_a_run_shows_its_stop_and_a_velocity_that_breaks_at_the_impact(tmp_path: Path) -> None:
    figure = figures.draw(opened(sampled_run(), tmp_path))
    above, middle, below = figure.axes
    assert [line.get_ydata() for line in above.get_lines() if line.get_linestyle() == "--"] == [[1.0, 1.0]]
    velocity = middle.get_lines()[0].get_ydata()
    assert np.isnan(velocity).sum() == 1
    marks = below.get_lines()[1]
    # The impact of the P(1,1) motion at zeta = .05 is on the stop, moving into it.
    assert marks.get_xdata() == pytest.approx([1.0])
    assert marks.get_ydata()[0] > 0.5
    assert smallest_font(figure) >= 7


def test_a_run_without_time_series_shows_its_periods(tmp_path: Path) -> None:
    figure = figures.draw(opened(up_down().drop_dims("sample").drop_vars("sample_count"), tmp_path), "run", 4)
    assert texts(figure)[0] == "recorded forcing period (-)"
    assert "impact velocity (m/s)" in texts(figure)


def test_variables_of_components_have_a_panel_for_each_unit_and_a_line_at_each_event(tmp_path: Path) -> None:
    figure = figures.draw(opened(bouncing_ball(), tmp_path))
    heights, speeds, energy = figure.axes
    assert texts(figure) == ["h (m)", "ball.v (m/s)", "time (s)", "kinetic (J)"]
    assert [line.get_label() for line in heights.get_lines()] == ["ball.h", "other.h"]
    assert len({line.get_color() for line in heights.get_lines()}) == 2
    for axis in (heights, speeds, energy):
        (events,) = axis.collections
        assert [segment[0, 0] for segment in events.get_segments()] == pytest.approx(BOUNCES[:2])
    legends = [
        [text.get_text() for text in axis.get_legend().get_texts()] if axis.get_legend() else []
        for axis in figure.axes
    ]
    # A name that is too long for the axis stands above it.
    assert legends == [["ball.h", "other.h", "event"], [], ["other.energy[1].kinetic"]]
    assert smallest_font(figure) >= 7


def test_variables_without_any_event_are_drawn_alone(tmp_path: Path) -> None:
    dataset = bouncing_ball().drop_dims("event").drop_vars("event_count")
    figure = figures.draw(opened(dataset, tmp_path), "run")
    assert [len(axis.collections) for axis in figure.axes] == [0, 0, 0]
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == ["ball.h", "other.h"]


def test_one_run_of_a_sweep_over_components_is_drawn_by_its_index() -> None:
    runs = [coupled_record(float(k), events=k, samples=4) for k in range(3)]
    with pytest.raises(DatasetError, match="expected one run, got 3"):
        figures.draw(coupled_dataset(runs), "run")
    figure = figures.draw(coupled_dataset(runs), run=2)
    assert figure.axes[0].get_lines()[0].get_xdata().tolist() == [2.0, 3.0, 4.0, 5.0]
    assert len(figure.axes[0].collections[0].get_segments()) == 2


@pytest.mark.parametrize(
    ("kind", "run", "message"),
    [
        ("run", None, "expected one run, got 6. Name one by its run_index (run): 0, 1, 2, 3, 4, 5."),
        ("auto", 99, "expected one run of those there are (0, 1, 2, 3, 4, 5), got none of run_index 99."),
        ("bifurcation", 2, "run: expected none for a dataset of runs drawn as bifurcation, got one."),
    ],
)
def test_a_run_must_be_named_among_several_and_is_never_left_out(
    kind: str, run: int, message: str, tmp_path: Path
) -> None:
    dataset = up_down().drop_dims("sample").drop_vars("sample_count")
    with pytest.raises((DatasetError, UsageError), match=re.escape(message)):
        figures.draw(opened(dataset, tmp_path), kind, run)


def test_a_bifurcation_of_a_single_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="expected one swept parameter, got 0"):
        figures.draw(opened(sampled_run(), tmp_path), "bifurcation")


@pytest.mark.parametrize(("ending", "start"), [("png", PNG), ("pdf", b"%PDF"), ("svg", b"<?xml")])
def test_the_ending_chooses_the_format(ending: str, start: bytes, tmp_path: Path) -> None:
    figures.save(figures.draw(opened(up_down(), tmp_path)), tmp_path / f"figure.{ending}")
    assert (tmp_path / f"figure.{ending}").read_bytes().startswith(start)


def test_more_than_displacement_and_velocity_is_drawn_in_panels_by_unit_with_modal_energies_apart(
    tmp_path: Path,
) -> None:
    names = [
        "displacement",
        "velocity",
        "displacement[2]",
        "energy.kinetic",
        "modal_energy[1]",
        "modal_energy[2]",
    ]
    time = np.linspace(0.0, 1.0, 20)
    run = RunRecord(
        Outcome.ok,
        "",
        None,
        np.array([[0.25, 1.0, 0.5, 0.8, 1.0, 0.7, 0.0]]),
        np.empty((0, 3)),
        np.column_stack([time, *(np.sin(k * time) for k in range(1, 7))]),
        0.0,
        0.0,
        0.0,
        1e-3,
    )
    figure = figures.draw(opened(dataset_of([run], coordinates={}, sample_variables=names), tmp_path))
    panels = [(axis.get_ylabel().split()[-1], len(axis.get_lines())) for axis in figure.axes]
    assert sorted(panels) == [("(J)", 1), ("(J)", 2), ("(m)", 2), ("(m/s)", 1)]
    assert figure.axes[-1].get_xlabel() == "time (s)"


@pytest.mark.parametrize(
    ("names", "shown"), [(["contact_force"], [2]), (["contact_force[1]", "contact_force[2]"], [1, 1])]
)
def test_largest_forces_of_contacts_are_drawn_beside_their_samples(
    names: list[str], shown: list[int], tmp_path: Path
) -> None:
    time = np.linspace(0.0, 1.0, 20)
    hits = [[0.25, 1.0, 0.5, 0.8, 1.0, 0.7, 0.02, 9.0], [0.61, 1.0, 0.5, 0.8, 2.0, 0.7, 0.02, 5.0]]
    hits.append([0.98, 1.0, 0.5, np.nan, 1.0, np.nan, np.nan, np.nan])  # open at the end
    samples = np.column_stack([time, *(np.sin(time) for _ in names)])
    run = RunRecord(Outcome.ok, "", None, np.array(hits), np.empty((0, 3)), samples, 0.0, 0.0, 0.0, 1e-3)
    figure = figures.draw(opened(dataset_of([run], coordinates={}, sample_variables=names), tmp_path))
    (axis,) = figure.axes
    dots = [line for line in axis.get_lines() if line.get_marker() == "."]
    assert [len(line.get_xdata()) for line in dots] == shown
    assert sorted(np.concatenate([line.get_xydata() for line in dots]).tolist()) == [[0.26, 9.0], [0.62, 5.0]]
    assert "largest of a contact" in [text.get_text() for text in axis.get_legend().get_texts()]


def test_a_stop_at_another_point_than_the_observed_one_is_not_drawn_as_its_limit() -> None:
    beam = '[body]\nkind = "beam"\n[[stop]]\nposition = 1.0\nlocation = {}\n'
    chain = '[body]\nkind = "chain"\nmasses = [1, 1]\nobserved_mass = {}\n[[stop]]\nposition = 1.0\n'
    for text, shown in (
        (beam.format(1.0), [1.0]),
        (beam.format(0.5), []),
        (chain.format(2), [1.0]),
        (chain.format(1), []),
    ):
        dataset = dataset_of([record(1.0)], coordinates={}, attrs={"scene": text})
        assert fixed_positions(limits(dataset, "displacement")) == shown


def test_a_stop_that_moves_is_drawn_on_its_way() -> None:
    motion = "velocity = 0.5\nmotion_amplitude = 0.1\nmotion_angular_frequency = 2.0\nmotion_phase = 0.3\n"
    table = "motion_times = [0.0, 1.0, 2.0]\nmotion_values = [0.0, 1.0, 0.0]\n"
    text = f"[body]\nmass = 1.0\n[[stop]]\nposition = 1.0\n{motion}{table}"
    dataset = dataset_of([record(1.0)], coordinates={}, attrs={"scene": text})
    (stop,) = limits(dataset, "displacement")
    assert fixed_positions([stop]) == []
    place, velocity = stop.course(np.array([1.0, 3.0]))
    angle = np.array([2.3, 6.3])
    # the spline has no slope in the middle, and -1.5 from its end on
    assert place == pytest.approx(1.0 + np.array([0.5 + 1.0, 1.5 - 1.5]) + 0.1 * np.cos(angle), abs=1e-12)
    assert velocity == pytest.approx(0.5 - 0.2 * np.sin(angle) + np.array([0.0, -1.5]), abs=1e-12)


def test_a_logarithmic_sweep_has_a_logarithmic_axis_in_diagrams_and_maps() -> None:
    tables = {
        "body": {"mass": 1.0, "stiffness": 1.0, "damping_ratio": 0.1},
        "forcing": {"amplitude": 0.5, "angular_frequency": 1.0},
        "stop": [{"law": "kelvin_voigt", "position": 1.0, "stiffness": 100.0, "damping": 1.0}],
        "record": {"transient_periods": 5, "recorded_periods": 2},
    }
    stiffness = {"start": 10.0, "stop": 1e5, "points": 5, "spacing": "log"}
    scene = vi.Scene.from_dict(tables | {"sweep": {"stop[1].stiffness": stiffness}})
    diagram = vi.draw(vi.run(scene, progress=False))
    assert {axis.get_xscale() for axis in diagram.axes} == {"log"}
    frequency = {"start": 0.9, "stop": 1.1, "points": 3}
    both = {"stop[1].stiffness": stiffness, "forcing.angular_frequency": frequency}
    field = vi.draw(vi.run(vi.Scene.from_dict(tables | {"sweep": both}), progress=False)).axes[0]
    assert (field.get_xscale(), field.get_yscale()) == ("log", "linear")
    low, high = field.get_xlim()
    assert low == pytest.approx(10.0 / 10.0**0.5)  # half a cell below the first value, in its own spacing
    assert high == pytest.approx(1e5 * 10.0**0.5)
