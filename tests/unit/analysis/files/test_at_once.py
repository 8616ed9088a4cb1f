"""Requests to an object store at once: bounded in number and bytes, in order, and the first failure ends them."""

from __future__ import annotations

import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.analysis.files import at_once
from vibroimpact.analysis.files.at_once import done_at_once

HOME = "memory://map"


class Crowd:
    """Counts the items under way."""

    def __init__(self) -> None:
        self.now = self.most = self.bytes = self.most_bytes = 0
        self._lock = threading.Lock()

    def work(self, size: int) -> int:
        """Take a millisecond."""
        with self._lock:
            self.now, self.bytes = self.now + 1, self.bytes + size
            self.most, self.most_bytes = max(self.most, self.now), max(self.most_bytes, self.bytes)
        threading.Event().wait(0.001)
        with self._lock:
            self.now, self.bytes = self.now - 1, self.bytes - size
        return size


@given(st.lists(st.integers(0, at_once.MOST_BYTES), max_size=40))
def test_results_are_in_order_and_the_items_under_way_are_bounded(sizes: list[int]) -> None:
    crowd = Crowd()
    assert done_at_once(crowd.work, iter(sizes), HOME, lambda size: size) == sizes
    assert crowd.most <= at_once.MOST_REQUESTS
    assert crowd.most_bytes <= at_once.MOST_BYTES


def test_many_small_items_are_under_way_together_and_an_item_above_the_bound_is_alone() -> None:
    crowd = Crowd()
    done_at_once(crowd.work, [1] * 64, HOME, lambda size: size)
    assert 1 < crowd.most <= at_once.MOST_REQUESTS
    alone = Crowd()
    done_at_once(alone.work, [2 * at_once.MOST_BYTES] * 3, HOME, lambda size: size)
    assert alone.most == 1


def test_in_a_folder_one_item_follows_another(tmp_path: Path) -> None:
    threads = done_at_once(lambda _: threading.get_ident(), range(5), tmp_path)
    assert threads == [threading.get_ident()] * 5


def test_the_first_failure_is_raised_and_no_further_item_begins() -> None:
    begun: list[int] = []

    def work(item: int) -> None:
        begun.append(item)
        threading.Event().wait(0.001)
        if item == 3:
            raise OSError("no answer")

    with pytest.raises(OSError, match="no answer"):
        done_at_once(work, range(1000), HOME)
    assert 4 <= len(begun) < 1000
