"""Basins of scenes. References: single runs with their class, unstable orbits, mirrored scenes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.orbits.attractors import basin_search
from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.hard_cases.loose import ball_in_cavity
from vibroimpact.orchestrator.orbits import basins as basins_module
from vibroimpact.orchestrator.orbits.body_flow import BodyFlow

SCENE = EXAMPLES / "basins.toml"
CHAIN = EXAMPLES / "thesis" / "figure_6_13.toml"
BEAM = EXAMPLES / "thesis" / "figure_7_11.toml"
LONG = {
    "record.transient_periods": 2000,
    "record.recorded_periods": 64,
    "record.impacts": True,
    "record.extrema": True,
    "record.strobe": True,
}


def scene(path: Path = SCENE, **changes: Any) -> vi.Scene:
    plain = vi.Scene.from_text(path.read_text(encoding="utf-8"), str(path)).with_sweep({})
    return plain.with_values({key.replace("__", "."): value for key, value in changes.items()})


def agrees_with_single_runs(found: xr.Dataset, of: vi.Scene, keys: tuple[str, str], count: int) -> None:
    """Run some starts one by one: each has the class of its cell, and ends on the attractor of its cell."""
    draw = np.random.default_rng(2)
    for x, y in draw.random((count, 2)):
        at = found.isel(
            displacement_start=int(x * found.sizes["displacement_start"]),
            velocity_start=int(y * found.sizes["velocity_start"]),
        )
        number = int(at.basin)
        if number < 0:
            continue
        start = {keys[0]: float(at.displacement_start), keys[1]: float(at.velocity_start)}
        run = vi.run(of.with_values({**LONG, **start}))
        name = vi.classify(run)[0].name.replace("unknown", "aperiodic")
        assert str(found.attractor_name.values[number]).startswith(name)
        last = run.strobe_displacement.values.ravel()[-1], run.strobe_velocity.values.ravel()[-1]
        states = found.isel(attractor=number)
        away = np.hypot(states.attractor_displacement - last[0], states.attractor_velocity - last[1])
        assert name in ("chaos", "aperiodic") or float(away.min()) < 1e-6


OSCILLATOR = ("body.displacement_start", "body.velocity_start")


@pytest.mark.parametrize(
    ("frequency", "names"),
    [(0.84, {"P(2,2)", "P(1,2)"}), (1.4, {"P(1,1)", "no impacts"}), (0.72, {"chaos"})],
)
def test_the_cells_of_a_plane_are_what_single_runs_are(frequency: float, names: set[str]) -> None:
    of = scene(forcing__angular_frequency=frequency)
    found = vi.basins(of, points=(40, 30))
    assert set(found.attractor_name.values) == names
    assert found.basin.shape == (30, 40)
    assert float(found.basin_fraction.sum()) == pytest.approx(1.0)
    agrees_with_single_runs(found, of, OSCILLATOR, 12)


def test_a_forcing_phase_at_the_start_turns_the_plane() -> None:
    of = scene(forcing__phase=2.0)
    agrees_with_single_runs(vi.basins(of, points=(40, 40)), of, OSCILLATOR, 10)


def test_an_attractor_is_in_its_own_basin_and_the_unstable_orbit_on_the_border() -> None:
    of = scene(forcing__angular_frequency=1.4)
    found = vi.basins(of, (-1.6, 1.0), (-2.5, 2.5), (200, 200))
    for number in range(found.sizes["attractor"]):
        state = found.isel(attractor=number, period=0)
        cell = found.basin.sel(
            displacement_start=state.attractor_displacement,
            velocity_start=state.attractor_velocity,
            method="nearest",
        )
        assert int(cell) == number
    (unstable,) = (orbit for orbit in vi.find_orbits(of, 1, 1) if not orbit.is_stable)
    turns = np.array([2.0 * np.pi])  # turns of the force: a phase 0 after the impact
    x, v = unstable.at(turns)
    cells = found.basin.sel(
        displacement_start=slice(x[0] - 0.03, x[0] + 0.03), velocity_start=slice(v[0] - 0.05, v[0] + 0.05)
    )
    assert len(np.unique(cells)) == 2


def test_a_mirrored_scene_has_the_mirrored_basins() -> None:
    # half a period later a force is its own mirror image
    of = scene()
    mirrored = scene(stop=[{"position": -1.0, "side": "lower", "restitution": 0.7}], forcing__phase=np.pi)
    one = vi.basins(of, (-2.0, 1.0), (-2.5, 2.5), (60, 50))
    other = vi.basins(mirrored, (-1.0, 2.0), (-2.5, 2.5), (60, 50))
    names = {name: place for place, name in enumerate(one.attractor_name.values)}
    relabelled = np.array([names[name] for name in other.attractor_name.values])[other.basin.values]
    assert (relabelled[::-1, ::-1] == one.basin.values).mean() > 0.999


def test_attractors_that_are_mirror_images_of_each_other_are_two() -> None:
    both = [{"position": 0.3, "restitution": 0.8}, {"position": -0.3, "side": "lower", "restitution": 0.8}]
    found = vi.basins(scene(stop=both, forcing__angular_frequency=1.3), points=(60, 60))
    assert sorted(found.attractor_name.values) == ["P(2,1) a", "P(2,1) b"]
    one, other = found.basin_fraction.values
    assert one == pytest.approx(other, abs=0.02)


TWO_CHAOTIC = [
    {"position": side, "side": name, "restitution": 0.7} for side, name in ((1.0, "upper"), (-1.0, "lower"))
]


@pytest.fixture
def brief_transients(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the transients of long runs of chaotic starts: the runs of these scenes settle in fewer periods."""
    monkeypatch.setattr(basin_search, "TRANSIENT_OF_CHAOS", 300)


@pytest.mark.usefixtures("brief_transients")
def test_chaotic_attractors_that_are_mirror_images_of_each_other_are_two() -> None:
    changes: dict[str, Any] = {
        "stop": TWO_CHAOTIC,
        "forcing__angular_frequency": 0.9,
        "body__damping_ratio": 0.04,
    }
    of = scene(**changes)
    found = vi.basins(of, (-1.0, 1.0), (-3.0, 3.0), (40, 40))
    assert found.attractor_name.values.tolist() == ["chaos a", "chaos b"]
    assert found.attractor_partner.values.tolist() == [1, 0]
    separated = [found.attrs[f"separat{key}"] for key in ("ed_by_features", "ed_by_recurrence", "ions_agree")]
    assert separated == [2, 2, 1]
    assert ((found.attractor_dimension > 1.0) & (found.attractor_dimension < 1.5)).all()
    assert found.basin_fraction.values == pytest.approx([0.5, 0.5], abs=0.03)
    often, seldom = found.attractor_impacts.values[0]
    assert found.attractor_impacts.values == pytest.approx(
        np.array([[often, seldom], [seldom, often]]), abs=0.02
    )
    for x, y in ((0.3, 0.0), (-0.3, 0.0), (0.9, -0.7), (0.5, 0.7), (-0.5, 0.7), (0.0, 1.5)):
        start = {OSCILLATOR[0]: x, OSCILLATOR[1]: y}
        run = vi.run(of.with_values({**LONG, **start, "record.recorded_periods": 400}))
        counts = np.bincount(run.impact_contact.values.astype(int), minlength=3)[1:]
        at = found.sel(displacement_start=x, velocity_start=y, method="nearest")
        ends = found.attractor_impacts.values[int(at.basin)]
        assert (x, y) == (0.9, -0.7) or np.argmax(ends) == np.argmax(counts), (
            "next to a border a cell is coarse"
        )


@pytest.mark.usefixtures("brief_transients")
def test_one_attractor_of_a_long_period_stays_one_and_says_what_its_sample_may_have_missed() -> None:
    stop = [{"position": 0.0, "restitution": 0.8}]
    changes: dict[str, Any] = {
        "stop": stop,
        "forcing__amplitude": 1.0,
        "forcing__angular_frequency": 2.9,
        "body__damping_ratio": 0.01,
    }
    found = vi.basins(scene(**changes), (-1.0, 0.0), (-2.0, 2.0), (40, 40))
    # each rest on the stop ends at one phase, so the motion repeats from one rest to the next
    (name,) = found.attractor_name.values.tolist()
    assert name.startswith("P(inf,")
    assert found.attractor_exponent.item() == -np.inf
    assert found.attrs["chaotic_by_sample"] == 1600 - 256
    assert found.attrs["undetected_share_below"] == pytest.approx(0.0116, abs=2e-4)


@pytest.mark.parametrize("number", [1, 2])
def test_the_plane_of_a_ball_in_a_cavity_ends_at_its_contacts(number: int) -> None:
    found = vi.basins(vi.Scene.from_dict(ball_in_cavity(0.1, 1.4)), points=(4, 4), number=number)
    assert found.attractor_name.values.tolist() == ["P(2,1)"]
    assert (found.basin.values == 0).all()  # no start is beyond a contact
    metres = [0.1**-0.5, 1.0][number - 1]  # of the ball, or of the frame, for a unit of the mode
    ends = found.displacement_start.values[[0, -1]] * metres
    assert ends == pytest.approx([-0.4, 0.4], rel=1e-12)


def test_a_chain_and_a_beam_have_basins_of_one_of_their_parts() -> None:
    chain = scene(CHAIN)
    found = vi.basins(chain, points=(30, 30))
    assert found.displacement_start.attrs["long_name"] == "displacement of mass 2 at the start"
    assert (found.basin == -2).any(), "starts beyond the stop are none"
    assert not (found.basin.sel(displacement_start=slice(0.11, None)) >= 0).any()
    keys = ("body.displacement_start", "body.velocity_start")
    for x, y in ((-0.3, 0.1), (0.05, -0.2)):
        at = found.sel(displacement_start=x, velocity_start=y, method="nearest")
        start = {keys[0]: [0.0, float(at.displacement_start)], keys[1]: [0.0, float(at.velocity_start)]}
        kind = vi.classify(vi.run(chain.with_values({**LONG, **start})))[0]
        assert str(found.attractor_name.values[int(at.basin)]).startswith(kind.name)
    beam = vi.basins(scene(BEAM), points=(12, 10))
    assert "mode 1" in beam.velocity_start.attrs["long_name"]
    assert float(beam.attrs["decided"]) == 1.0


# ---- nothing is dropped ----

SLOW_NEIGHBOURS = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.04},
    "forcing": {"amplitude": 0.8909617263261187, "angular_frequency": 2.859492593703901},
    "stop": [{"position": 0.1465115093658713, "side": "upper", "restitution": 0.9141871628379921}],
    "record": {"recorded_periods": 8},
}
"""P(12,16) has the multiplier -.8597; its neighbours grow 40 times before they come back."""
WEAKLY_DAMPED: dict[str, Any] = {
    "scene": {"units": "nondimensional"},
    "body": {"mass": 1.0, "stiffness": 1.0, "damping": 0.002},
    "forcing": {"amplitude": 0.5, "angular_frequency": 3.2},
    "stop": [{"position": 0.4, "side": "upper", "restitution": 0.7}],
    "record": {"recorded_periods": 8},
}
"""More than half of the starts need thousands of periods until they meet the stop no more."""


def test_an_attractor_whose_neighbours_come_back_slowly_is_named() -> None:
    found = vi.basins(SLOW_NEIGHBOURS, points=(14, 14))
    assert found.attrs["decided"] > 0.99
    shares = dict(zip(found.attractor_name.values, found.basin_fraction.values, strict=True))
    assert shares["P(12,16)"] == pytest.approx(0.30, abs=0.1)
    assert shares["P(4,8)"] == pytest.approx(0.62, abs=0.1)
    number = found.attractor_name.values.tolist().index("P(12,16)")
    assert float(found.attractor_multiplier[number]) ** 16 == pytest.approx(0.8597, abs=1e-3)
    agrees_with_single_runs(found, vi.Scene.from_dict(SLOW_NEIGHBOURS), OSCILLATOR, 6)


@pytest.mark.parametrize("damping", [0.002, 0.0005])
def test_starts_of_a_weakly_damped_body_run_until_their_slowest_motion_has_decayed(damping: float) -> None:
    scene = {**WEAKLY_DAMPED, "body": {"mass": 1.0, "stiffness": 1.0, "damping": damping}}
    found = vi.basins(scene, points=(8, 8))
    assert found.attrs["decided"] > 0.99
    assert not {"chaos", "aperiodic"} & set(found.attractor_name.values), "slow transients are no chaos"
    number = found.attractor_name.values.tolist().index("no impacts")
    decay = 0.5 * damping * 2.0 * np.pi / 3.2
    assert float(found.attractor_multiplier[number]) == pytest.approx(np.exp(-decay), rel=1e-6)
    for cell in np.argwhere(found.basin.values == number)[::9]:
        x, y = float(found.displacement_start[cell[1]]), float(found.velocity_start[cell[0]])
        start = {**scene["body"], "displacement_start": x, "velocity_start": y}
        long = {"transient_periods": int(12.0 / decay), "recorded_periods": 40}
        run = vi.run({**scene, "body": start, "record": long})
        assert int(run.impact_count) == 0


@pytest.mark.parametrize(("path", "multiplier"), [("chatter", 0.0), ("thesis/figure_6_5a", None)])
def test_a_motion_that_rests_on_a_stop_in_each_period_has_infinitely_many_impacts(
    path: str, multiplier: float | None
) -> None:
    of = scene(EXAMPLES / f"{path}.toml")
    found = vi.basins(of, points=(3, 3))
    assert found.attractor_name.values.tolist() == ["P(inf,1)"]
    assert vi.classify(vi.run(of.with_values(LONG)))[0].name == "P(inf,1)"
    if multiplier is not None:  # one mode forgets all where it rests
        assert float(found.attractor_multiplier[0]) == multiplier


def test_a_ball_that_locks_on_its_table_is_apart_from_its_orbit() -> None:
    table = {
        "body": {"mass": 1.0, "stiffness": 0.0, "displacement_start": -0.5},
        "exciter": {"gain": 1.0, "offset": 1.0},
        "forcing": {"amplitude": 1.52, "angular_frequency": 1.0},
        "stop": [{"position": 0.0, "restitution": 0.5}],
        "record": {"recorded_periods": 4},
    }
    found = vi.basins(table, (-1.2, -0.1), (1.5, 3.0), (8, 8), edges=True)
    assert set(found.attractor_name.values) == {"P(inf,1)", "P(4,2)"}
    multipliers = dict(zip(found.attractor_name.values, found.attractor_multiplier.values, strict=True))
    assert multipliers["P(inf,1)"] == 0.0, "differences of rounding size are no multiplier"
    assert multipliers["P(4,2)"] ** 2 == pytest.approx(0.475823, abs=1e-5)
    assert found.edge_orbit.values.tolist() == ["P(2,1)"]


def test_a_budget_that_is_too_small_is_printed_and_kept(tmp_path: Path) -> None:
    file = tmp_path / "b.nc"
    sizes = ["--set", "body.damping_ratio=0.001", "--points", "8", "--periods", "200", "-o", str(file)]
    done = in_this_process("basins", str(SCENE), *sizes)
    assert done.returncode == 0, done.stderr
    assert "more than the budget of 200. Raise --periods." in done.stdout
    with xr.open_dataset(file) as written:
        assert written.attrs["followed_periods"] <= written.attrs["most_periods"] == 200
        assert written.attrs["needed_periods"] > 200


def test_shares_have_intervals_and_mirror_images_are_named() -> None:
    both = [{"position": 0.3, "restitution": 0.8}, {"position": -0.3, "side": "lower", "restitution": 0.8}]
    found = vi.basins(scene(stop=both, forcing__angular_frequency=1.3), points=(20, 20))
    assert found.attractor_partner.values.tolist() == [1, 0]
    low, high = found.basin_fraction_low.values, found.basin_fraction_high.values
    assert (low < found.basin_fraction.values).all()
    assert (found.basin_fraction.values < high).all()
    assert found.attrs["missed_share_below"] == pytest.approx(1.0 - 0.05 ** (1.0 / 400.0))
    lone = vi.basins(scene(), points=(6, 6))
    assert set(lone.attractor_partner.values.tolist()) == {-1}


# ---- the command ----


def test_the_command_prints_writes_and_draws(tmp_path: Path) -> None:
    files = ["-o", str(tmp_path / "b.nc"), "--figure", str(tmp_path / "b.png")]
    done = in_this_process("basins", str(SCENE), "--points", "40x30", "--x=-1:0.9", "--y", "-1:1", *files)
    assert done.returncode == 0, done.stderr
    assert "P(2,2)" in done.stdout
    assert (tmp_path / "b.png").read_bytes()[:4] == b"\x89PNG"
    with xr.open_dataset(tmp_path / "b.nc") as written:
        sizes = {"velocity_start": 30, "displacement_start": 40, "attractor": 2, "period": 2, "stop": 1}
        assert written.sizes == sizes
        assert written.displacement_start.values[[0, -1]].tolist() == [-1.0, 0.9]


def test_ctrl_c_leaves_what_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(basins_module, "BLOCK", 500)
    follow = BodyFlow.follow
    calls = [0]

    def interrupted(self: Any, states: Any, periods: int, *, first: bool = False) -> Any:
        calls[0] += len(states) == 500
        if calls[0] > 2:
            raise KeyboardInterrupt
        return follow(self, states, periods, first=first)

    monkeypatch.setattr(BodyFlow, "follow", interrupted)
    done = in_this_process("basins", str(SCENE), "--points", "100", "-o", str(tmp_path / "b.nc"))
    assert done.returncode == 130
    assert "came near to no attractor that is known" in done.stdout
    with xr.open_dataset(tmp_path / "b.nc") as written:
        assert 0.0 < written.attrs["decided"] < 0.2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--x", "1"], "--x: expected LOW:HIGH, two numbers, got '1'."),
        (["--x", "1:0"], "basins: x: expected two finite numbers, the smaller one first, got 1 to 0."),
        (["--y", "0:inf"], "basins: y: expected two finite numbers, the smaller one first, got 0 to inf."),
        (
            ["--points", "1"],
            "basins: points: expected 2 at least along each axis and 16000000 in all, got 1 x 1.",
        ),
        (["--points", "9999x9999"], "basins: points: expected 2 at least"),
        (["--points", "-3"], "--points: expected a number of starts, or two as 300x200, got '-3'."),
        (["--points", "3x4x5"], "--points: expected a number of starts"),
        (["--number", "2"], "basins: number: expected 1, an oscillator's only mass, got 2."),
        (["--x", "1.5:2"], "basins: x: expected starts on the free side of the stops, got none."),
        (["--set", "stop=[]"], "stop: expected a restitution stop, got none."),
        (["--set", "forcing.amplitude=nan"], "forcing.amplitude"),
    ],
)
def test_what_has_no_basins_is_one_line(arguments: list[str], said: str) -> None:
    done = in_this_process("basins", str(SCENE), *arguments)
    assert done.returncode == 2, done.stdout
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_masses_that_a_chain_has_not_are_refused() -> None:
    with pytest.raises(UsageError, match="number: expected a mass from 1 to 2, got 3"):
        vi.basins(scene(CHAIN), number=3)


# ---- edges ----


def test_the_edge_of_two_basins_has_the_unstable_orbit_that_is_known_in_closed_form(tmp_path: Path) -> None:
    of = scene(forcing__angular_frequency=1.4)
    found = vi.basins(of, points=(12, 12), edges=True)
    (unstable,) = (orbit for orbit in vi.find_orbits(of, 1, 1) if not orbit.is_stable)
    assert found.edge_orbit.values.tolist() == ["P(1,1)"]
    assert found.edge_multiplier.values[0] == pytest.approx(unstable.multipliers.real, rel=1e-9)
    phase, stop = found.edge_seed.values[0].split(":")
    assert stop == "1"
    assert float(phase) == pytest.approx(unstable.phases[0], rel=1e-9)
    x, v = unstable.at(np.array([2.0 * np.pi]))
    at = float(found.edge_displacement[0, 0]), float(found.edge_velocity[0, 0])
    assert at == pytest.approx((x[0], v[0]), abs=1e-5)
    assert vi.draw(found).axes


@pytest.mark.usefixtures("brief_transients")
def test_the_edge_of_a_chaotic_pair_has_a_symmetric_saddle_that_follow_takes() -> None:
    changes: dict[str, Any] = {
        "stop": TWO_CHAOTIC,
        "forcing__angular_frequency": 0.9,
        "body__damping_ratio": 0.04,
    }
    of = scene(**changes)
    found = vi.basins(of, (-1.0, 1.0), (-3.0, 3.0), (12, 12), edges=True)
    assert found.edge_orbit.values.tolist() == ["P(2,1), 1 at stop 1, 1 at stop 2"]
    largest, second = found.edge_multiplier.values[0]
    assert (largest, second) == pytest.approx((2.857171, 0.048073), rel=1e-5)
    # both sides of the edge part at the rate of the multiplier
    assert found.edge_exponent.item() == pytest.approx(np.log(largest), abs=1e-3)
    assert largest * second == pytest.approx(0.7**4 * np.exp(-2.0 * 0.04 * 2.0 * np.pi / 0.9), rel=1e-9)
    seed = [(float(p), int(s)) for p, s in (each.split(":") for each in found.edge_seed.values[0].split(","))]
    assert seed[1][0] - seed[0][0] == pytest.approx(np.pi, abs=1e-9), "half a period apart"
    branch = vi.follow(of, "forcing.angular_frequency", 0.89, 0.91, seed=seed, doublings=0)
    assert (branch.impact_count == 2).any()


def test_a_plane_of_one_basin_has_no_edge() -> None:
    found = vi.basins(scene(forcing__angular_frequency=0.72), points=(5, 5), edges=True)
    assert found.sizes["edge"] == 0
