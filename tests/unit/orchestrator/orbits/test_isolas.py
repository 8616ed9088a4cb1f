"""Closed branches over one number that exist at some values of a second number only: thesis figure 3.5 (a), P(1,1)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import RULES, CurvePoint
from vibroimpact.analysis.orbits import Contact, ImpactingBody, closed_form
from vibroimpact.analysis.study import whole
from vibroimpact.orchestrator.orbits import loci as loci_of_scenes
from vibroimpact.orchestrator.orbits.follow import Following

SCENE = EXAMPLES / "bifurcation.toml"
FREQUENCY, AMPLITUDE = "forcing.angular_frequency", "forcing.amplitude"
CENTRE, CROSSING = (0.58702914579, 0.55207594535), (0.643768460, 0.57407285868)


def oscillator(frequency: float, force: float) -> ImpactingBody:
    one = np.ones(1)
    stop = Contact(one, 1.0, 1.0, 0.7)
    return ImpactingBody(one, 0.05 * one, force * one, 0.0 * one, frequency, 0.0, (stop,), one)


def followed(highest: float, step: float = 0.03) -> Following:
    """Return the orbits P(1,1) from an amplitude at which the range has none."""
    scene = vi.Scene.from_file(SCENE).with_values({"sweep": {}, AMPLITUDE: 0.548, FREQUENCY: 0.6})
    ranges = {"second": AMPLITUDE, "second_range": (0.548, highest)}
    return whole(
        Following(scene, FREQUENCY, 0.53, 0.66, impacts=1, doublings=0, grazes=0, step=step, **ranges)
    )


def test_a_closed_branch_is_found_from_an_amplitude_that_has_none() -> None:
    found = followed(0.5625)
    assert found.followed.branches == []
    (isola,) = found.loci.apart
    assert isola.is_isola
    assert {branch.name for _, branch in isola.branches} == {"P(1,1)"}
    assert min(value for value, _ in isola.branches) > CENTRE[1]
    np.testing.assert_allclose(isola.births, [CENTRE], atol=1e-9)
    assert isola.crossings == []
    assert found.loci.isolas[0].startswith("Isola, a closed branch: P(1,1) at forcing.amplitude = ")


def test_an_isola_centre_is_where_the_closed_form_begins_to_have_orbits() -> None:
    counts = [len(closed_form(oscillator(CENTRE[0], CENTRE[1] + off))) for off in (-1e-9, 1e-9)]
    assert counts == [0, 2]


def test_a_closed_branch_between_two_values_is_followed_from_its_centre(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(loci_of_scenes, "SECOND_VALUES", 2)
    found = followed(0.58, 0.05)
    assert found.loci.values[:2] == [0.548, 0.58]
    (isola,) = [each for each in found.loci.apart if each.is_isola]
    np.testing.assert_allclose(isola.births, [CENTRE], atol=1e-9)
    np.testing.assert_allclose(isola.crossings, [CROSSING], atol=1e-8)
    ((value, branch),) = isola.branches
    assert CENTRE[1] < value < CROSSING[1]
    assert branch.is_closed
    assert branch.values.min() < CENTRE[0] < branch.values.max() < CROSSING[0]


def test_points_of_curves_are_in_the_file_and_in_the_figure(tmp_path: Path) -> None:
    span = ["--parameter", FREQUENCY, "--from", "0.64", "--to", "0.7", "--step", "0.1", "--impacts", "1"]
    second = ["--second", AMPLITUDE, "--second-from", "0.54", "--second-to", "0.58"]
    more = ["--set", f"{AMPLITUDE}=0.56", "--doublings", "0", "--grazes", "0", "-o", tmp_path / "loci.nc"]
    done = in_this_process("follow", SCENE, *span, *second, *more)
    assert (done.returncode, done.stderr) == (0, "")
    with vi.open_dataset(tmp_path / "loci.nc") as read:
        for name in (name for name, rule in RULES.items() if rule.dims == ("curve_point",)):
            assert (read[name].dims, read[name].dtype) == (RULES[name].dims, RULES[name].dtype)
            assert read[name].attrs["long_name"]
        kinds = read["curve_point_kind"].values
        places = np.column_stack([read[f"curve_point_{which}"].values for which in ("first", "second")])
        numbers = read["curve_point_curve"].values
        curves = read.vibroimpact.runs["orbit_branch"].values
        figure = vi.draw(read)
    assert set(numbers) <= set(curves)
    at = places[kinds == CurvePoint.crossing_of_branches]
    np.testing.assert_allclose(at, [CROSSING], atol=1e-8)
    met = places[np.isin(kinds, [CurvePoint.fold, CurvePoint.period_doubling])]
    np.testing.assert_allclose(met, [(0.66583281185, 0.56063456111)] * len(met), atol=1e-9)
    assert len(met) >= 2
    marks = {line.get_label(): line.get_xydata() for line in figure.axes[0].lines}
    np.testing.assert_allclose(marks["crossing of branches"], at)
    assert "codimension 2" in marks


def test_a_closed_branch_is_named_over_one_number(capsys: pytest.CaptureFixture[str]) -> None:
    scene = vi.Scene.from_file(SCENE).with_values({"sweep": {}, AMPLITUDE: 0.56})
    found = whole(Following(scene, FREQUENCY, 0.55, 0.64, impacts=1, doublings=0, grazes=0, step=0.1))
    found.print_results()
    assert "closed; begun from P(1,1)" in capsys.readouterr().out
