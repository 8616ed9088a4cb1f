"""Libraries of linear algebra have one thread within overlapping blocks, also after a fault, and theirs afterwards."""

from __future__ import annotations

import pytest

from vibroimpact.orchestrator.structures import one_thread
from vibroimpact.orchestrator.structures.one_thread import on_one_thread


def threads() -> list[int]:
    return [read() for read, _ in one_thread._libraries()]


def test_libraries_have_one_thread_until_the_last_of_overlapping_blocks_ends() -> None:
    before = threads()
    if not before:
        pytest.skip("numpy and scipy come without OpenBLAS")
    try:
        for _, write in one_thread._libraries():
            write(2)
        given = threads()
        first, second = on_one_thread(), on_one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert threads() == [1] * len(before)
        second.__exit__(None, None, None)
        assert threads() == given
        with pytest.raises(ValueError, match="fault"), on_one_thread():
            raise ValueError("fault")
        assert threads() == given
    finally:
        for (_, write), count in zip(one_thread._libraries(), before, strict=True):
            write(count)
