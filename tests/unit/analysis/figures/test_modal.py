from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from support.dataset_examples import dataset_of, up_down

from vibroimpact.analysis import figures
from vibroimpact.analysis.dataset import Outcome, RunRecord
from vibroimpact.fmus.errors import DatasetError

CHAIN = """
[body]
kind = "chain"
masses = [1.0, 4.0]
stiffnesses = [3.0, 2.0]
[[stop]]
position = 0.5
"""


def sampled(names: list[str], columns: list[np.ndarray], scene: str = CHAIN) -> xr.Dataset:
    """One run of 100 samples over 1 s with two impacts, at phases 1 and 2."""
    time = np.linspace(0.0, 1.0, 100)
    impacts = np.array([[0.305, 1.0, 0.2, 0.3, 1.0], [0.705, 2.0, 0.4, 0.6, 1.0]])
    run = RunRecord(
        Outcome.ok,
        "",
        None,
        impacts,
        np.empty((0, 3)),
        np.column_stack([time, *columns]),
        0.0,
        0.0,
        0.0,
        1e-3,
    )
    return dataset_of([run], coordinates={}, sample_variables=names, units="SI", attrs={"scene": scene})


def moving(
    names: tuple[str, ...] = ("displacement[1]", "velocity[1]", "displacement[2]", "velocity[2]"),
) -> xr.Dataset:
    time = np.linspace(0.0, 1.0, 100)
    return sampled(list(names), [np.sin((k + 1) * time) for k in range(len(names))])


def gaps(figure: Figure, panel: int, line: int) -> int:
    return int(np.isnan(figure.axes[panel].get_lines()[line].get_ydata()).sum())


def test_a_portrait_of_a_chain_has_its_masses_and_its_modes_with_a_gap_at_each_impact() -> None:
    figure = figures.draw(moving(), "portrait")
    assert [text.get_text() for text in figure.axes[0].get_legend().get_texts()] == [
        "displacement of mass 1",
        "displacement of mass 2",
    ]
    assert [text.get_text() for text in figure.axes[1].get_legend().get_texts()] == ["mode 1", "mode 2"]
    assert gaps(figure, 0, 0) == gaps(figure, 1, 0) == 2
    names = [(axis.get_xlabel(), axis.get_ylabel()) for axis in figure.axes]
    assert names == [
        ("displacement (m)", "velocity (m/s)"),
        ("modal displacement (√kg m)", "modal velocity (√kg m/s)"),
    ]


def test_the_modes_of_a_portrait_are_mass_normalised() -> None:
    """The sum of their squared velocities is twice the kinetic energy of the masses."""
    dataset = moving()
    lines = figures.draw(dataset, "portrait").axes[1].get_lines()
    modes = [line.get_ydata() for line in lines if line.get_label().startswith("mode")]
    squares = sum(values[np.isfinite(values)] ** 2 for values in modes)
    kinetic = dataset.velocity_1.values**2 + 4.0 * dataset.velocity_2.values**2
    assert squares == pytest.approx(kinetic, abs=1e-12)


def test_a_portrait_of_one_displacement_has_the_stop_and_no_legend() -> None:
    figure = figures.draw(moving(("displacement", "velocity")), "portrait")
    (axis,) = figure.axes
    assert axis.get_legend() is None
    assert axis.get_lines()[-1].get_xdata() == [0.5, 0.5]


def test_dots_of_a_portrait_join_what_is_before_an_impact_to_what_is_after_it() -> None:
    dataset = moving(("displacement", "velocity"))
    (axis,) = figures.draw(dataset, "portrait").axes
    (dots,) = (line for line in axis.lines if line.get_linestyle() == ":")
    ends = dots.get_xydata().reshape(2, 3, 2)[:, :2]
    after = np.searchsorted(dataset.time.values, dataset.impact_time.values)
    states = np.column_stack([dataset.displacement.values, dataset.velocity.values])
    np.testing.assert_array_equal(ends, np.stack([states[after - 1], states[after]], axis=1))


def test_an_impact_map_has_each_impact_at_its_phase_and_velocity() -> None:
    (axis,) = figures.draw(moving(), "impact-map").axes
    (points,) = axis.get_lines()
    assert points.get_xydata().tolist() == [[1.0, 0.2], [2.0, 0.4]]
    assert axis.get_xlabel() == "impact phase (rad)"


def test_impacts_of_one_speed_are_below_the_top_of_their_map() -> None:
    dataset = moving()
    dataset["impact_velocity"].values[:] = 0.4, 0.4 * (1.0 + 1e-9)
    (axis,) = figures.draw(dataset, "impact-map").axes
    assert axis.get_ylim() == pytest.approx((0.0, 0.42))


def test_energies_are_summed_and_those_of_the_modes_have_their_own_panel() -> None:
    names = ["energy.kinetic", "energy.potential", "modal_energy[1]", "modal_energy[2]"]
    parts = [np.full(100, value) for value in (1.0, 2.0, 0.5, 2.5)]
    figure = figures.draw(sampled(names, parts), "energies")
    total = figure.axes[0].get_lines()[0].get_ydata()
    assert np.nanmin(total) == np.nanmax(total) == 3.0
    assert [line.get_label() for line in figure.axes[1].get_lines()[:2]] == ["mode 1", "mode 2"]


@pytest.mark.parametrize(
    ("kind", "dataset", "message"),
    [
        ("portrait", moving(("displacement", "acceleration")), "expected a displacement and its velocity"),
        ("energies", moving(), "expected kinetic, potential and modal energies"),
        ("shapes", moving(), "expected a sweep of sensor.location"),
        ("impact-map", up_down(), "expected one run"),
    ],
)
def test_what_a_figure_cannot_show_is_refused(kind: str, dataset: xr.Dataset, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        figures.draw(dataset, kind)


def test_impacts_without_a_phase_have_no_map() -> None:
    dataset = moving()
    dataset.impact_phase.values[:] = np.nan
    with pytest.raises(DatasetError, match="expected impacts with a forcing phase"):
        figures.draw(dataset, "impact-map")
