"""Initialization: start values are carried over the connections until they no longer change."""

from __future__ import annotations

from collections.abc import Sequence

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.importer.loops.solver import LoopSolver
from vibroimpact.orchestrator.importer.wiring import Transfer, equal_values

#: Largest relative change of a connected value in a pass; below it initialization has converged.
INITIAL_TOLERANCE = 1e-11
INITIAL_ITERATIONS = 100
#: Passes after which values no longer change if the descriptions declare all dependencies. Connected parameters change
#: in the first pass and have their effect in the second.
PASSES_OF_A_CHAIN = 2


def settle_connections(transfers: Sequence[Transfer], loops: LoopSolver, time: float) -> None:
    """Carry start values over the connections until they no longer change: one pass per link of the longest chain.

    Values that change in a third pass depend on others than their descriptions declare, perhaps in a loop.
    ComponentError: the values never settle.
    """
    loops.begin()
    for count in range(INITIAL_ITERATIONS):
        before = [transfer.write.values.copy() for transfer in transfers]
        solved = [transfer for transfer in transfers if loops.solves_first(transfer)]
        behind = [transfer for transfer in transfers if transfer not in solved and loops.leads(transfer)]
        for transfer in transfers:
            if transfer not in solved and transfer not in behind:
                transfer.move()
        loops.solve_first(time)
        for transfer in solved:
            transfer.take()
        for transfer in behind:
            transfer.move()
        after = [transfer.write.values for transfer in transfers]
        if all(equal_values(b, a, INITIAL_TOLERANCE) for b, a in zip(before, after, strict=True)):
            loops.end_beginning()
            return
        if count == PASSES_OF_A_CHAIN:
            loops.search()
    names = ", ".join(sorted({t.target.name for t in transfers}))
    raise ComponentError(
        f"initialization: expected connected start values that settle, got values that still change after "
        f"{INITIAL_ITERATIONS} passes over the inputs of {names}.",
        function="initialization",
        time=time,
    )
