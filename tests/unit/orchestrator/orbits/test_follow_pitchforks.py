"""Pitchforks of a scene followed over two of its numbers: printed, stored, drawn, and named where they cannot be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.command_line import in_this_process
from support.places import ROOT

import vibroimpact as vi
from vibroimpact.analysis.dataset.schema import CurvePoint, SpecialOrbit

STOPS = "stop=[{position=1.0,restitution=0.7},{side='lower',position=-1.0,restitution=0.7}]"
SCENE = [ROOT / "examples" / "bifurcation.toml", "--set", "sweep={}", "--set", STOPS]
ORBITS = ["--impacts", "2", "--seed", "0.1:1,3.24:2", "--step", "0.1", "--doublings", "0", "--grazes", "0"]


def test_the_curve_of_pitchforks_is_printed_stored_and_drawn(tmp_path: Path) -> None:
    output, figure = tmp_path / "loci.nc", tmp_path / "loci.png"
    point = ["--set", "forcing.angular_frequency=0.9", "--set", "forcing.amplitude=0.71"]
    first = ["--parameter", "forcing.angular_frequency", "--from", "0.87", "--to", "0.93"]
    second = ["--second", "forcing.amplitude", "--second-from", "0.69", "--second-to", "0.74"]
    done = in_this_process(
        "follow", *SCENE, *point, *first, *second, *ORBITS, "-o", output, "--figure", figure
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "1  pitchfork of P(2,1), 1 at stop 1, 1 at stop 2; begun from branch 1" in done.stdout
    assert "codimension 2, degenerate pitchfork: 0.8782046" in done.stdout
    assert (
        "fold of P(2,1), 1 at stop 1, 1 at stop 2; begun from curve 1, next to its degenerate" in done.stdout
    )
    assert "Not followed" not in done.stdout
    assert figure.stat().st_size > 0
    with vi.open_dataset(output) as found:
        kinds = found["orbit_special"].values
        assert set(kinds) == {SpecialOrbit.pitchfork, SpecialOrbit.fold, SpecialOrbit.graze}
        assert found["orbit_symmetric"].values[kinds == SpecialOrbit.pitchfork].all()
        np.testing.assert_allclose(
            found["orbit_multiplier_real"].values[kinds == SpecialOrbit.pitchfork], 1.0, atol=1e-7
        )
        at = found["curve_point_kind"].values == CurvePoint.degenerate_pitchfork
        np.testing.assert_allclose(found["curve_point_first"].values[at], 0.8782046057, atol=1e-9)
        np.testing.assert_allclose(found["curve_point_second"].values[at], 0.7365215771, atol=1e-9)


def test_a_pitchfork_is_named_where_the_second_number_breaks_the_symmetry() -> None:
    point = ["--set", "forcing.angular_frequency=0.98"]
    first = ["--parameter", "forcing.angular_frequency", "--from", "0.968", "--to", "0.99"]
    second = ["--second", "stop[1].position", "--second-from", "0.99", "--second-to", "1.01"]
    done = in_this_process("follow", *SCENE, *point, *first, *second, *ORBITS)
    assert (done.returncode, done.stderr) == (0, "")
    said = " ".join(done.stdout.split())
    assert "Not followed: pitchfork at 0.96935124, 1" in said
    assert "Pitchforks are followed over numbers that keep the mirror symmetry." in said
