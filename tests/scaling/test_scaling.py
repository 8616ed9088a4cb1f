"""Each parser costs no more than n^1.3 for n tokens of each kind, except for a library's work within .5 s."""

from __future__ import annotations

from pathlib import Path

import pytest

from scaling import _growth, descriptions, documents, recordings, texts
from scaling._growth import Tokens, ladder, problem_of

ALL = {
    str(one): one for module in (texts, recordings, descriptions, documents) for one in module.all_tokens()
}
LIBRARY: dict[str, str] = {}
"""Kinds of tokens on which a library is steeper, and the work of the library: at most .5 s at the allowed size."""
BOUNDED = {"journal: heads of all that follows", "journal: heads of nothing", "journal: heads of notes"}
"""Kinds of tokens whose parser reads a limited number of bytes of any file."""
QUICK = (
    "text: rows of dates below rows",
    "text: a wide row among rows",
    "LabVIEW: columns",
    "TDMS: segments",
    "TDMS: letters of a unit",
    "NetCDF: attributes",
    "WAV: chunks",
    "UFF: functions with instants",
    "imported text: rows that ascend",
    "scene: keys",
    "FMU description: variables",
    "FMU description: variables of unknown causality",
    "SSD: components",
    "SSV: parameters",
    "journal: blocks",
    "JSON body: texts",
)
"""One kind of each parser: its reading costs little more than its content, or was once too expensive."""
RUNGS, ALL_RUNGS = 3, 8


@pytest.mark.parametrize("name", QUICK)
def test_a_parser_costs_no_more_than_in_proportion(name: str, tmp_path: Path) -> None:
    problem = problem_of(ALL[name], tmp_path, RUNGS)
    assert problem is None, problem


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(set(ALL) - BOUNDED))
def test_a_parser_costs_no_more_than_in_proportion_up_to_the_size_that_is_allowed(
    name: str, tmp_path: Path
) -> None:
    problem = problem_of(ALL[name], tmp_path, ALL_RUNGS, LIBRARY.get(name, ""))
    assert problem is None, problem


class Clock:
    """Processor time that a reader advances, ns for each step."""

    def __init__(self) -> None:
        self.now = 0.0

    def process_time(self) -> float:
        return self.now


@pytest.mark.parametrize(("exponent", "is_steep"), [(1.0, False), (1.25, False), (1.5, True), (2.0, True)])
def test_a_parser_is_told_by_the_exponent_of_its_cost(
    exponent: float, is_steep: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(_growth, "time", clock)

    def read(path: Path) -> None:
        clock.now += 1e-5 * path.stat().st_size ** exponent

    tokens = Tokens("any", "bytes", lambda n: b"x" * n, read)
    problem = problem_of(tokens, tmp_path, RUNGS)
    assert (problem is not None) == is_steep
    assert problem is None or "steeper than n^1.3" in problem


def test_one_dear_doubling_and_what_a_library_does_in_half_a_second_are_no_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(_growth, "time", clock)

    def jumps(path: Path) -> None:
        size = path.stat().st_size
        clock.now += 1e-4 * size * (5 if size > 1000 else 1)

    assert problem_of(Tokens("any", "bytes", lambda n: b"x" * n, jumps), tmp_path, 8) is None

    def squares(path: Path) -> None:
        clock.now += 1e-6 * path.stat().st_size ** 2

    small = Tokens("any", "bytes", lambda n: b"x" * n, squares, most=600)
    assert problem_of(small, tmp_path, 8, "squares") is None
    large = Tokens("any", "bytes", lambda n: b"x" * n, squares, most=5000)
    assert "squares: 1024 tokens" in str(problem_of(large, tmp_path, 8, "squares"))


@pytest.mark.parametrize("most_tokens", [100_000, 50], ids=["at the size that is allowed", "with its tokens"])
def test_a_ladder_ends(most_tokens: int, tmp_path: Path) -> None:
    def content(count: int) -> bytes:
        return b"x" * min(count, most_tokens)

    assert ladder(Tokens("any", "bytes", content, Path.read_bytes, most=100), tmp_path, RUNGS) == []


def test_what_the_first_reading_imports_is_no_cost_of_its_tokens(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = Clock()
    monkeypatch.setattr(_growth, "time", clock)

    def read(path: Path) -> None:
        clock.now += 1e-5 * path.stat().st_size + (0.2 if clock.now == 0.0 else 0.0)

    found = ladder(Tokens("any", "bytes", lambda n: b"x" * n, read), tmp_path, RUNGS)
    assert [rung.count for rung in found] == [2048, 4096, 8192]
