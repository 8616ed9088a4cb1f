"""The work of each step of an importer: decided once, from its components and connections."""

from __future__ import annotations

from vibroimpact.orchestrator.importer.component import Component
from vibroimpact.orchestrator.importer.events import EventMode
from vibroimpact.orchestrator.importer.order import fresh_inputs
from vibroimpact.orchestrator.importer.parts import Parts
from vibroimpact.orchestrator.importer.plain_loop import PlainLoop, can_loop
from vibroimpact.orchestrator.importer.progress import Progress
from vibroimpact.orchestrator.importer.specification import Exchange
from vibroimpact.orchestrator.importer.wiring import moves_of


class StepPlan:
    """The work of a step.

    Parameters
    ----------
    parts : Parts
        The parts of the importer.
    exchange : str
        The exchange of values: `jacobi`, `gauss_seidel` or `iterated`.
    progress : Progress
        Time, communication points and counts of the run.
    tries : bool
        Any step may be tried, and taken back.

    Attributes
    ----------
    iterates : bool
        Steps are repeated until the inputs at their end agree.
    saves : bool
        States are saved before a step, which may have to be repeated.
    saved : list of Component
        The components with states.
    looping : list of Transfer
        The transfers that loops solve for.
    start_moves, moves_after_loops, trial_moves : CallList or None, CallList, CallList
        Moves before a step, after its loops are solved, and around steps that are taken back.
    paths : list of (Component, CallList or None)
        The components that step together, each with the moves before its step.
    stateless_paths : list of (Component, CallList or None)
        The components that cannot go back, and wait until the end of the step is agreed.
    event_mode : EventMode
        Resolves events.
    """

    def __init__(self, parts: Parts, exchange: Exchange, progress: Progress, *, tries: bool = False) -> None:
        self._tries = tries
        self._parts, self._progress = parts, progress
        order = parts.components
        sources = [c for c in order if c.event_mode or self._is_looked_at(c)]
        is_alone = len(sources) == 1 and sources[0] is order[0] and sources[0].event_mode
        self.iterates = exchange == "iterated"
        self.saves = self.iterates or tries or not (is_alone or not sources)
        self.saved = [c for c in order if c.has_states]
        self._is_jacobi = exchange == "jacobi"
        self.plan_moves()

    def _is_looked_at(self, component: Component) -> bool:
        """Are the component's events found from its outputs?"""
        watches = self._parts.watches
        return component.event_times is not None or any(w.component is component for w in watches)

    def plan_moves(self) -> None:
        """Bind the calls of all moves; again after a transfer's buffers changed."""
        parts = self._parts
        self._arrangement = parts.loops.arrangement
        # moves in a loop, between two solutions, would multiply changes by its gain
        self.looping = [t for t in parts.transfers if parts.loops.solves(t)]
        straight = [t for t in parts.transfers if t not in self.looping]
        together = [c for c in parts.components if not c.on_own_grid]
        incoming = {c.name: [t for t in straight if t.target is c] for c in together}
        stops = [bond.stop for bond in parts.contacts.ports]
        fresh = fresh_inputs(parts.components, incoming, stops, jacobi=self._is_jacobi)
        refreshed = [t for ts in fresh.values() for t in ts]
        behind = [t for t in parts.transfers if t not in refreshed]
        self.start_moves = moves_of(t for t in behind if t not in self.looping) or None
        self.moves_after_loops = moves_of(straight)
        self.trial_moves = moves_of(t for t in straight if t.target.has_states)
        paths = [(c, moves_of(fresh[c.name]) or None) for c in together]
        # components that cannot go back wait for the last repetition
        repeats = self.iterates or self._tries or bool(parts.contacts)
        waiting = [path for path in paths if repeats and not self._steps_at_once(path[0])]
        self.paths = [path for path in paths if path not in waiting]
        self.stateless_paths = waiting
        self.event_mode = EventMode(parts.components, parts.transfers, behind)
        self._loop: PlainLoop | None = None
        self._is_plain: bool | None = None

    def _steps_at_once(self, component: Component) -> bool:
        """Does the component step with the others: can it go back, or does it find its own impacts at a stop?"""
        found = [bond.body for bond in self._parts.contacts.held if bond.body.kind == "model_exchange"]
        return component.has_states or (component in found and not (self.iterates or self._tries))

    def keep_up(self) -> None:
        """Plan the moves again if initialization has found algebraic loops that no list declares, or no longer has."""
        if self._arrangement != self._parts.loops.arrangement:
            self.plan_moves()

    @property
    def prepares(self) -> bool:
        """Does a step need more than moves before it? Initialization may find algebraic loops that no list declares."""
        return self.saves or bool(self._parts.loops.names)

    @property
    def plain_loop(self) -> PlainLoop | None:
        """The loop that makes these steps in C; None where more than components and connections takes part in them."""
        if self._parts.loops.names:
            return None
        if self._is_plain is None:
            self._loop = self._made_loop()
            self._is_plain = self._loop is not None
        return self._loop

    def _made_loop(self) -> PlainLoop | None:
        parts = self._parts
        # others go back to its events, and it is not stepped again
        stays = len(self.paths) > 1 and any(c.event_mode and not c.has_states for c, _ in self.paths)
        rare = (parts.watches, parts.tuning, parts.ticks, parts.grids, self.stateless_paths)
        if self.iterates or stays or any(rare):
            return None
        components, inputs = zip(*self.paths, strict=True)
        events = self.event_mode
        if not can_loop(components, [self.start_moves, *inputs, events.begin, events.again]):
            return None
        numbers = {name: number for number, name in enumerate(parts.named)}
        return PlainLoop(
            components, numbers, self.start_moves, inputs, events, saves=self.saves, progress=self._progress
        )
