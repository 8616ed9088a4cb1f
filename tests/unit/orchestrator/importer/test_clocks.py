"""Clocks whose intervals change, and triggered clocks: their FMUs refuse a missed tick, and one at a wrong time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import fmu_factory
from support.coupled_parts import link, part, values
from support.fmu_factory import redescribed

from vibroimpact.analysis.dataset import Outcome
from vibroimpact.fmus.errors import ComponentError, SceneError
from vibroimpact.orchestrator.fmi.clock_calls import ClockedInstance, Interval
from vibroimpact.orchestrator.importer.master import Importer
from vibroimpact.orchestrator.importer.specification import ConnectionSpec, Exchange
from vibroimpact.orchestrator.run.general import GeneralRunner
from vibroimpact.orchestrator.scene import parse_scene

COUNTS = ("beats", "strides", "fuses", "hits", "sum", "last")
MODEL_CLOCKS = (
    '<Clock name="tick" valueReference="40" causality="input" intervalVariability="constant" intervalDecimal=".25"/>'
    '<Clock name="fuse" valueReference="41" causality="input" intervalVariability="countdown"/>'
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("clocks")
    fmu_factory.timed(folder)
    fmu_factory.faulty(folder)
    place = '<Float64 name="der(x)"'
    redescribed(fmu_factory.exchanged(folder), folder / "Clocks.fmu", (place, MODEL_CLOCKS + place))
    return folder


@pytest.fixture
def timed(folder: Path) -> Path:
    return folder / "Timed.fmi3.fmu"


def ends(importer: Importer, time: float, *names: str) -> list[list[float]]:
    """Return the counts of components at a time, s."""
    importer.begin()
    importer.advance(time)
    found = [values(importer, name, *COUNTS) for name in names]
    importer.free()
    return found


def total(instants: list[float], end: float) -> float:
    """Return the integral of the number of ticks."""
    return sum(max(0.0, end - time) for time in instants)


@pytest.mark.parametrize("exchange", ["gauss_seidel", "jacobi", "iterated"])
@pytest.mark.parametrize("macro_step", [0.03, 1.0])
def test_clocks_of_all_kinds_tick_at_their_instants(
    folder: Path, timed: Path, macro_step: float, exchange: Exchange
) -> None:
    ramp = part("y", folder / "Faulty.fmi3.fmu")
    parts = [part("a", timed), part("b", timed, period=0.3, delay=0.0), ramp]
    links = [link("a.out", "b.hit"), link("y.y", "b.u")]
    first, second = ends(
        Importer(parts, links, macro_step=macro_step, exchange=exchange),
        1.95,
        "a",
        "b",
    )
    beats, strides = [0.25 * k for k in range(8)], [0.125, 0.375, 0.75, 1.25, 1.875]
    fuses, hits = [0.5625, 1.3125], [0.25, 0.5625, 0.75, 1.25, 1.3125, 1.75]
    assert first[:4] == [8.0, 5.0, 2.0, 0.0]
    assert first[4] == pytest.approx(total(beats + strides + fuses, 1.95), abs=1e-12)
    slow, at_once = (
        [0.3 * k for k in range(7)],
        [0.6, 1.5],
    )  # a countdown of 0 s ticks at the instant that lights it
    assert second[:4] == [7.0, 5.0, 2.0, 6.0]
    assert second[4] == pytest.approx(total(slow + strides + at_once + hits, 1.95), abs=1e-9)
    assert second[5] == pytest.approx(1.75, abs=1e-12)  # u of the last hit, taken at its instant


def test_a_variable_of_an_output_clock_is_carried_at_its_ticks(folder: Path, timed: Path) -> None:
    links = [link("a.out", "b.hit"), link("a.gated", "b.u")]
    (found,) = ends(Importer([part("b", timed), part("a", timed)], links, macro_step=0.1), 1.3, "b")
    assert found[3] == 4.0
    assert found[5] == 501.0  # at 1.25: five beats and a fuse before


def test_a_tuned_interval_counts_from_the_event_that_tunes_it(folder: Path, timed: Path) -> None:
    # at the end of each step, also at ticks, the period is .3 - t / 10; a change counts from there
    ramp = part("y", folder / "Faulty.fmi3.fmu")
    tuned = ConnectionSpec(("y", "y"), ("a", "period"), gain=-0.1, offset=0.3)
    (found,) = ends(Importer([part("a", timed), ramp], [tuned], macro_step=0.25), 1.3, "a")
    beats, strides = [0.0, 0.75, 0.975, 1.23375], [0.125, 0.375, 0.75, 1.25]
    assert found[:3] == [4.0, 4.0, 1.0]
    assert found[4] == pytest.approx(total([*beats, *strides, 0.975 + 0.0625], 1.3), abs=1e-9)


@pytest.mark.parametrize("macro_step", [0.07, 2.0])
def test_clocks_tick_in_model_exchange(folder: Path, macro_step: float) -> None:
    importer = Importer([part("m", folder / "Clocks.fmu", kind=20.0, x=0.0, at=0.1)], macro_step=macro_step)
    importer.begin()
    importer.advance(1.1)
    x, v, count = values(importer, "m", "x", "v", "count")
    importer.free()
    # ticks at 0, .25, .5: the third lights the fuse, which stops the mass at .6; ticks at .75, 1
    assert count == 5.0
    assert v == pytest.approx(2.0)
    assert x == pytest.approx(0.25 + 0.5 + 0.3 + 0.25 + 0.2, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(
    period=st.floats(0.01, 0.7),
    shift=st.floats(0.0, 0.5),
    delay=st.floats(0.0, 0.9),
    macro_step=st.floats(0.01, 1.5),
    end=st.floats(0.3, 2.0),
)
def test_no_tick_is_missed_whatever_the_intervals(
    folder: Path, period: float, shift: float, delay: float, macro_step: float, end: float
) -> None:
    fmu = folder / "Timed.fmi3.fmu"
    one = part("a", fmu, period=period, shift=shift, delay=delay)
    importer = Importer([one, part("b", fmu)], [link("a.out", "b.hit")], macro_step=macro_step)
    found, other = ends(importer, end, "a", "b")  # the FMU refuses a tick that is missed or at a wrong time
    expected = shift + period * np.arange(end / period + 2.0)
    is_clear = np.abs(expected - end).min() > 1e-9  # a tick at the end may come before or after it
    assert not is_clear or found[0] == (expected < end).sum()
    assert other[3] == found[0] // 2 + found[2]


# ---- what a clock may not do ----


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        ((float("nan"), Interval.changed), "clock stride: expected an interval >= 0, got nan s at time 0"),
        ((-1.0, Interval.changed), "clock stride: expected an interval >= 0, got -1 s at time 0"),
        ((1.0, Interval.not_yet_known), "clock stride: expected an interval >= 0, got none at time 0"),
        ((0.0, Interval.changed), "clock stride: expected ticks that end, got 100 at one instant at time 0"),
    ],
)
def test_a_false_interval_is_an_error_with_the_clock(
    timed: Path, monkeypatch: pytest.MonkeyPatch, answer: tuple[float, Interval], reason: str
) -> None:
    sound = ClockedInstance.clock_interval
    monkeypatch.setattr(
        ClockedInstance, "clock_interval", lambda self, ref: (sound(self, ref), answer)[ref == 41]
    )
    monkeypatch.setattr(ClockedInstance, "set_clocks", lambda self, references: None)
    importer = Importer([part("a", timed)], macro_step=0.1)
    with pytest.raises(ComponentError, match=reason):
        importer.begin()
    importer.free()


SCENE = """
[component.a]
fmu = "Timed.fmi3.fmu"
[component.b]
fmu = "Timed.fmi3.fmu"
[[connection]]
from = "a.{source}"
to = "b.{target}"
[record]
recorded_time = 1.0
rate = 10
variables = ["b.hits"]
[execution]
macro_step = 0.1
"""


def test_a_scene_connects_an_output_clock_with_a_triggered_one(folder: Path) -> None:
    scene = parse_scene(SCENE.format(source="out", target="hit"), str(folder / "scene.toml"))
    runner = GeneralRunner(scene)
    record = runner.run({})
    runner.close()
    assert record.outcome is Outcome.ok
    assert record.samples is not None
    assert record.samples[-1, 1] == 3.0
    assert record.message == "the triggered input clock a.hit is connected to none, and never ticks"


@pytest.mark.parametrize(
    ("source", "target", "reason"),
    [
        ("out", "beat", "connection[1].to: expected a triggered input clock, got the tunable clock b.beat"),
        ("hit", "hit", "connection[1].from: expected an output"),
        ("beats", "hit", "connection[1]: expected two variables of one type"),
        ("out", "u", "connection[1]: expected two variables of one type"),
    ],
)
def test_other_connections_of_clocks_are_refused(folder: Path, source: str, target: str, reason: str) -> None:
    with pytest.raises(SceneError) as refused:
        parse_scene(SCENE.format(source=source, target=target), str(folder / "scene.toml"))
    assert reason in str(refused.value)
