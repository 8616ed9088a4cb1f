"""Parts of a diagram are the datasets of their own studies; a part that a scene cannot have is named."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from support.command_line import in_this_process
from support.scenes import FORCED

import vibroimpact as vi
from vibroimpact.analysis.dataset import open_measured
from vibroimpact.fmus.errors import DatasetError, SceneError, UsageError
from vibroimpact.orchestrator.orbits import loci as loci_of_scenes
from vibroimpact.orchestrator.orbits import swept_runs
from vibroimpact.orchestrator.orbits.diagram import Diagram

FREQUENCY, POSITION = "forcing.angular_frequency", "stop[1].position"
RANGE = (FREQUENCY, 0.9, 1.4)
ALONE: dict[str, Any] = {"impacts": 1, "doublings": 0, "grazes": 0}
FEW: dict[str, Any] = {"values": 6, "points": 4, "share_values": 2, **ALONE}
YIELDING = FORCED.replace("restitution = 0.7", 'law = "kelvin_voigt"\nstiffness = 1000.0')


@pytest.fixture(scope="module")
def scene() -> vi.Scene:
    return vi.Scene.from_text(FORCED)


@pytest.fixture(scope="module")
def found(scene: vi.Scene) -> xr.Dataset:
    return vi.diagram(scene, *RANGE, **FEW)


def _same(one: xr.Dataset, other: xr.Dataset) -> None:
    """Assert that two datasets have equal variables, wall times apart."""
    names = ["point_seconds"] if "point_seconds" in one else []
    xr.testing.assert_identical(
        one.drop_vars(names).drop_attrs(deep=False), other.drop_vars(names).drop_attrs(deep=False)
    )


def test_branches_are_those_of_follow(found: xr.Dataset, scene: vi.Scene) -> None:
    _same(found.vibroimpact.part("branches"), vi.follow(scene, *RANGE, **ALONE))


def test_shares_are_those_of_basins(found: xr.Dataset, scene: vi.Scene) -> None:
    shares = vi.basins(scene, points=(4, 4), parameter=FREQUENCY, parameter_range=RANGE[1:], values=2)
    _same(found.vibroimpact.part("shares"), shares)


def test_runs_go_up_and_down_and_have_classes_and_exponents(found: xr.Dataset) -> None:
    sweep = found.vibroimpact.part("sweep")
    assert sweep.displacement_range.sizes == {"direction": 2, "angular_frequency": 6}
    assert sweep.sizes["period"] == swept_runs.EXPONENT_PERIODS
    classes = vi.classify(
        sweep.drop_vars([name for name in sweep.data_vars if str(name).startswith("class_")])
    )
    _same(classes.dataset, sweep)
    _same(found.vibroimpact.part("exponents"), vi.lyapunov(sweep))
    # P(1,1) and motion without impacts are both stable between the graze at 1.219 and the fold at 1.517
    up, down = (sweep.displacement_range.sel(direction=way, angular_frequency=1.4) for way in ("up", "down"))
    assert float(up) > 2.0 > float(down)


def test_a_written_diagram_reads_and_draws_as_in_memory(
    found: xr.Dataset, scene: vi.Scene, tmp_path: Path
) -> None:
    vi.write_results(found, tmp_path / "d.nc")
    with open_measured(tmp_path / "d.nc") as read:
        for part in str(found.attrs["parts"]).split():
            _same(read.vibroimpact.part(part), found.vibroimpact.part(part))
        drawn = [vi.draw(data) for data in (read, found)]
    texts = [[axis.get_ylabel() for axis in figure.axes] for figure in drawn]
    assert (
        texts[0]
        == texts[1]
        == [
            "displacement range (-)",
            "impact velocity (-)",
            "share of starts (%)",
            "largest exponent\nper impact (-)",
        ]
    )


def test_a_panel_has_branches_over_runs_and_names_special_points(found: xr.Dataset) -> None:
    axis = vi.draw(found).axes[1]
    words = axis.get_legend_handles_labels()[1]
    assert words[:4] == ["up sweep", "down sweep", "stable", "unstable"]
    assert {"graze", "period doubling"} <= set(words)
    assert "fold" not in words  # at 1.517
    limits = [each.get_xlim() for each in vi.draw(found).axes]
    assert len(set(limits)) == 1


@pytest.mark.parametrize("parts", [["sweep"], ["shares"]])
def test_only_the_parts_that_are_named_are_made_and_drawn(
    parts: list[str], scene: vi.Scene, found: xr.Dataset
) -> None:
    few = vi.diagram(scene, *RANGE, **FEW, parts=parts)
    assert str(few.attrs["parts"]).split() == parts
    assert len(vi.draw(few).axes) == (2 if parts == ["sweep"] else 1)
    with pytest.raises(DatasetError, match="part: expected one of those there are"):
        few.vibroimpact.part("exponents")


def test_a_range_may_be_given_backwards_or_by_the_sweep_of_the_scene(scene: vi.Scene) -> None:
    swept = scene.with_sweep({FREQUENCY: {"start": 0.9, "stop": 1.4, "points": 6}})
    ways = [
        vi.diagram(scene, FREQUENCY, 1.4, 0.9, values=6, parts=["sweep"]),
        vi.diagram(swept, parts=["sweep"]),
    ]
    _same(ways[0].vibroimpact.part("sweep"), ways[1].vibroimpact.part("sweep"))


def test_parts_that_a_stop_that_yields_cannot_have_are_named(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(YIELDING)
    given = ["--parameter", POSITION, "--from", "0.8", "--to", "1.2", "--values", "3"]
    done = in_this_process(
        "diagram", tmp_path / "s.toml", *given, "-o", tmp_path / "d.nc", "--figure", tmp_path / "d.png"
    )
    assert done.returncode == 0, done.stderr
    with open_measured(tmp_path / "d.nc") as read:
        made = str(read.attrs["parts"]).split()
        refused = dict(line.split(": ", 1) for line in str(read.attrs["refused"]).splitlines())
    assert "sweep" in made
    assert {*made, *refused} == {"sweep", "branches", "shares", "exponents"}
    for part, reason in refused.items():
        assert f"No {part}: {reason}" in done.stdout


def test_a_body_that_becomes_a_structure_is_swept_from_its_start(scene: vi.Scene) -> None:
    found = vi.diagram(scene, "body.damping", -0.1, 0.1, values=3, parts=["sweep"])  # negative: a structure
    sweep = found.vibroimpact.part("sweep")
    assert sweep.outcome.dims == ("damping",)
    assert vi.draw(found).axes[0].get_legend_handles_labels()[1] == ["runs"]


def test_a_scene_that_can_have_none_of_the_parts_is_an_error() -> None:
    chirp = FORCED.replace("[forcing]", "[[forcing]]").replace(
        "angular_frequency = 0.8", 'signal = "constant"'
    )
    with pytest.raises(UsageError, match=r"expected a force, or a negative dashpot"):
        vi.diagram(
            vi.Scene.from_text(
                chirp.replace("transient_periods = 10\nrecorded_periods = 5", "recorded_time = 5.0")
            ),
            "body.mass",
            1.0,
            2.0,
            parts=["branches", "shares"],
        )


@pytest.mark.parametrize(
    ("given", "more", "said"),
    [
        ((FREQUENCY, 1.0, 1.0), {}, "expected a range of two different numbers, got 1 and 1"),
        ((FREQUENCY, np.nan, 1.0), {}, "expected a range of two different numbers, got nan and 1"),
        ((FREQUENCY, 1.0), {}, "expected --parameter, --from and --to together"),
        ((), {}, "expected a sweep of one or two keys, or a range, got neither"),
        (("forcing.frequencyy", 1.0, 2.0), {}, "expected a numeric key"),
        (("body.kind", 1.0, 2.0), {}, "expected a numeric key"),
        (("stop[2].position", 1.0, 2.0), {}, "expected a numeric key of this scene"),
        ((FREQUENCY, -1.0, 2.0), {}, "expected a number >= 0"),
        (RANGE, {"values": 1}, "expected 2 to 1000000 values, got 1"),
        (RANGE, {"points": 1}, "points: expected 2 at least"),
        (RANGE, {"share_values": 1}, "values: expected 2 to 10000, got 1"),
        (RANGE, {"impacts": 0}, "--impacts: expected 1 or more, got 0"),
        (RANGE, {"grazes": -1}, "--grazes: expected 0 or more, got -1"),
        (
            RANGE,
            {"parts": ["sweep", "foo"]},
            "expected some of sweep, branches, shares, exponents, got 'foo'",
        ),
        (RANGE, {"parts": ["exponents"]}, "expected sweep beside exponents"),
        (RANGE, {"second": POSITION}, "expected --second, --second-from and --second-to together"),
        (RANGE, {"second": FREQUENCY, "second_range": (1.0, 2.0)}, "expected another number"),
        ((), {"second": POSITION, "second_range": (1.0, 2.0)}, "expected --parameter as well"),
        (
            RANGE,
            {"values": 2000, "second": POSITION, "second_range": (1.0, 2.0), "second_values": 2000},
            "runs at most",
        ),
    ],
)
def test_bad_arguments_are_refused_before_anything_runs(
    given: tuple[Any, ...], more: dict[str, Any], said: str, scene: vi.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(swept_runs, "run_campaign", None)
    with pytest.raises((UsageError, SceneError), match=said):
        vi.diagram(scene, *given, **more)


def test_ctrl_c_in_a_part_leaves_the_parts_before_it_and_what_that_part_has(scene: vi.Scene) -> None:
    study = Diagram(scene, *RANGE, **FEW, parts=["sweep", "shares"])
    rows = study.rows()
    for _ in range(2):  # the sweep, and the first value of the shares
        study.take(next(rows))
    rows.close()
    found = study.made()
    assert str(found.attrs["parts"]).split() == ["sweep", "shares"]
    assert study.interruption.endswith("up to the part shares.")
    assert found.sizes["shares_parameter"] == 1
    assert isinstance(vi.draw(found), Figure)


def test_loci_lie_on_a_map_of_classes_over_two_numbers(
    scene: vi.Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(loci_of_scenes, "SECOND_VALUES", 1)  # branches at few further values take less time
    given: dict[str, Any] = {"values": 5, "second": POSITION, "second_range": (0.9, 1.1), "second_values": 3}
    found = vi.diagram(scene, FREQUENCY, 0.9, 1.0, **ALONE, **given)
    sweep, loci = (found.vibroimpact.part(part) for part in ("sweep", "loci"))
    assert sweep.class_kind.sizes == {"angular_frequency": 5, "position": 3}
    doubled = loci.vibroimpact.runs.orbit_special.values
    assert {2} <= set(doubled.tolist())
    figure = vi.draw(found)
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert {"P(1,1)", "period doubling"} <= set(words)
    assert len(figure.legends) == 1
    axis = Figure().subplots()
    vi.figures.draw_into(axis, found)
    legend = axis.get_legend()
    assert legend is not None
    assert [text.get_text() for text in legend.get_texts()] == words


def test_a_second_number_outside_its_range_moves_to_the_middle(scene: vi.Scene) -> None:
    study = Diagram(scene, *RANGE, second=POSITION, second_range=(2.0, 3.0))
    assert study.scene.value(POSITION) == 2.5


@pytest.mark.parametrize(("values", "expected"), [(None, [0.9, 1.08, 1.296]), (5, None)])
def test_values_of_a_sweep_with_equal_ratios_keep_them(
    scene: vi.Scene, values: int | None, expected: list[float] | None
) -> None:
    swept = scene.with_sweep({FREQUENCY: {"start": 0.9, "stop": 1.296, "points": 3, "spacing": "log"}})
    (axis,) = Diagram(swept, values=values, parts=["sweep"]).studies["sweep"].scene.sweep
    ratios = np.divide(axis.values[1:], axis.values[:-1])
    np.testing.assert_allclose(ratios, 1.2 if expected else 1.44**0.25, rtol=1e-12)
    assert len(axis.values) == (values or 3)
