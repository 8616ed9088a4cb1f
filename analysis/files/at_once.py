"""Requests to an object store at once, in a bounded number of threads; work in a folder goes one after another."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import TypeVar

from vibroimpact.analysis.files.stores import is_address

MOST_REQUESTS = 16
"""Largest number of requests under way: a request takes some 20 ms, of which most is waiting."""
MOST_BYTES = 1 << 27
"""Largest size of the values under way, bytes, beyond which the next item waits; one item may be larger."""
Item = TypeVar("Item")
Result = TypeVar("Result")


def done_at_once(
    work: Callable[[Item], Result],
    items: Iterable[Item],
    place: str | os.PathLike[str],
    size: Callable[[Item], int] = lambda _: 0,
) -> list[Result]:
    """Do the same work on each item, and return the results in order.

    Parameters
    ----------
    work : callable
        At an address several threads call it.
    items : iterable
        Taken one by one, as soon as earlier ones have ended.
    place : path or address
        Where the work reads or writes.
    size : callable
        Bytes in memory while an item is under way.

    Raises
    ------
    Exception
        The first failure of the work. Items under way end before, and no further item begins.

    Examples
    --------
    >>> done_at_once(len, ["a", "bc"], "memory://map")
    [1, 2]
    """
    if not is_address(place):
        return [work(item) for item in items]
    begun: list[Future[Result]] = []
    under_way: dict[Future[Result], int] = {}
    with ThreadPoolExecutor(MOST_REQUESTS, "requests") as threads:
        for item in items:
            own = size(item)
            while under_way and (
                len(under_way) == MOST_REQUESTS or sum(under_way.values()) + own > MOST_BYTES
            ):
                for ended in wait(under_way, return_when=FIRST_COMPLETED).done:
                    del under_way[ended]
                    ended.result()
            under_way[future := threads.submit(work, item)] = own
            begun.append(future)
    return [future.result() for future in begun]
