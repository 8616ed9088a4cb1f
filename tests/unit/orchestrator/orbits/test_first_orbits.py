"""Orbits that a branch begins with: a seed, an orbit of a run, or the orbits of a search along the range."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.command_line import in_this_process as ran
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import SpecialOrbit
from vibroimpact.analysis.orbits.search import orbits_of


def in_this_process(arguments: list[str]) -> tuple[int, str, str]:
    done = ran(*arguments)
    return done.returncode, done.stdout, done.stderr


SCENE = ROOT / "examples" / "bifurcation.toml"
PARAMETER = "forcing.angular_frequency"
CHAIN = ROOT / "examples" / "thesis" / "figure_6_13.toml"


def few_starts(patch: pytest.MonkeyPatch) -> None:
    """Search orbits at 2 values of the parameter instead of 25, from 64 trains of impacts instead of 256."""
    patch.setattr("vibroimpact.orchestrator.orbits.first_orbits.SEEDS", 2)
    patch.setitem(orbits_of.__kwdefaults__, "starts", 64)


def of_chain(value: float) -> vi.Scene:
    return vi.Scene.from_file(CHAIN).with_values({PARAMETER: value})


def special(followed: object) -> list[tuple[str, float]]:
    runs = followed.vibroimpact.runs  # type: ignore[attr-defined]
    found = zip(runs["orbit_special"].values, runs["angular_frequency"].values, strict=True)
    return [(SpecialOrbit(int(kind)).name, float(value)) for kind, value in found if kind]


def test_a_seed_is_followed_both_ways_to_the_grazes_that_it_shares_with_other_orbits() -> None:
    seed = [(0.67, 1), (6.75, 1), (8.67, 1)]
    three = vi.follow(
        of_chain(0.855), PARAMETER, 0.3, 2.2, seed=seed, periods=2, doublings=0, grazes=0, step=0.05
    )
    kinds, values = zip(*special(three), strict=True)
    assert kinds == ("graze_between_impacts", "fold", "graze")
    one = dict(special(vi.follow(CHAIN, PARAMETER, 0.84, 0.92, doublings=0, grazes=0, step=0.05)))
    two = vi.follow(of_chain(0.83), PARAMETER, 0.8, 0.84, seed=[(0.4, 1), (2.1, 1)], step=0.05)
    assert values[2] == pytest.approx(one["graze_between_impacts"], abs=1e-9)
    assert values[0] == pytest.approx(dict(special(two))["graze"], abs=1e-9)
    assert values[1] == pytest.approx(0.85900181, abs=1e-8)


def test_orbits_of_several_impacts_are_begun_along_the_range_and_each_branch_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few_starts(monkeypatch)
    at = ["--set", "sweep={}", "--set", f"{PARAMETER}=0.94", "--impacts", "2", "--periods", "2"]
    span = ["--parameter", PARAMETER, "--from", "0.93", "--to", "0.95", "--step", "0.05"]
    code, out, _ = in_this_process(["follow", str(SCENE), *span, *at])
    assert code == 0
    assert "1  P(2,2)" in out
    assert "2  P(2,2)" not in out
    assert out.count("0.9363626913") == 1
    assert "ends: period doubling of P(1,1), graze." in out


def test_a_branch_that_lies_between_the_values_of_the_range_is_begun_at_the_own_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    few_starts(monkeypatch)
    found = vi.follow(of_chain(0.857), PARAMETER, 0.5, 2.2, impacts=2, doublings=0, grazes=0, step=0.05)
    assert dict(special(found))["fold"] == pytest.approx(0.85749282, abs=1e-8)


def test_a_branch_may_begin_at_the_end_of_its_range() -> None:
    scene = vi.Scene.from_file(SCENE).with_sweep({}).with_values({PARAMETER: 1.3})
    (orbit,) = [each for each in vi.find_orbits(scene, 1) if each.is_stable]
    seed = [(float(orbit.phases[0]), 1)]
    for other in (1.2, 1.4):
        found = vi.follow(scene, PARAMETER, 1.3, other, seed=seed, step=0.1)
        values = found.vibroimpact.runs["angular_frequency"].values
        assert sorted((1.3, other)) == pytest.approx([values.min(), values.max()], abs=1e-12)
        assert np.unique(values).size == values.size


def test_two_real_multipliers_of_product_one_are_no_torus() -> None:
    # at 1.67938513 the largest is 349, the smallest 1 / 349, and the two complex ones are small
    seed = [(1.9314, 1), (2.8647, 1), (12.2682, 1)]
    found = vi.follow(of_chain(1.6795), PARAMETER, 1.67, 1.6797, seed=seed, periods=2, doublings=0, grazes=0)
    assert [kind for kind, _ in special(found)] == ["graze_between_impacts"]


def test_an_orbit_of_a_run_is_followed_at_the_values_of_that_run(tmp_path: Path) -> None:
    file, output = tmp_path / "sweep.nc", tmp_path / "b.nc"
    grid = {PARAMETER: {"values": [1.0, 1.3]}, "forcing.amplitude": {"values": [0.4, 0.6]}}
    vi.run(vi.Scene.from_file(SCENE).with_sweep(grid), file)
    with vi.open_dataset(file) as runs:
        table = runs.vibroimpact.runs
        place = np.flatnonzero((table["angular_frequency"] == 1.3) & (table["amplitude"] == 0.6))[0]
        run = int(table["run_index"].values[place])
        met = runs.vibroimpact.impacts(angular_frequency=1.3, amplitude=0.6).load()
    near = vi.seed_of_run(file, run)
    assert near.values == {PARAMETER: 1.3, "forcing.amplitude": 0.6}
    assert near.impacts == [(pytest.approx(float(met["impact_phase"].values[-1]), abs=1e-8), 1)]
    command = ["follow", str(SCENE), "--parameter", "forcing.amplitude", "--from", "0.5", "--to", "0.7"]
    code, out, err = in_this_process(
        [*command, "--from-dataset", str(file), "--run", str(run), "-o", str(output)]
    )
    assert (code, err) == (0, "")
    assert "begun from P(1,1) at 0.6" in out
    with vi.open_dataset(output) as found:
        own = found["impact_velocity"].values
        np.testing.assert_allclose(np.abs(own - met["impact_velocity"].values[-1]).min(), 0.0, atol=1e-9)
        assert found.amplitude.values.min() == pytest.approx(0.5, abs=1e-12)
    code, _, err = in_this_process([*command, "--from-dataset", str(file)])
    assert (code, err) == (2, f"{file}: seed: run: expected one of run_index 0 to 3, got none.\n")
    code, _, err = in_this_process([*command, "--from-dataset", str(output), "--run", "0"])
    assert (code, err.count("\n")) == (2, 1)
    assert "seed: expected runs of a scene, got orbits that were found" in err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--impacts", "0"], "--impacts: expected 1 to 64, got 0."),
        (["--impacts", "65"], "--impacts: expected 1 to 64, got 65."),
        (
            ["--seed", "0.7", "--from", "1.5"],
            f"--from, --to: expected a range around {PARAMETER} = 1.4 of the scene",
        ),
        (["--seed", "0.9", "--impacts", "2"], "seed: expected 2 impacts"),
        (["--seed", "0.9:2"], "seed: expected stops 1 to 1, got 2."),
        (["--seed", "x"], "--seed: expected phases in rad"),
        (["--seed", "2.6", "--periods", "2"], "expected an orbit P(1,2) near to the phases [2.6], got none"),
        (["--run", "1"], "--run: expected --from-dataset as well, got --run alone."),
        (["--from-dataset", "none.nc"], "none.nc: expected a dataset file, got no such file."),
        (
            ["--from-dataset", "none.nc", "--periods", "2"],
            "--from-dataset: expected it without --periods, which the run says.",
        ),
    ],
)
def test_what_cannot_be_begun_with_is_one_line(options: list[str], said: str) -> None:
    at = ["--set", "sweep={}", "--set", f"{PARAMETER}=1.4"]
    base = ["follow", str(SCENE), *at, "--parameter", PARAMETER, "--from", "0.6", "--to", "1.6"]
    code, out, err = in_this_process([*base, *options])
    assert code == 2
    assert out == ""
    assert said in err
    assert err.count("\n") == 1
