"""Results of `vibroimpact maps` for scenes, and its refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import rgb_to_hsv, to_rgb
from support.command_line import in_this_process
from support.places import EXAMPLES

import vibroimpact as vi
from vibroimpact.analysis.figures.orbits.maps import dot_size, draw_maps

SETS = EXAMPLES / "thesis" / "figure_2_12.toml"
CHAOS = EXAMPLES / "thesis" / "figure_2_11.toml"
ONE = EXAMPLES / "basins.toml"
CHAIN = EXAMPLES / "thesis" / "figure_6_13.toml"


def scene(path: Path) -> vi.Scene:
    return vi.Scene.from_text(path.read_text(encoding="utf-8"), str(path))


def test_the_impact_map_has_the_impacts_of_the_run_and_the_orbit_on_it() -> None:
    of = scene(CHAOS).with_values({"record.recorded_periods": 300})
    found = vi.maps(of)
    run = vi.run(of)
    assert np.array_equal(found.phase.values, run.impact_phase.values)
    assert np.array_equal(found.velocity.values, run.impact_velocity.values)
    orbits = vi.find_orbits(of, 1, 1)
    assert found.orbit_name.values.tolist() == ["flip saddle P(1,1)"]
    assert found.orbit_phase.values == pytest.approx([orbits[0].phases[0]])
    assert found.orbit_velocity.values == pytest.approx([orbits[0].velocities[0]])


def test_dots_are_dark_and_the_fewer_the_larger() -> None:
    found = vi.maps(scene(ONE))
    figure = draw_maps(found)
    (dots,) = [line for line in figure.axes[0].lines if line.get_label() == "long run"]
    assert rgb_to_hsv(to_rgb(dots.get_color()))[2] < 0.6, "not a grey that is hardly seen"
    sizes = [dot_size(count) for count in (1, 2, 10, 100, 1000, 10_000, 1_000_000)]
    assert sizes == sorted(sizes, reverse=True)
    assert dots.get_markersize() == dot_size(found.phase.size)
    assert (sizes[1], sizes[-1]) == (4.0, 0.9), "points: a twentieth of an inch, a pixel of 80 to the inch"


def test_the_strobe_has_the_states_of_the_run_and_those_of_the_orbits() -> None:
    of = scene(ONE).with_values({"forcing.angular_frequency": 1.4})
    found = vi.maps(of, "strobe")
    assert found.displacement.sizes == {"state": 8}
    stable = next(
        place for place, name in enumerate(found.orbit_name.values) if str(name).startswith("stable")
    )
    started = of.with_values(
        {
            "body.displacement_start": float(found.orbit_displacement[stable]),
            "body.velocity_start": float(found.orbit_velocity[stable]),
            "record.transient_periods": 0,
        }
    )
    again = vi.run(started)
    assert again.strobe_displacement.values.ravel() == pytest.approx(
        float(found.orbit_displacement[stable]), abs=1e-9
    )


def test_the_attractor_meets_s_only_where_it_grazes() -> None:
    found = vi.maps(scene(SETS), "discontinuity", points=400)
    assert found.sizes["graze"] == 400, "at stop 1 and force .5 the body is pulled back at every phase"
    assert np.isfinite(found.before_velocity).sum() > 390
    assert found.orbit_name.values.tolist() == ["stable focus P(1,1)"]
    assert len(found.velocity) == 200


def test_nordmarks_map_of_a_scene_begins_at_its_graze() -> None:
    of = scene(EXAMPLES / "bifurcation.toml")
    found = vi.maps(of, "nordmark", span=(-0.01, 0.01), points=100)
    graze = found.attrs["grazing_amplitude"]
    hits = [
        vi.run(of.with_sweep({}).with_values({"forcing.amplitude": graze * factor})).sizes["impact"]
        for factor in (0.999, 1.001)
    ]
    assert hits[0] == 0 < hits[1]
    assert np.interp(0.0, found.rho, found.forcing_amplitude) == pytest.approx(graze)
    assert found.attrs["oscillator_damping_ratio"] < 1.0


@pytest.mark.parametrize(
    ("rho", "name"), [(5e-5, "P(1,9)"), (2e-4, "P(1,8)"), (5e-4, "P(1,7)"), (2e-3, "P(1,6)")]
)
def test_an_overdamped_oscillator_moves_as_its_nordmark_map_near_the_graze(rho: float, name: str) -> None:
    # thesis figure 2.18: alpha is beyond the range of an underdamped oscillator
    of = scene(EXAMPLES / "thesis" / "figure_2_18.toml")
    found = vi.maps(of, "nordmark", span=(rho * 0.999, rho * 1.001), points=10)
    assert (found.attrs["alpha"], found.attrs["gamma"]) == pytest.approx((0.65, 0.05), rel=1e-12)
    states = found.x.values[5]
    period = int(name[4:-1])
    assert np.allclose(states[period:], states[:-period], rtol=1e-6, atol=0.0)
    amplitude = found.attrs["grazing_amplitude"] * (1.0 + rho / found.attrs["rho_slope"])
    assert vi.classify(vi.run(of.with_values({"forcing.amplitude": amplitude})))[0].name == name


@pytest.mark.parametrize("kind", ["impact", "strobe"])
def test_bodies_of_several_modes_have_these_maps_too(kind: str) -> None:
    found = vi.maps(scene(CHAIN), kind)
    assert found.orbit_name.values.tolist()
    assert all(str(name).startswith(("stable P", "unstable P")) for name in found.orbit_name.values)
    vi.draw(found.assign_attrs(results_kind="maps"))


# ---- the command ----


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([str(SETS), "--kind", "discontinuity", "--points", "200"], "S has "),
        ([str(ONE), "--kind", "strobe"], "flip saddle P(1,1)"),
        (["--kind", "square-root", "--slope", "0.25"], "period 3 from"),
        (
            ["--kind", "nordmark", "--alpha", "0.65", "--gamma", "0.05"],
            "An oscillator of damping ratio 1.2668305 has these, forced at 5.3140467 times its frequency.",
        ),
        ([str(ONE), "--kind", "nordmark"], "Graze at the forcing amplitude 0.30614924"),
    ],
)
def test_the_command_tells_writes_and_draws(arguments: list[str], said: str, tmp_path: Path) -> None:
    files = ["-o", str(tmp_path / "m.nc"), "--figure", str(tmp_path / "m.png")]
    done = in_this_process("maps", *arguments, *files)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout
    assert (tmp_path / "m.png").read_bytes()[:4] == b"\x89PNG"
    with xr.open_dataset(tmp_path / "m.nc") as written:
        assert written.attrs["results_kind"] == "maps"
    drawn = in_this_process("plot", str(tmp_path / "m.nc"), "-o", str(tmp_path / "again.png"))
    assert drawn.returncode == 0, drawn.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "maps: scene: expected one for the kind impact, got none."),
        ([str(ONE), "--kind", "poincare"], "maps: kind: expected one of impact, strobe, discontinuity"),
        (["--kind", "nordmark"], "maps: scene: expected one for the kind nordmark, got none."),
        (["--kind", "nordmark", "--alpha", "1"], "maps: alpha, gamma: expected both or neither"),
        (
            ["--kind", "nordmark", "--alpha", "1", "--gamma", "2"],
            "maps: gamma: expected a number from 0 to 1, got 2.",
        ),
        (
            [str(ONE), "--kind", "nordmark", "--restitution", "1"],
            "maps: restitution: expected with alpha and gamma",
        ),
        (["--kind", "square-root", "--slope", "nan"], "maps: slope: expected a number from 0 to 1, got nan."),
        (["--kind", "square-root", "--alpha", "1"], "maps: alpha: expected with the kinds that take it"),
        (["--kind", "square-root", "--from", "0"], "maps: from, to: expected both or neither"),
        (["--kind", "square-root", "--from", "1", "--to", "0"], "the smaller one first, got 1, 0."),
        (["--kind", "square-root", "--points", "3"], "maps: points: expected 10 to 100000, got 3."),
        (["--kind", "square-root", "--set", "a=1"], "--set: expected a scene to change, got none."),
        ([str(ONE), "--from", "0", "--to", "1"], "maps: from, to: expected with the kinds that take it"),
        ([str(CHAIN), "--kind", "nordmark"], "body.kind: expected an oscillator for Nordmark's map"),
        ([str(ONE), "--kind", "nordmark", "--set", "forcing.amplitude=0"], "expected a force, got 0."),
        (["no.toml"], "no.toml"),
    ],
)
def test_what_has_no_map_is_one_line(arguments: list[str], said: str) -> None:
    done = in_this_process("maps", *arguments)
    assert done.returncode == 2, done.stdout
    assert said in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_chain_has_no_sets_s_and_w() -> None:
    done = in_this_process("maps", str(CHAIN), "--kind", "discontinuity")
    assert done.returncode == 2
    assert "maps: expected a body of one mode and one stop, got 2 and 1." in done.stderr
