"""Hard cases: missed bounds and failures are reported, names are unique; tests/hard_cases measures them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import vibroimpact as vi
from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.orchestrator.hard_cases import CASES, Measured, cases_named, dataset_of, measured_cases
from vibroimpact.orchestrator.hard_cases.case import Curve, Found, HardCase, relative
from vibroimpact.orchestrator.hard_cases.finding import first_root


def test_names_are_those_of_the_page_and_differ() -> None:
    names = [case.name for case in CASES]
    assert len(set(names)) == len(names)
    assert all(name == name.lower().replace(" ", "-") for name in names)
    assert [case.name for case in cases_named(["chatter", "ripple"])] == ["ripple", "chatter"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["chater"], "got 'chater'. Did you mean chatter?"),
        (["x" * 400], "There are grazing-from-above, "),
        (["chatter", "chatter"], "expected each name once, got 'chatter' 2 times"),
        (["chatter", 3], "got 3."),
        (None, "got None."),
    ],
)
def test_names_that_are_none_are_refused(
    monkeypatch: pytest.MonkeyPatch, names: list[str], message: str
) -> None:
    let_nothing_run(monkeypatch)
    with pytest.raises(UsageError, match=r"only: expected") as refused:
        vi.hard_cases(names)
    assert message in str(refused.value)


@pytest.fixture
def missed(monkeypatch: pytest.MonkeyPatch) -> HardCase:
    """Return a case with an unreachable bound, the only one of the list."""
    case = replace(CASES[0], name="never", bound=1e-30)
    monkeypatch.setattr("vibroimpact.orchestrator.hard_cases.measuring.CASES", (case,))
    return case


def test_a_bound_that_is_missed_is_in_the_dataset_and_in_the_figure(missed: HardCase) -> None:
    found = vi.hard_cases()
    assert found.attrs["missed"] == "never"
    assert not found.is_met.any()
    assert vi.draw(found).axes[0].get_title() == "never: missed"


def let_nothing_run(patch: pytest.MonkeyPatch) -> None:
    """Make each hard case an error."""

    def measure(case: HardCase, clock: Callable[[], float]) -> Measured:
        raise AssertionError("a case has run")

    patch.setattr("vibroimpact.orchestrator.hard_cases.measuring._measured", measure)


def test_a_dataset_that_has_no_place_is_refused_before_any_case_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    let_nothing_run(monkeypatch)
    with pytest.raises(UsageError, match="expected a place where a file can be written, got no folder"):
        vi.hard_cases("chatter", "nowhere/cases.nc")


def test_a_case_takes_as_long_as_the_clock_says(missed: HardCase) -> None:
    ticks = itertools.count(1.0, 2.5)
    (one,) = measured_cases(clock=lambda: next(ticks))
    assert one.seconds == 2.5
    assert dataset_of([one]).seconds.values.tolist() == [2.5]


def test_a_case_that_does_not_run_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def crash() -> Found:
        raise ComponentError("body: fmi3DoStep returned error at time 1\nmore")

    case = replace(CASES[0], measure=crash)
    monkeypatch.setattr("vibroimpact.orchestrator.hard_cases.measuring.CASES", (case,))
    (one,) = measured_cases()
    assert one.failure == "body: fmi3DoStep returned error at time 1"
    assert not one.is_met
    found = dataset_of([one])
    assert math.isnan(found.figure[0])
    assert found.attrs["missed"] == case.name


def test_a_figure_that_is_no_number_misses_its_bound() -> None:
    nothing = Found(math.nan, Curve(np.empty(0), np.empty(0), "", ""))
    assert not Measured(CASES[0], nothing, 0.0).is_met


def test_the_first_root_is_the_first() -> None:
    assert first_root(lambda t: np.sin(t) - 0.5, 10.0) == pytest.approx(math.pi / 6.0, rel=1e-15)
    assert relative(1.5, 1.0) == 0.5


def test_a_time_beyond_its_bound_is_slow_and_an_error_is_wrong() -> None:
    nothing = Curve(np.empty(0), np.empty(0), "", "")
    late, error = (replace(CASES[0], bound=1.0, is_time=is_time) for is_time in (True, False))
    assert Measured(late, Found(2.0, nothing), 0.0).verdict == "slow"
    assert Measured(error, Found(2.0, nothing), 0.0).verdict == "wrong"
    assert Measured(late, Found(math.inf, nothing), 0.0).verdict == "wrong"
    assert Measured(late, Found(0.5, nothing), 0.0).verdict == "met"
    found = dataset_of([Measured(late, Found(2.0, nothing), 0.0)])
    assert (found.verdict.item(), bool(found.is_met)) == ("slow", False)
