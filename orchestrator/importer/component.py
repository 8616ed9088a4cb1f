"""One component of an importer: its instance, its variables, its capabilities."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import c_void_p
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakValueDictionary

from vibroimpact.fmus.errors import ComponentError, ComponentFileError, LostComponentError
from vibroimpact.fmus.packaging.archive import UnpackedFmu, shown_name, unpack
from vibroimpact.orchestrator.fmi.capabilities import (
    MODEL_EXCHANGE,
    NEEDED_OF_CLOCKS,
    NEEDS_TOOL,
    ONLY_ONCE,
    capabilities_of,
    gives_derivatives,
)
from vibroimpact.orchestrator.fmi.exchange import (
    Exchange2,
    Exchange3,
    ExchangeInstance,
)
from vibroimpact.orchestrator.fmi.instance import OK, Wrapper
from vibroimpact.orchestrator.fmi.instance2 import Instance2
from vibroimpact.orchestrator.fmi.instance3 import Instance3
from vibroimpact.orchestrator.fmi.log import LogTail
from vibroimpact.orchestrator.fmi.shapes import STRUCTURAL
from vibroimpact.orchestrator.fmi.variables import VariableGroup
from vibroimpact.orchestrator.importer.described import (
    dependencies_of,
    description_of,
    exchange_facts,
    item_value,
    kind_of,
    kind_that_runs,
    loses_memory,
    shapes_of,
)
from vibroimpact.orchestrator.importer.specification import ComponentSpec, StartValue
from vibroimpact.orchestrator.remote.address import FmuServer

if TYPE_CHECKING:
    from vibroimpact.fmus.packaging.fmpy_door import ModelDescription, ModelVariable

Value = StartValue


#: Instances of the FMUs that allow one instance per process, by the hash of the file.
_only_instances: WeakValueDictionary[str, Component] = WeakValueDictionary()
#: Instants closer than this times (1 + |time|), s, count as one instant.
SAME_INSTANT = 1e-13


class Component:
    """An FMU in an importer.

    Parameters
    ----------
    spec : ComponentSpec
        The FMU, its parameters and its tolerance.
    log : LogTail or None
        Receives the FMU's log lines.
    wrap : callable or None
        Wraps each function of the FMU.
    events : bool
        Handle events in event mode and return early, if the FMU can.

    Attributes
    ----------
    kind : str
        The kind of FMU that runs: `co_simulation` or `model_exchange`.
    shapes : dict of str to tuple of int
        Shape of each array, by the name of the variable.
    capabilities : Capabilities
        The capabilities that its description declares.
    has_states : bool
        It can go back to a saved state.
    ticking : frozenset of int or None
        Value references of the clocks that tick now: their variables may be read and written. None before the
        run begins, when all variables may be.
    event_mode : bool
        It handles events in event mode and may return early.
    on_own_grid : bool
        Its steps are made apart from those of the others, at multiples of its one step size.
    refuses_events : bool
        It declares an event mode, but an instance could be made only without it.
    event_times : VariableGroup or None
        FMI 2.0: the variables that report the first event of the last step.
    """

    def __init__(
        self,
        spec: ComponentSpec,
        *,
        log: LogTail | None = None,
        wrap: Wrapper | None = None,
        events: bool = True,
    ) -> None:
        self.spec = spec
        self.name = spec.name
        file = spec.fmu if spec.server is None else self._described_there(spec.server)
        description = description_of(file)
        self.kind = kind_that_runs(spec, description)
        self.variables: dict[str, ModelVariable] = {v.name: v for v in description.modelVariables}
        self.shapes = shapes_of(self.variables, spec.parameters)
        self.depends = dependencies_of(description)
        fmu = unpack(file)
        exchanges = self.kind == "model_exchange"
        self.capabilities = capabilities_of(description, fmu.folder, model_exchange=exchanges)
        self._refuse_what_it_needs()
        self.has_states = self.capabilities.restorable
        version = 3 if description.fmiVersion.startswith("3") else 2
        self.event_mode = exchanges or (events and version == 3 and self.capabilities.event_mode)
        self.refuses_events = self.on_own_grid = False
        self.ticking: frozenset[int] | None = None
        self._clocked: list[tuple[VariableGroup, Callable[[], int], frozenset[int]]] = []
        self.sha256 = fmu.sha256 if spec.server is None else spec.server.sha256
        self._take_only_instance()
        self.instance: Instance2 | Instance3 | ExchangeInstance
        if exchanges:
            self.instance = self._exchange(fmu, description, log, wrap)
        elif version == 3:
            self.instance = self._instance3(fmu, log, wrap)
        else:
            self.instance = self._instance2(fmu, log, wrap, loses_memory(description))
        if self.has_states and self.instance.lacks_states is not None:
            raise self.instance.lacks_states
        self.instance.internal_step = self.capabilities.internal_step
        if self.capabilities.clocks and not self.event_mode:
            raise self._clocks_error()
        self.at_start, self.at_end = c_void_p(), c_void_p()
        self._start_groups: dict[str, VariableGroup] = {}
        self._inputs: list[VariableGroup] = []
        self.event_times = self._event_time_group() if self._tells_events(version) else None

    _make2: Callable[..., Instance2] = Instance2
    _make3: Callable[..., Instance3] = Instance3

    def _described_there(self, server: FmuServer) -> Path:
        """Return a file with the description of an FMU elsewhere, whose instances are made there."""
        # gRPC is imported only for FMUs elsewhere
        from vibroimpact.orchestrator.remote.description import described_fmu
        from vibroimpact.orchestrator.remote.instances import RemoteInstance2, RemoteInstance3

        self._make2, self._make3 = partial(RemoteInstance2, server), partial(RemoteInstance3, server)
        return described_fmu(server, self.spec.fmu)

    def _tells_events(self, version: int) -> bool:
        return version == 2 and self.has_states and self.kind == "co_simulation"

    def _refuse_what_it_needs(self) -> None:
        """Raise ComponentFileError where an FMU needs a capability that no importer here has."""
        if self.capabilities.refusals:
            got = " and ".join(self.capabilities.refusals)
            raise ComponentFileError(f"{shown_name(self.spec.fmu)}: expected {NEEDED_OF_CLOCKS}, got {got}.")

    def _take_only_instance(self) -> None:
        """Register this component as the only instance of an FMU that allows one per process."""
        if not self.capabilities.only_once or self.spec.server is not None:  # a process of its own there
            return
        other = _only_instances.get(self.sha256)
        if other is not None:
            raise ComponentError(
                f"{self.name}: expected the only instance of {self.spec.fmu.name} in a process "
                f"({ONLY_ONCE}), got one beside {other.name}.",
                instance=self.name,
            )
        _only_instances[self.sha256] = self

    def _instance2(
        self, fmu: UnpackedFmu, log: LogTail | None, wrap: Wrapper | None, reuse: bool
    ) -> Instance2:
        # a reused instance of this name would be a second one beside an instance of another name
        reuse = reuse and not self.capabilities.only_once
        try:
            waits = self.capabilities.asynchronous
            return self._make2(fmu, self.name, log=log, wrap=wrap, waits=waits, reuse=reuse)
        except ComponentError as refusal:
            raise self._named_tool(refusal) from None

    def _exchange(
        self, fmu: UnpackedFmu, description: ModelDescription, log: LogTail | None, wrap: Wrapper | None
    ) -> ExchangeInstance:
        """Make an instance for model exchange."""
        facts = exchange_facts(
            description,
            self.spec.tolerance or self.capabilities.tolerance,
            gives_derivatives=gives_derivatives(fmu.folder, MODEL_EXCHANGE),
        )
        fmu = replace(fmu, identifiers=(description.modelExchange.modelIdentifier,))
        made = Exchange3 if fmu.fmi_version.startswith("3") else Exchange2
        try:
            return made(fmu, self.name, facts, log=log, wrap=wrap)
        except ComponentError as refusal:
            raise self._named_tool(refusal) from None

    def _named_tool(self, refusal: ComponentError) -> ComponentError:
        """Return the error of a missing instance, with the tool that must be installed."""
        if not self.capabilities.tool or not refusal.function:  # a library that does not load needs no tool
            return refusal
        return type(refusal)(
            f"{refusal} It needs {self.capabilities.tool} on this machine ({NEEDS_TOOL}).",
            instance=refusal.instance,
            function=refusal.function,
            time=refusal.time,
            log=refusal.log,
        )

    def _clocks_error(self) -> ComponentError:
        names = ", ".join(clock.name for clock in self.capabilities.clocks)
        why = "made no instance with it" if self.refuses_events else "is watched, and so runs without it"
        return ComponentError(
            f"{self.name}: expected event mode, in which its clock {names} ticks, got a component that {why}.",
            instance=self.name,
        )

    def _instance3(self, fmu: UnpackedFmu, log: LogTail | None, wrap: Wrapper | None) -> Instance3:
        """Make an instance with event mode where that is declared; some FMUs refuse the mode that they declare."""
        make = partial(self._make3, fmu, self.name, updates=self.capabilities.updates, log=log, wrap=wrap)
        try:
            return make(event_mode=self.event_mode)
        except ComponentError as refusal:
            if not self.event_mode or isinstance(refusal, LostComponentError):
                raise self._named_tool(refusal) from None
            try:
                instance = make()
            except ComponentError:
                raise self._named_tool(refusal) from None
        self.event_mode, self.refuses_events = False, True
        return instance

    def _event_time_group(self) -> VariableGroup | None:
        names = [
            name
            for name, variable in self.variables.items()
            if name.split(".")[-1] == "event_time" and variable.causality == "output"
        ]
        return self.group("Float64", names) if names else None

    def group(self, kind: str, names: Sequence[str]) -> VariableGroup:
        """Return a group of this component's variables, by name."""
        references = [self.variables[name].valueReference for name in names]
        size = sum(map(self.size_of, names))
        if kind == "String":
            return self.clocked(self.instance.text_group(references, size), names)
        return self.clocked(self.instance.group(kind, references, size=size), names)

    def size_of(self, name: str) -> int:
        """Return the number of values of a variable: 1, or the number of elements of an array."""
        return math.prod(self.shapes.get(name, ()))

    def clocks_of(self, name: str) -> frozenset[int]:
        """Return the value references of the clocks of a variable."""
        return frozenset(clock.valueReference for clock in self.variables[name].clocks or ())

    def clocked(self, group: VariableGroup, names: Sequence[str]) -> VariableGroup:
        """Let variables of clocks be moved only while a clock of theirs ticks; between ticks they keep their values.

        Variables with different clocks raise ComponentError.
        """
        clocks = {self.clocks_of(name) for name in names}
        if not self.capabilities.clocks or clocks <= {frozenset()}:
            return group
        if len(clocks) > 1:
            raise ComponentError(
                f"{self.name}: expected variables of one clock, got {', '.join(names)} of several.",
                instance=self.name,
            )
        (own,) = clocks
        get, put = group.get_call, group.set_call

        def is_open() -> bool:
            return self.ticking is None or not own.isdisjoint(self.ticking)

        group.get_call = lambda: get() if is_open() else OK
        group.set_call = lambda: put() if is_open() else OK
        self._clocked.append((group, get, own))
        if not is_open():  # made within a run: nothing is kept yet
            self.instance.check(get(), f"Get{group.name}")
        return group

    def read_clocked(self) -> None:
        """Read all groups of variables whose clocks tick."""
        for group, get, own in self._clocked:
            if self.ticking is not None and not own.isdisjoint(self.ticking):
                self.instance.check(get(), f"Get{group.name}")

    def begin(self, values: Mapping[str, Value], start_time: float, *, first: bool) -> None:
        """Set parameters and start values and enter initialization mode."""
        self.ticking = None
        if not first:
            self.instance.reset()
        starts = {**self.spec.parameters, **values}
        sizes = [name for name in starts if self.variables[name].causality == STRUCTURAL]
        if sizes:
            self.instance.enter_configuration()
            for name in sizes:
                self._set_start(name, starts.pop(name))
            self.instance.exit_configuration()
        for name, value in starts.items():
            self._set_start(name, value)
        self.instance.enter_initialization(start_time, self.spec.tolerance)

    def _set_start(self, name: str, value: Value) -> None:
        variable = self.variables[name]
        if kind_of(variable) == "String":
            texts = map(str, value) if isinstance(value, tuple) else [str(value)]
            self.instance.set_texts(variable.valueReference, tuple(texts))
            return
        group = self._start_groups.get(name)
        if group is None:
            group = self._start_groups[name] = self.group(kind_of(variable), [name])
        each = value if isinstance(value, tuple) else (value,)
        group.values[:] = [item_value(self.name, variable, v) if isinstance(v, str) else v for v in each]
        group.set()

    def first_event(self) -> float:
        """Return the time of the first event that our FMI 2.0 FMU reports in the last step, s, or inf."""
        times = () if self.event_times is None else self.event_times.get()
        return min((float(t) for t in times if not math.isnan(t)), default=math.inf)

    def first_event_in(self, time: float, target: float) -> float | None:
        """Return the first event reported in the step just made from `time` to `target`, s.

        The result is `target` for an event at the end, and None for a later event. With an event at the end or the
        start, the component has not gone further.
        """
        first = self.first_event()
        room = SAME_INSTANT * (1.0 + abs(target))
        if first > target + room:
            return None
        if first >= target - room or first <= time:
            self.instance.time = first
        return target if first >= target - room else first

    def watch_inputs(self, names: Iterable[str]) -> None:
        """Name the connected inputs; their slope inputs belong to them."""
        inputs = [n for name in names for n in (name, f"{name}_rate") if n in self.variables]
        by_kind: dict[str, list[str]] = {}
        for name in inputs:
            by_kind.setdefault(kind_of(self.variables[name]), []).append(name)
        self._inputs = [self.group(kind, found) for kind, found in by_kind.items()]

    def note_inputs(self) -> None:
        """Remember the connected inputs of the step just made."""
        for group in self._inputs:
            group.get()

    def write_inputs(self) -> None:
        """Write the inputs that `note_inputs` found."""
        for group in self._inputs:
            group.set()

    def revisit_start(self) -> None:
        """Go back to the start of the step, with the inputs that `note_inputs` found."""
        self.instance.restore(self.at_start)
        self.write_inputs()

    def stays_ahead(self, time: float, target: float) -> bool:
        """Has it made a step from `time`, s, that it cannot take back?

        ComponentError: that step has passed the event of another at `target`, s.
        """
        reached = self.instance.time
        if self.has_states or reached <= time + SAME_INSTANT * (1.0 + abs(time)):
            return False
        if reached > target + SAME_INSTANT * (1.0 + abs(target)):
            raise ComponentError(
                f"{self.name}: expected a component that goes back to time {target:.17g}, where another has an event, "
                f"got one that stays at {reached:.17g} (canGetAndSet{self.instance.state_word} = false).",
                instance=self.name,
                time=reached,
            )
        return True

    def is_within_own_step(self, time: float) -> bool:
        """Are the others at `time`, s, within a step of this component, which it makes later?"""
        return self.on_own_grid and self.instance.time < time - SAME_INSTANT * (1.0 + abs(time))

    def keep_own_grid(self) -> None:
        """Leave the steps of the others: this component is never taken back, nor read within its steps."""
        self.on_own_grid, self.has_states, self.event_times = True, False, None

    @contextmanager
    def taken_back(self) -> Iterator[None]:
        """Restore the component's state on exit; inside, it may be taken back into the step it has just made."""
        instance = self.instance
        instance.save(self.at_end)
        kept = (instance.time, instance.needs_event_mode, instance.returned_early, instance.wants_to_end)
        self.note_inputs()
        try:
            yield
        finally:
            if not instance.is_fatal:
                instance.restore(self.at_end)
            instance.time, instance.needs_event_mode, instance.returned_early, instance.wants_to_end = kept
            instance.is_flagged = any(kept[1:])

    def step_from_start(self, time: float, size: float) -> None:
        """Restore the start of the step just made, at `time`, and make `size` s of it again.

        ComponentError: the step ends early, so that its result depends on more than the saved state.
        """
        self.revisit_start()
        instance = self.instance
        instance.step_undiscarded(time, size)
        end = time + size
        if instance.time < end - SAME_INSTANT * (1.0 + abs(end)) - instance.internal_step:
            raise ComponentError(
                f"{instance.name}: {instance.prefix}DoStep: expected a step from a saved state at time {time:.12g} to "
                f"reach {end:.12g}, as before, got an end at {instance.time:.12g}. "
                "Its states do not hold all it depends on.",
                instance=instance.name,
                function=f"{instance.prefix}DoStep",
                time=instance.time,
                log=instance.log.take(),
            )

    def free(self) -> None:
        """Free its saved states and its instance."""
        for slot in (self.at_start, self.at_end):
            if slot and not self.instance.is_fatal:
                self.instance.free_state(slot)
        self.instance.free()
        if _only_instances.get(self.sha256) is self:
            del _only_instances[self.sha256]
