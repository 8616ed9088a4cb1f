"""Notes of the FMI call under way, as read by the process that outlives the caller."""

from __future__ import annotations

import ctypes
import math
import sys
from pathlib import Path
from typing import Any

import pytest
from support.coupled_parts import P11, body, contact, external, link, part, stop
from support.fmu_factory import feedthrough

from vibroimpact.fmus.core.coupling import CouplingEnd, advance_coupled
from vibroimpact.orchestrator.fmi.log import callback
from vibroimpact.orchestrator.guard.breadcrumbs import Breadcrumbs
from vibroimpact.orchestrator.importer import plain_loop
from vibroimpact.orchestrator.importer.master import Importer


@pytest.fixture
def notes(tmp_path: Path) -> tuple[Breadcrumbs, Breadcrumbs]:
    """Return the notes as their writer and as their reader map them."""
    path = tmp_path / "notes"
    Breadcrumbs.create(path)
    return Breadcrumbs(path), Breadcrumbs(path)


def test_there_is_no_call_before_the_first_one(notes: tuple[Breadcrumbs, Breadcrumbs]) -> None:
    instance, function, time = notes[1].last_call()
    assert (instance, function) == ("", "")
    assert math.isnan(time)
    assert notes[1].last_lines() == ()


def test_a_call_is_noted_before_it_is_made_and_a_step_with_its_time(
    notes: tuple[Breadcrumbs, Breadcrumbs],
) -> None:
    writer, reader = notes
    seen = []
    ball, stop = writer.wrap("ball"), writer.wrap("stop")
    step = ball("fmi3DoStep", lambda *_: seen.append(reader.last_call()))
    save = stop("fmi3GetFMUState", lambda *_: seen.append(reader.last_call()))
    step(None, ctypes.c_double(1.25), ctypes.c_double(0.5))
    save(None)
    assert seen == [("ball", "fmi3DoStep", 1.25), ("stop", "fmi3GetFMUState", 1.25)]


def test_the_lines_are_those_of_the_component_of_the_call_and_begin_forgets_them(
    notes: tuple[Breadcrumbs, Breadcrumbs],
) -> None:
    writer, reader = notes
    log = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)(
        callback("fmi3").value
    )
    for name in ("ball", "stop"):
        log(writer.log(name).environment, 0, b"", f"{name} speaks".encode())
    writer.wrap("ball")("fmi3Reset", lambda: None)()
    assert reader.last_call()[:2] == ("ball", "fmi3Reset")
    assert reader.last_lines() == ("ball speaks",)
    reader.begin()
    assert reader.last_call()[:2] == ("", "")
    writer.wrap("stop")("fmi3Reset", lambda: None)()
    assert reader.last_lines() == ()


def test_the_frames_of_a_thread_show_the_call_that_it_is_in(
    notes: tuple[Breadcrumbs, Breadcrumbs], monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = notes
    importer = Importer([body("b", P11)])
    importer.begin()
    instance = importer.components["b"].instance
    step, seen = instance._do_step, []

    def noted_step() -> int:
        writer.note_frame(sys._getframe())
        seen.append(reader.last_call())
        return int(step())

    monkeypatch.setattr(instance, "_do_step", noted_step)
    for time in (0.0, 0.5):
        instance.step(time, 0.5)
    importer.free()
    assert [(name, function) for name, function, _ in seen] == [("b", "fmi3DoStep")] * 2


def test_the_frames_of_a_thread_show_the_call_of_an_algebraic_loop(
    notes: tuple[Breadcrumbs, Breadcrumbs], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = notes
    importer = Importer([part("g", feedthrough(tmp_path), b=1.0, k=0.5)], [link("g.y", "g.u")])
    importer.begin()
    (transfer,) = importer.loops.transfers
    group = transfer.read
    get, seen = group.get_call, []

    def noted_get() -> int:
        writer.note_frame(sys._getframe())
        seen.append(reader.last_call()[:2])
        return get()

    monkeypatch.setattr(group, "get_call", noted_get)
    importer.loops.solve(0.0)
    importer.free()
    assert set(seen) == {("g", "fmi3GetFloat64")}


def test_calls_made_in_c_are_noted_as_those_of_python(notes: tuple[Breadcrumbs, Breadcrumbs]) -> None:
    writer, reader = notes
    last = []
    for in_c in (True, False):
        parts = [body("b", {**P11, **external(1.0)}), stop("s")]
        importer = Importer(parts, contact("b", "s"), wrap=writer.wrap)
        importer.steps_in_c = in_c
        importer.begin()
        for end in (7.0, 25.0):
            reader.begin()
            importer.advance(end)
            last.append(reader.last_call())
        importer.free()
    assert last[:2] == last[2:]
    assert last[0][:2] == ("s", "fmi3DoStep")
    assert last[0][2] < last[1][2] < 25.0


def test_the_frames_of_a_thread_in_c_show_the_call_that_it_is_in(
    notes: tuple[Breadcrumbs, Breadcrumbs], monkeypatch: pytest.MonkeyPatch
) -> None:
    writer, reader = notes
    importer = Importer([body("b", {**P11, **external(1.0)}), stop("s")], contact("b", "s"))
    importer.begin()

    def advance_and_look(*given: Any) -> CouplingEnd:
        came_to = advance_coupled(*given)
        writer.note_frame(sys._getframe())  # as another thread sees the last call
        return came_to

    monkeypatch.setattr(plain_loop, "advance_coupled", advance_and_look)
    importer.advance(25.0)
    importer.free()
    name, function, time = reader.last_call()
    assert (name, function) == ("s", "fmi3DoStep")
    assert 18.0 < time < 25.0
