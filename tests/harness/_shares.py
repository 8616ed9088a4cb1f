"""Shares of the tests: groups stay together where that costs no time, and the most expensive ones start first."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping, Sequence


class Shares:
    """Hands out numbers of tests to workers.

    A worker follows one group to its end, so that shared fixtures are made once. Then it takes the most expensive
    group that no worker has started. Without such a group it takes the second half of the busiest worker's tests.

    Parameters
    ----------
    groups : sequence of str
        The group of each test, such as its module, in the order of collection.
    seconds : mapping of str to float
        Wall time of a group, s; a group without a known time counts as 0.
    workers : int
    whole : collection of str
        Groups that are not shared among workers.
    """

    def __init__(
        self,
        groups: Sequence[str],
        seconds: Mapping[str, float],
        workers: int,
        whole: Collection[str] = frozenset(),
    ) -> None:
        numbers: dict[str, deque[int]] = {}
        for number, name in enumerate(groups):
            numbers.setdefault(name, deque()).append(number)
        self._each = {
            number: seconds.get(name, 0.0) / len(group) for name, group in numbers.items() for number in group
        }
        self._groups, self._whole = groups, whole
        self._waiting = deque(sorted(numbers.values(), key=self._left, reverse=True))
        self._started: list[deque[int]] = [deque() for _ in range(workers)]

    def _left(self, group: deque[int]) -> float:
        return sum(self._each[number] for number in group)

    def next(self, worker: int) -> int | None:
        """Return the next test of a worker; None if no test is left for it."""
        own = self._started[worker]
        if not own and self._waiting:
            own.extend(self._waiting.popleft())
        if not own:
            self._take_over(own)
        return own.popleft() if own else None

    def _take_over(self, own: deque[int]) -> None:
        shared = [group for group in self._started if group and self._groups[group[0]] not in self._whole]
        busiest = max(shared, key=lambda group: (self._left(group), len(group)), default=own)
        for _ in range((len(busiest) + 1) // 2):
            own.appendleft(busiest.pop())

    def give_back(self, worker: int, number: int) -> None:
        """Take back a test that a worker has not started."""
        self._started[worker].appendleft(number)
