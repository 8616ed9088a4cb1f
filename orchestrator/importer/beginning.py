"""Initialization: start values are carried over the connections until they no longer change."""

from __future__ import annotations

from collections.abc import Sequence

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.wiring import LoopSolver, Transfer, equal_values

#: Largest relative change of a connected value in a pass; below it initialization has converged.
INITIAL_TOLERANCE = 1e-11
INITIAL_ITERATIONS = 100


def settle_connections(transfers: Sequence[Transfer], loops: LoopSolver, time: float) -> None:
    """Carry start values over the connections until they no longer change: one pass per link of the longest chain.

    ComponentError: the values never settle.
    """
    for _ in range(INITIAL_ITERATIONS):
        before = [transfer.write.values.copy() for transfer in transfers]
        for transfer in transfers:
            transfer.move()
        loops.solve(time)
        after = [transfer.write.values for transfer in transfers]
        if all(equal_values(b, a, INITIAL_TOLERANCE) for b, a in zip(before, after, strict=True)):
            return
    names = ", ".join(sorted({t.target.name for t in transfers}))
    raise ComponentError(
        f"initialization: expected connected start values that settle, got values that still change after "
        f"{INITIAL_ITERATIONS} passes over the inputs of {names}.",
        function="initialization",
        time=time,
    )
