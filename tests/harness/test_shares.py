"""Each test is handed out once, for any order of the workers' requests."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from harness._shares import Shares


@given(
    st.lists(st.sampled_from("abcdefg"), max_size=60).map(sorted),
    st.dictionaries(st.sampled_from("abcdefg"), st.floats(0.0, 100.0)),
    st.integers(1, 4),
    st.randoms(use_true_random=False),
)
def test_each_test_is_handed_out_once_and_one_worker_keeps_the_order_of_a_module(
    modules: list[str], seconds: dict[str, float], workers: int, chance: object
) -> None:
    shares = Shares(modules, seconds, workers)
    working, taken = list(range(workers)), {worker: [] for worker in range(workers)}
    while working:
        worker = chance.choice(working)
        number = shares.next(worker)
        if number is None:
            working.remove(worker)
        else:
            taken[worker].append(number)
    assert sorted(number for share in taken.values() for number in share) == list(range(len(modules)))
    for module in set(modules) if workers == 1 else ():
        of_it = [number for number in taken[0] if modules[number] == module]
        assert of_it == sorted(of_it)


def test_the_dearest_modules_begin_first_and_a_worker_stays_with_its_own() -> None:
    shares = Shares(list("aabbcc"), {"a": 1.0, "b": 9.0, "c": 5.0}, 2)
    assert [shares.next(0), shares.next(1), shares.next(0), shares.next(1)] == [2, 4, 3, 5]
    assert {shares.next(0), shares.next(1)} == {0, 1}


def test_a_worker_without_work_takes_half_of_what_the_busiest_one_has_left() -> None:
    shares = Shares(["a"] * 9, {"a": 9.0}, 2)
    assert shares.next(0) == 0
    of_both = [(shares.next(1), shares.next(0)) for _ in range(4)]
    assert of_both == [(5, 1), (6, 2), (7, 3), (8, 4)]
    assert (shares.next(0), shares.next(1)) == (None, None)


def test_a_module_that_is_kept_whole_is_run_by_one_worker() -> None:
    shares = Shares(list("aaab"), {"a": 9.0, "b": 1.0}, 2, {"a"})
    assert (shares.next(0), shares.next(1)) == (0, 3)
    assert shares.next(1) is None
    assert [shares.next(0), shares.next(0), shares.next(0)] == [1, 2, None]


def test_a_test_that_was_not_begun_is_handed_out_again() -> None:
    shares = Shares(["a"] * 3, {}, 1)
    first = shares.next(0)
    assert first is not None
    shares.give_back(0, first)
    assert Counter(shares.next(0) for _ in range(3)) == Counter(range(3))
