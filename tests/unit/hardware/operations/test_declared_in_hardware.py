"""Operations of this package: each argument has a help text, and the run function takes the operation."""

from __future__ import annotations

import pytest
from support.operations import assert_sound, of_package

OPERATIONS = of_package("hardware")


@pytest.mark.parametrize("words", OPERATIONS)
def test_an_operation_is_whole(words: str) -> None:
    assert_sound(OPERATIONS[words])
