"""Connected tunable parameters: set at the end of a step, in event mode, when their source values have changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from vibroimpact.fmus.errors import ComponentError
from vibroimpact.orchestrator.fmi.eventful import EventfulInstance
from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.events import EVENT_ITERATIONS
from vibroimpact.orchestrator.importer.feedthrough import order_of
from vibroimpact.orchestrator.importer.specification import ConnectionSpec
from vibroimpact.orchestrator.importer.ticks import Ticks
from vibroimpact.orchestrator.importer.wiring import Transfer, transfers_of


def is_tunable(connection: ConnectionSpec, components: Mapping[str, Component]) -> bool:
    """Does the connection feed a parameter?"""
    name, variable = connection.target
    return bool(components[name].variables[variable].causality == "parameter")


class Tuning:
    """The connections to tunable parameters.

    Inputs may change at any time, parameters at events only. Parameters are therefore written once a step is agreed
    and its events are resolved, and never in a step that may be taken back. Before that, all other transfers, in their
    order, write the inputs of the components that feed them.
    """

    def __init__(
        self,
        components: dict[str, Component],
        connections: Sequence[ConnectionSpec],
        transfers: Sequence[Transfer],
    ) -> None:
        self.transfers = transfers_of(order_of(connections, components), components)
        sources = {transfer.source.name for transfer in self.transfers}
        self._feeding = [transfer for transfer in transfers if transfer.target.name in sources]
        self._given = [transfer.write.values.copy() for transfer in self.transfers]

    def __bool__(self) -> bool:
        """Whether there are any such connections."""
        return bool(self.transfers)

    def begin(self) -> None:
        """Note the first values of the parameters, which initialization has set."""
        self._given = [transfer.write.values.copy() for transfer in self.transfers]

    def resolve(self, time: float, ticks: Ticks) -> bool:
        """Write the changed parameters at `time`, s; returns whether a component requests the end of the run.

        Clocks whose intervals depend on them are asked for the new intervals.

        ComponentError: a component fails, or never settles.
        """
        for transfer in self._feeding:
            transfer.move()
        ends = False
        for transfer, given in zip(self.transfers, self._given, strict=True):
            values = transfer.take()
            if not np.array_equal(values, given):
                given[:] = values
                ends = _give(transfer, time, ticks) or ends
        return ends


def _give(transfer: Transfer, time: float, ticks: Ticks) -> bool:
    """Write parameters, in event mode where their component has one."""
    instance = transfer.target.instance
    if not (transfer.target.event_mode and isinstance(instance, EventfulInstance)):
        transfer.write.set()
        return False
    instance.check(instance.enter_event_call(), "EnterEventMode")
    transfer.write.set()
    for _ in range(EVENT_ITERATIONS):
        instance.check(instance.update_call(), "UpdateDiscreteStates")
        if not instance.needs_update.value:
            break
    else:
        raise ComponentError(
            f"{instance.name}: fmi3UpdateDiscreteStates: expected event iteration to end after a parameter was tuned, "
            f"got another request after {EVENT_ITERATIONS} iterations at time {time:.17g}.",
            instance=instance.name,
            function="fmi3UpdateDiscreteStates",
            time=time,
            log=instance.log.take(),
        )
    ends = instance.event_wants_to_end
    ticks.look(time, transfer.target)
    instance.check(instance.enter_step_call(), "EnterStepMode")
    return ends
