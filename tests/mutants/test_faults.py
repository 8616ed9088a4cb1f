"""Faults in the core compile to another library, and faults of each kind can be drawn."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import pytest

from mutants._copies import copy_with, libraries
from mutants._faults import NATIVE, Fault, drawn, places
from mutants._trial import noticed
from mutants.chosen import CHOSEN, fault_of


def test_faults_of_every_kind_change_code_and_nothing_else() -> None:
    found = places()
    assert {one.kind for one in found} == {
        "constant off by 1e-9",
        "sign",
        "comparison",
        "branch that is skipped",
    }
    assert len(found) > 2000
    assert {"core/lanes/rounds_yielding.h", "core/motion/complex.h"} < {one.file for one in found}
    for fault in islice(drawn(3), 50):
        text = (NATIVE / fault.file).read_text(encoding="utf-8")
        patched = fault.patched(text)
        assert patched != text
        assert len(patched) == len(text) + len(fault.new) - (fault.end - fault.start)
        assert list(islice(drawn(3), 50)) == list(islice(drawn(3), 50))


@pytest.mark.parametrize("name", CHOSEN)
def test_a_chosen_fault_has_one_place(name: str) -> None:
    file, old, _ = CHOSEN[name]
    assert (NATIVE / file).read_text(encoding="utf-8").count(old) == 1
    assert fault_of(name).kind == name


@pytest.mark.long
def test_a_restitution_that_is_off_by_a_millionth_is_noticed_and_the_core_as_it_is_passes(
    tmp_path: Path,
) -> None:
    assert noticed(None) is None
    file = "core/body/chatter.c"
    text = (NATIVE / file).read_text(encoding="utf-8")
    start = text.index("2.0 * b->rebound / (")
    assert noticed(Fault(file, start, start + 3, "2.000002", "constant")) is not None
    assert all(any(path.name == "chatter.c" for path in one.sources) for one in libraries()[:1])
    assert copy_with(None, tmp_path).is_dir()
