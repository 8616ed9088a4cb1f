"""The drawn part of a motion, and the contents of its time series: stops, impacts, quantities with their units."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from support.dataset_examples import coupled_dataset, coupled_record, dataset_of, failed, record

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.analysis.figures.scene_text import fixed_positions, forcing_rate, limits
from vibroimpact.analysis.recording import Channel, Recording, TimeAxis
from vibroimpact.fmus.errors import DatasetError, UsageError

PERIODS, PERIOD = 40, 0.5
TIME = 20.0 + np.linspace(0.0, PERIODS * PERIOD, 50 * PERIODS + 1)
CHAIN = """
[body]
kind = "chain"
masses = [1.0, 1.0, 1.0]
stiffnesses = 1.0
[forcing]
amplitude = [1.0, 0.0, 0.0]
frequency = 2.0
[[stop]]
mass = 2
position = 0.8
[[stop]]
mass = 3
position = -0.9
side = "lower"
[record]
time_series = { rate = 100, variables = ["displacement[2]", "displacement[3]", "velocity[3]", "contact_force"] }
"""
NAMES = ["displacement[2]", "displacement[3]", "velocity[3]", "contact_force"]


def chain(
    scene: str = CHAIN, impacts_per_period: int = 1, units: str = "SI", **changes: object
) -> xr.Dataset:
    """Return forty sampled periods of a chain between two stops, after some time of motion."""
    waves = [np.sin(2.0 * np.pi * (TIME / PERIOD - 0.1 * k)) for k in range(len(NAMES))]
    number = PERIODS * impacts_per_period
    hits = np.ones((number, 7))
    hits[:, 0] = TIME[0] + (0.3 + np.arange(number)) * PERIOD / impacts_per_period
    hits[:, 2] = 0.5 + 0.1 * (np.arange(number) % 2)
    run = RunRecord(
        Outcome.ok, "", None, hits, np.empty((0, 3)), np.column_stack([TIME, *waves]), 0.0, 0.0, 0.0, 1e-3
    )
    settings = {"coordinates": {}, "sample_variables": NAMES, "units": units, "attrs": {"scene": scene}}
    return dataset_of([run], **(settings | changes))


def shown(figure: Figure, panel: int = 0) -> tuple[float, float]:
    time = np.asarray(figure.axes[panel].get_lines()[0].get_xdata(), dtype=float)
    return float(time[0]), float(time[-1])


def test_of_a_long_motion_the_first_eight_periods_are_drawn_and_the_label_says_so() -> None:
    figure = figures.draw(chain())
    assert shown(figure) == pytest.approx((20.0, 24.0))
    assert figure.axes[-1].get_xlabel() == "time (s), first 8 of 40 periods"


def test_a_record_that_ends_just_before_its_last_period_does_is_told_in_round_numbers() -> None:
    short = chain(CHAIN.replace("frequency = 2.0", "frequency = 1.9996"))
    assert figures.draw(short).axes[-1].get_xlabel() == "time (s), first 8 of 40 periods"


def test_what_is_asked_for_is_drawn_and_nothing_needs_to_be_said() -> None:
    for window, ends in (
        ({"start": 21.0, "stop": 22.5}, (21.0, 22.5)),
        ({"start": 30.0}, (30.0, 40.0)),
        ({"stop": 22.0}, (20.0, 22.0)),
        ({"periods": 3}, (20.0, 21.5)),
        ({"start": 25.0, "periods": 2}, (25.0, 26.0)),
        ({"stop": 40.0, "periods": 2}, (39.0, 40.0)),
        ({"start": 0.0, "stop": 99.0}, (20.0, 40.0)),
    ):
        figure = figures.draw(chain(), **window)
        assert shown(figure) == pytest.approx(ends, abs=0.011), window
        assert figure.axes[-1].get_xlabel() == "time (s)"


@pytest.mark.parametrize(
    ("window", "message"),
    [
        (
            {"start": 50.0, "stop": 60.0},
            "expected a part of 20 to 40 s with two samples at least, got 50 to 60 s",
        ),
        ({"start": 21.0, "stop": 21.001}, "with two samples at least, got 21 to 21.001 s"),
        ({"start": 22.0, "stop": 21.0}, "expected start < stop, got 22 and 21. Turn them round."),
        ({"start": 1.0, "stop": 2.0, "periods": 3}, "expected two of start, stop and periods at most"),
        ({"periods": 0}, "periods: expected a number > 0, got 0"),
        ({"start": float("nan")}, "start: expected a number, got nan"),
    ],
)
def test_a_window_that_does_not_fit_is_one_line_with_what_there_is(
    window: dict[str, float], message: str
) -> None:
    with pytest.raises(UsageError) as caught:
        figures.draw(chain(), **window)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scene_without_a_forcing_period_is_drawn_whole_and_has_no_periods() -> None:
    free = chain(CHAIN.replace("frequency = 2.0", "frequency = 0.0"))
    assert shown(figures.draw(free)) == pytest.approx((20.0, 40.0))
    with pytest.raises(
        UsageError, match=r"expected a scene with a forcing period, got none\. Give a part of 20 to 40 s"
    ):
        figures.draw(free, periods=3)


def test_the_forcing_of_a_swept_run_is_that_of_its_point() -> None:
    scene = CHAIN + '[sweep]\n"forcing.frequency" = { values = [1.0, 4.0] }\n'
    runs = [coupled_record(float(k), samples=4) for k in range(2)]
    dataset = coupled_dataset(runs, coordinates={"frequency": np.array([1.0, 4.0])}, attrs={"scene": scene})
    rates = [forcing_rate(dataset, dataset.vibroimpact.samples(run_index=k)) for k in range(2)]
    assert rates == pytest.approx([2.0 * np.pi, 8.0 * np.pi])


def test_the_frequency_of_a_body_is_not_taken_for_that_of_the_forcing() -> None:
    scene = '[forcing]\nfrequency = 3.0\n[sweep]\n"body.frequency" = { values = [1.0] }\n'
    dataset = chain(scene, coordinates={"frequency": np.array([1.0])})
    assert forcing_rate(dataset, dataset.vibroimpact.samples()) == pytest.approx(6.0 * np.pi)


@pytest.mark.parametrize(
    "scene", ["", "body = 3", "[[body]]\n[[forcing]]\n", "forcing = [", "[record]\ntime_series = 1"]
)
def test_a_scene_that_says_nothing_keeps_no_motion_from_being_drawn(scene: str) -> None:
    assert shown(figures.draw(chain(scene))) == pytest.approx((20.0, 40.0))


def test_each_displacement_of_a_chain_has_the_stops_of_its_mass_in_its_colour() -> None:
    figure = figures.draw(chain())
    lines = figure.axes[0].get_lines()
    stops = {line.get_color(): line.get_ydata()[0] for line in lines if line.get_linestyle() != "-"}
    motion = {line.get_label(): line.get_color() for line in lines if line.get_linestyle() == "-"}
    assert stops == {motion["mass 2"]: 0.8, motion["mass 3"]: -0.9}
    assert fixed_positions(limits(chain(), "contact_displacement_2")) == [-0.9]
    assert limits(chain(), "displacement_1") == limits(chain(), "velocity_3") == []


def test_a_stop_out_of_reach_does_not_press_the_motion_flat() -> None:
    figure = figures.draw(chain(CHAIN.replace("position = 0.8", "position = 80.0")))
    assert figure.axes[0].get_ylim()[1] < 2.0


def test_panels_are_in_the_order_of_the_scene_and_name_quantity_index_and_unit() -> None:
    figure = figures.draw(chain())
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "displacement (m)",
        "velocity of mass 3 (m/s)",
        "contact force (N)",
    ]


def test_quantities_without_units_have_panels_of_their_own() -> None:
    figure = figures.draw(chain(units="nondimensional"))
    assert [axis.get_ylabel() for axis in figure.axes] == [
        "displacement (-)",
        "velocity of mass 3 (-)",
        "contact force (-)",
    ]


def test_many_impacts_are_marked_at_the_top_and_cover_nothing() -> None:
    few, many = (
        figures.draw(chain(impacts_per_period=n)).axes[0].collections[0].get_segments() for n in (2, 20)
    )
    assert [len(few), len(many)] == [16, 160]
    assert few[0][:, 1].tolist() == [0.0, 1.0]
    assert many[0][0, 1] > 0.9


def test_a_window_of_the_phase_plane_and_of_the_impacts_is_one_of_time() -> None:
    dataset = chain()
    assert len(figures.draw(dataset, "return-map").axes[0].get_lines()[0].get_xdata()) == 39
    assert (
        len(figures.draw(dataset, "return-map", start=20.0, stop=25.0).axes[0].get_lines()[0].get_xdata())
        == 9
    )
    whole = figures.draw(dataset, "portrait", periods=20).axes[0].get_lines()[0].get_xdata()
    part = figures.draw(dataset, "portrait", periods=1).axes[0].get_lines()[0].get_xdata()
    assert len(part) < len(whole) / 15


def test_a_run_that_failed_before_its_first_sample_is_one_line() -> None:
    runs = [failed("no convergence"), record(1.0, samples=3)]
    for kind in ("run", "portrait"):
        with pytest.raises(DatasetError, match=r"expected samples of the run, got none\."):
            figures.draw(dataset_of(runs), kind, 0, start=0.5)


def recording(rate: float = 100.0) -> Recording:
    time = np.arange(400) / rate
    axis = TimeAxis(time, 1.0 / rate)
    quality = np.zeros(400, np.uint8)
    values = 2.0 * np.cos(2.0 * np.pi * 10.0 * time)
    return Recording(
        {
            "board": Channel("board", values, "9.80665 m s-2", axis, quality),
            "count": Channel("count", values, "1", axis, quality),
        }
    )


def test_a_part_of_a_recording_is_drawn_and_its_channels_name_their_quantity() -> None:
    figure = figures.draw(recording(), start=1.0, stop=2.0)
    assert shown(figure) == pytest.approx((1.0, 2.0))
    assert [axis.get_ylabel() for axis in figure.axes] == ["acceleration\n(g)", "(-)"]
    assert [axis.get_xlabel() for axis in figure.axes] == ["", "time (s)"]
