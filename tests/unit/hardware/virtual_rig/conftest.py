"""The rig of the conformance tests: the virtual rig in lockstep, or with `--real-rig` a board."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from support.places import ROOT
from support.rig_bench import Bench, opened_bench, opened_real_bench


@pytest.fixture(scope="module")
def rig(request: pytest.FixtureRequest) -> Iterator[Bench]:
    real = request.config.getoption("real_rig")
    table = opened_real_bench(real) if real else opened_bench(ROOT / "examples" / "rig" / "oscillator.toml")
    with table as opened:
        yield opened


@pytest.fixture
def bench(rig: Bench) -> Iterator[Bench]:
    rig.as_it_waits()
    yield rig
    rig.clear()
