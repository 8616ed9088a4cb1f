"""Answers that no server of this package gives: each is refused by its numbers, and none is taken."""

from __future__ import annotations

import ctypes
import math
from ctypes import byref, c_bool, c_double, c_size_t, c_uint32, c_void_p
from typing import Any

import pytest

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.orchestrator.remote.functions import RemoteFunctions
from vibroimpact.orchestrator.remote.protocol import Result


def functions(*results: Any) -> RemoteFunctions:
    def refuse(status: int, function: str) -> None:
        raise ComponentError(f"{function}: {status}")

    return RemoteFunctions("3.0", lambda calls: list(results), refuse)


def step(found: RemoteFunctions) -> float:
    """Make a step; return the time that it says it has reached."""
    flags, last = [c_bool() for _ in range(3)], c_double(-1.0)
    found.named("DoStep")(None, c_double(0.0), c_double(1.0), c_bool(True), *map(byref, flags), byref(last))
    return last.value


@pytest.mark.parametrize(
    "numbers", [[], [0.0], [0.0, 0.0, 0.0, 1.0, 1.0], [math.nan, 0.0, 0.0, 1.0], [1e99, 0, 0, 1.0]]
)
def test_numbers_that_are_no_results_of_a_step(numbers: list[float]) -> None:
    with pytest.raises(ComponentFileError, match="an answer of a server: expected 4 numbers, got others"):
        step(functions(Result(numbers=numbers)))
    assert step(functions(Result(numbers=[0.0, 0.0, 1.0, 0.5]))) == 0.5


@pytest.mark.parametrize("values", [b"", b"1234567", b"123456789"])
def test_values_of_another_size_are_not_copied(values: bytes) -> None:
    buffer = (c_double * 1)(7.0)
    place = (byref((c_uint32 * 1)(1)), c_size_t(1), c_void_p(ctypes.addressof(buffer)), c_size_t(1))
    with pytest.raises(ComponentFileError, match="expected 8 bytes of values, got"):
        functions(Result(values=values)).named("GetFloat64")(None, *place)
    assert buffer[0] == 7.0


def test_a_call_that_waited_and_failed_is_named() -> None:
    found = functions(Result(status=3))
    assert found.named("EnterEventMode")(None) == 0
    with pytest.raises(ComponentError, match="EnterEventMode: 3"):
        step(found)


def test_a_function_that_no_importer_calls_is_none() -> None:
    with pytest.raises(ComponentFileError, match="expected a function that is called on a server"):
        functions().named("SerializeFMUState")
