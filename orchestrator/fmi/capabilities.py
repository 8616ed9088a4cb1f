"""The declared capabilities of an FMU: each capability flag of FMI 2.0 and 3.0, and its treatment by an importer here.

A flag is heeded, or an FMU for which it matters is refused by the name of the flag. The test of the table walks the
schemas of both versions.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from vibroimpact.fmus.safe_xml import root_of
from vibroimpact.orchestrator.fmi.clocks import Clock, clocks_of

if TYPE_CHECKING:
    from pathlib import Path

    from vibroimpact.fmus.packaging.fmpy_door import ModelDescription

CO_SIMULATION, MODEL_EXCHANGE, SCHEDULED = "CoSimulation", "ModelExchange", "ScheduledExecution"
VARIABLE, CLOCK = "variable", "clock"


class Treatment(StrEnum):
    """Treatment of a flag."""

    heeded = "heeded"
    refused = "refused"


@dataclass(frozen=True, slots=True)
class Flag:
    """A capability flag, the attribute of a model description."""

    name: str
    owner: str
    """Its element: an interface, a variable, or a clock."""
    versions: str
    """Versions of FMI with this flag."""
    treatment: Treatment
    """Whether it is heeded or refused."""
    how: str
    """Details of the treatment."""


def _heeded(name: str, versions: str, how: str, owner: str = CO_SIMULATION) -> Flag:
    return Flag(name, owner, versions, Treatment.heeded, how)


def _refused(owner: str, how: str, versions: str, *names: str) -> tuple[Flag, ...]:
    return tuple(Flag(name, owner, versions, Treatment.refused, how) for name in names)


#: Relative tolerance of an integration where neither the scene nor the FMU gives one.
DEFAULT_TOLERANCE = 1e-8
VARIABLE_STEPS = "canHandleVariableCommunicationStepSize"
INTERNAL_STEP = "fixedInternalStepSize"
ONLY_ONCE = "canBeInstantiatedOnlyOncePerProcess"
NEEDS_TOOL = "needsExecutionTool"
ASYNCHRONOUS = "canRunAsynchronuously"
EVENT_MODE = "hasEventMode"
SET_ONCE = "canHandleMultipleSetPerTimeInstant"
#: Clocks of an FMU that runs, in words.
NEEDED_OF_CLOCKS = "clocks as FMI defines them, in an FMU that has an event mode"
_COMMON = (NEEDS_TOOL, ONLY_ONCE)
DERIVATIVE = "providesDirectionalDerivative"
_NEVER = "no such call is made"
_IN_LOOPS = "asked for in algebraic loops alone, and compared once with a difference"
_AT_IMPACTS = "asked for at rigid impacts alone, and compared with a difference"
_BY_INTERFACE = "an FMU for it alone is refused by its name"

FLAGS: tuple[Flag, ...] = (
    _heeded(NEEDS_TOOL, "2.0, 3.0", "named where the FMU makes no instance: its tool must be there"),
    _heeded(ONLY_ONCE, "2.0, 3.0", "a second instance in one process is refused by this name"),
    _heeded("canNotUseMemoryManagementFunctions", "2.0", "the functions are given to every FMU"),
    _heeded(
        VARIABLE_STEPS,
        "2.0, 3.0",
        "false: one step size, macro_step; on its own grid where steps are cut; in a contact it is refused by name",
    ),
    _heeded(
        INTERNAL_STEP,
        "3.0",
        "a step may end so much short, which a remark says; a part in a contact is refused by name",
    ),
    _heeded("canGetAndSetFMUstate", "2.0", "false: no state is asked for, and no step is repeated"),
    _heeded("canGetAndSetFMUState", "3.0", "false: no state is asked for, and no step is repeated"),
    _heeded(
        EVENT_MODE,
        "3.0",
        "true: events are resolved in event mode, at their instants; false: it is never entered",
    ),
    _heeded(
        "mightReturnEarlyFromDoStep",
        "3.0",
        "where a step has ended is taken from the FMU, whatever it says here",
    ),
    _heeded(ASYNCHRONOUS, "2.0", "true: a step that returns pending is waited for; false: it is an error"),
    _heeded("canInterpolateInputs", "2.0", _NEVER),
    _heeded("maxOutputDerivativeOrder", "2.0, 3.0", _NEVER),
    _heeded("canSerializeFMUstate", "2.0", _NEVER),
    _heeded("canSerializeFMUState", "3.0", _NEVER),
    _heeded(DERIVATIVE, "2.0", _IN_LOOPS),
    _heeded(f"{DERIVATIVE}s", "3.0", _IN_LOOPS),
    _heeded("providesAdjointDerivatives", "3.0", _NEVER),
    _heeded("providesPerElementDependencies", "3.0", _NEVER),
    _heeded("providesEvaluateDiscreteStates", "3.0", _NEVER),
    _heeded(
        "providesIntermediateUpdate",
        "3.0",
        "true: a callback is given, and no variable asked for; false: none is given",
    ),
    _heeded("canReturnEarlyAfterIntermediateUpdate", "3.0", "the callback asks for no early return"),
    _heeded("recommendedIntermediateInputSmoothness", "3.0", "no input is given within a step"),
    *(
        _heeded(name, versions, how, MODEL_EXCHANGE)
        for name, versions, how in (
            (NEEDS_TOOL, "2.0, 3.0", "as in co-simulation"),
            (ONLY_ONCE, "2.0, 3.0", "as in co-simulation"),
            ("canNotUseMemoryManagementFunctions", "2.0", "the functions are given to every FMU"),
            ("completedIntegratorStepNotNeeded", "2.0", "true: the FMU is not told of completed steps"),
            ("needsCompletedIntegratorStep", "3.0", "false: the FMU is not told of completed steps"),
            (
                "canGetAndSetFMUstate",
                "2.0",
                "false: a step that another component cuts is refused by this name",
            ),
            (
                "canGetAndSetFMUState",
                "3.0",
                "false: a step that another component cuts is refused by this name",
            ),
            ("canSerializeFMUstate", "2.0", _NEVER),
            ("canSerializeFMUState", "3.0", _NEVER),
            ("providesDirectionalDerivative", "2.0", _AT_IMPACTS),
            ("providesDirectionalDerivatives", "3.0", _AT_IMPACTS),
            ("providesAdjointDerivatives", "3.0", _NEVER),
            ("providesPerElementDependencies", "3.0", _NEVER),
            ("providesEvaluateDiscreteStates", "3.0", _NEVER),
        )
    ),
    *_refused(
        SCHEDULED,
        _BY_INTERFACE,
        "3.0",
        *_COMMON,
        "canGetAndSetFMUState",
        "canSerializeFMUState",
        "providesDirectionalDerivatives",
        "providesAdjointDerivatives",
        "providesPerElementDependencies",
    ),
    _heeded(SET_ONCE, "2.0, 3.0", "false: the input is refused in an algebraic loop, by this name", VARIABLE),
    _heeded(
        "intervalVariability",
        "3.0",
        "timed clocks tick as time events, triggered ones at the events that trigger them",
        CLOCK,
    ),
    _heeded("canBeDeactivated", "3.0", "every clock ticks", CLOCK),
    _heeded("supportsFraction", "3.0", "intervals are asked for as decimal numbers", CLOCK),
)
"""All capability flags of the two versions."""


@dataclass(frozen=True, slots=True)
class Capabilities:
    """The declared capabilities of an FMU for co-simulation.

    Attributes
    ----------
    restorable : bool
        Its state can be kept and restored.
    event_mode : bool
        It handles events in event mode.
    variable_steps : bool
        Its communication steps may have any size.
    internal_step : float
        Step of its own solver, s; 0 if it declares none.
    only_once : bool
        A process may have one instance of it.
    tool : str
        The required tool; empty without one.
    asynchronous : bool
        Its step calls may return before the step is done.
    updates : bool
        It calls back within its steps if it gets a callback.
    set_once : frozenset of int
        FMI 2.0, model exchange: value references of the inputs that are set once at an instant.
    clocks : tuple of Clock
        Its clocks that can tick.
    refusals : tuple of str
        Needs that no importer here meets, each as "an FMU with ...".
    tolerance : float
        Model exchange: relative tolerance of the integration where none is given, from the default experiment.
    """

    restorable: bool = False
    event_mode: bool = False
    variable_steps: bool = True
    internal_step: float = 0.0
    only_once: bool = False
    tool: str = ""
    asynchronous: bool = False
    updates: bool = False
    set_once: frozenset[int] = frozenset()
    clocks: tuple[Clock, ...] = ()
    refusals: tuple[str, ...] = ()
    tolerance: float = DEFAULT_TOLERANCE

    @property
    def grid(self) -> str:
        """The attribute by which cuts of its steps are refused; empty if they may be cut anywhere."""
        if not self.variable_steps:
            return f"{VARIABLE_STEPS} = false"
        return f"{INTERNAL_STEP} = {self.internal_step:g}" if self.internal_step > 0.0 else ""


def capabilities_of(
    description: ModelDescription, folder: Path, *, model_exchange: bool = False
) -> Capabilities:
    """Return the declared capabilities of an FMU for co-simulation; the defaults without this kind.

    Parameters
    ----------
    description : ModelDescription
        Its description, as FMPy reads it.
    folder : Path
        Folder of the unpacked FMU: FMPy reads no intervals of clocks.
    model_exchange : bool
        Those of model exchange instead. Its events are always resolved in event mode, and its steps have any size.
    """
    if model_exchange:
        return _of_model_exchange(description, folder)
    interface = description.coSimulation
    if interface is None:
        return Capabilities()
    clocks, refusals = clocks_of(description, folder)
    events, step = bool(interface.hasEventMode), float(interface.fixedInternalStepSize or 0.0)
    if clocks and not events:
        names = ", ".join(clock.name for clock in clocks)
        refusals = (*refusals, f"the clock {names} and {EVENT_MODE} = false")
    return Capabilities(
        restorable=bool(interface.canGetAndSetFMUstate),
        event_mode=events,
        variable_steps=bool(interface.canHandleVariableCommunicationStepSize),
        internal_step=step if math.isfinite(step) and step > 0.0 else 0.0,
        only_once=bool(interface.canBeInstantiatedOnlyOncePerProcess),
        tool=_tool(description) if interface.needsExecutionTool else "",
        asynchronous=bool(interface.canRunAsynchronuously),
        updates=bool(interface.providesIntermediateUpdate),
        clocks=clocks,
        refusals=refusals,
    )


def gives_derivatives(folder: Path, kind: str = CO_SIMULATION) -> bool:
    """Does the FMU in a folder declare directional derivatives for a kind, by the name of its element?

    FMPy does not read this flag of FMI 3.0.
    """
    root = root_of((folder / "modelDescription.xml").read_bytes(), "modelDescription.xml")
    interface = root.find(kind)
    flags = {} if interface is None else interface.attrib
    return any(flags.get(name, "").strip() in ("true", "1") for name in (DERIVATIVE, f"{DERIVATIVE}s"))


def _tool(description: ModelDescription) -> str:
    return str(description.generationTool or description.modelName or "one that it does not name")


def _of_model_exchange(description: ModelDescription, folder: Path) -> Capabilities:
    interface = description.modelExchange
    if interface is None:
        return Capabilities()
    clocks, refusals = clocks_of(description, folder)
    return Capabilities(
        restorable=bool(interface.canGetAndSetFMUstate),
        event_mode=True,
        only_once=bool(interface.canBeInstantiatedOnlyOncePerProcess),
        tool=_tool(description) if interface.needsExecutionTool else "",
        set_once=_set_once(folder),
        clocks=clocks,
        refusals=refusals,
        tolerance=_usual_tolerance(description),
    )


def _set_once(folder: Path) -> frozenset[int]:
    """Return the inputs that take one value at an instant; FMPy does not read their flag."""
    root = root_of((folder / "modelDescription.xml").read_bytes(), "modelDescription.xml")
    variables = root.iterfind("ModelVariables/*")
    return frozenset(int(v.get("valueReference", "")) for v in variables if v.get(SET_ONCE) in ("false", "0"))


def _usual_tolerance(description: ModelDescription) -> float:
    experiment = description.defaultExperiment
    text = None if experiment is None else experiment.tolerance
    own = math.nan if text is None else float(text)
    return own if 0.0 < own <= 1.0 else DEFAULT_TOLERANCE
