"""What `vibroimpact orbit` refuses, and what it finds from what it is given."""

from __future__ import annotations

import pytest
from support.command_line import in_this_process
from support.places import ROOT

SCENE = ROOT / "examples" / "bifurcation.toml"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--impacts", "0"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 0 in 1."),
        (["--periods", "0"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 1 in 0."),
        (["--impacts", "65"], "orbit: expected 1 to 64 impacts in 1 or more periods, got 65 in 1."),
        (["--impacts", "-1", "--periods", "2"], "got -1 in 2."),
    ],
)
def test_orbits_that_cannot_be_are_refused_in_one_line(options: list[str], said: str) -> None:
    done = in_this_process("orbit", SCENE, *options)
    assert done.returncode == 2
    assert said in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
