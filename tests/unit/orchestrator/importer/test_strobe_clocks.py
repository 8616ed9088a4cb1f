"""The strobes of our own exports in our importer: they tick in both kinds, and let a triggered clock tick with them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from mpmath import mp
from support import fmu_factory
from support.coupled_parts import link, part, values
from xarray import Dataset

import vibroimpact as vi
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.orchestrator.fmi.clock_calls import ClockedInstance
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ComponentSpec, RunAs

FREQUENCY = 2.0
PERIOD = 2.0 * math.pi / FREQUENCY
STARTS = {
    "damping": 0.1,
    "forcing.amplitude": 0.5,
    "forcing.angular_frequency": FREQUENCY,
    "contact[1].law": 1,
    "contact[1].position": 0.1,
    "contact[1].restitution": 0.7,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("strobes")
    fmu_factory.timed(folder)
    export_fmu("oscillator", folder / "body.fmu", starts=STARTS, strobes=True)
    return folder


def instants(count: int) -> list[float]:
    """Return the first exact instants of phase zero, s, to the nearest double: 2 pi k / frequency."""
    with mp.workdps(50):
        return [float(2 * mp.pi * k / FREQUENCY) for k in range(count)]


@pytest.mark.parametrize(
    ("run_as", "periods", "macro_step"),
    [("co_simulation", 10_000, 7.3), ("co_simulation", 100, 0.37), ("model_exchange", 150, 7.3)],
)
def test_a_triggered_clock_ticks_with_each_strobe(
    folder: Path, monkeypatch: pytest.MonkeyPatch, run_as: RunAs, periods: int, macro_step: float
) -> None:
    ticks: list[float] = []
    own = ClockedInstance.set_clocks

    def watched(self: ClockedInstance, references: Sequence[int]) -> None:
        if references == [44]:
            ticks.append(self.time)
        own(self, references)

    monkeypatch.setattr(ClockedInstance, "set_clocks", watched)
    body = ComponentSpec("body", folder / "body.fmu", {}, run_as=run_as, tolerance=1e-9)
    counter = part("counter", folder / "Timed.fmi3.fmu", period=1e9, shift=1e9, delay=1e9)
    links = [link("body.phase_zero", "counter.hit"), link("body.strobe.displacement", "counter.u")]
    importer = Importer([body, counter], links, macro_step=macro_step * PERIOD)
    importer.begin()
    importer.advance((periods + 0.5) * PERIOD)
    hits, last = values(importer, "counter", "hits", "last")
    (strobed,) = values(importer, "body", "strobe.displacement")
    (impacts,) = importer.components["body"].group("Int64", ("contact[1].count",)).get()
    importer.free()
    assert hits == len(ticks) == periods + 1
    np.testing.assert_allclose(ticks[1:], instants(periods + 1)[1:], rtol=1e-15)
    assert last == strobed != 0.0
    assert impacts > periods // 3


def scene(folder: Path, run_as: str) -> Dataset:
    document = {
        "component": {
            "body": {"fmu": "body.fmu", "run_as": run_as, "tolerance": 1e-10},
            "counter": {"fmu": "Timed.fmi3.fmu", "parameters": {"period": 1e9, "shift": 1e9, "delay": 1e9}},
        },
        "connection": [
            {"from": "body.phase_zero", "to": "counter.hit"},
            {"from": "body.strobe.velocity", "to": "counter.u"},
        ],
        "record": {
            "recorded_time": 20.25 * PERIOD,
            "rate": 50,
            "variables": ["body.strobe.velocity", "counter.last", "counter.hits"],
        },
        "execution": {"guard": False, "macro_step": 0.9 * PERIOD},
    }
    (folder / "s.toml").write_text(tomli_w.dumps(document))
    return vi.run(folder / "s.toml")


def test_a_scene_samples_the_poincare_section_at_the_strobes_in_both_kinds(folder: Path) -> None:
    sections = []
    for run_as in ("co_simulation", "model_exchange"):
        made = scene(folder, run_as)
        found = {v.attrs.get("component_variable"): v.values for v in made.data_vars.values()}
        assert found["counter.hits"][-1] == 21.0
        assert found["counter.last"][-1] == found["body.strobe.velocity"][-1]
        sections.append(np.unique(found["body.strobe.velocity"]))
        assert sections[-1].size == 21
    np.testing.assert_allclose(sections[0], sections[1], atol=1e-6)
