"""Any FMU of the package in both versions, driven by FMPy: an independent importer."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from ctypes import byref
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np
from fmpy import simulate_fmu
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.fmi3 import FMU3Slave
from fmpy.logging import addLoggerProxy
from fmpy.model_description import ModelDescription, read_model_description
from numpy.typing import NDArray

from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import unpack

VERSIONS = ("3.0", "2.0")
RESTITUTION, KELVIN_VOIGT, HERTZ, HUNT_CROSSLEY, EXTERNAL = 1, 2, 3, 4, 5
UPPER, LOWER = 1, 2


@cache
def unpacked(path: Path) -> tuple[Path, ModelDescription]:
    """Return the folder of an unpacked FMU and its description."""
    folder = unpack(path).folder
    return folder, read_model_description(str(folder))


def each(name: str, values: Iterable[float]) -> dict[str, float]:
    """Return an array parameter as scalar parameters, numbered from 1."""
    return {f"{name}[{i}]": float(value) for i, value in enumerate(values, start=1)}


def forced(
    amplitude: float = 0.5, angular_frequency: float = 1.0, damping_ratio: float = 0.1, **more: float
) -> dict[str, float]:
    """Return the parameters of an oscillator of mass 1 and stiffness 1 under a harmonic force."""
    return {
        "damping": 2.0 * damping_ratio,
        "forcing.amplitude": amplitude,
        "forcing.angular_frequency": angular_frequency,
        **more,
    }


def stop(
    position: float,
    restitution: float = 0.7,
    *,
    side: int = UPPER,
    law: int = RESTITUTION,
    k: int = 1,
    **more: float,
) -> dict[str, float]:
    """Return the parameters of stop `k`."""
    parameters = {"law": law, "position": position, "side": side, "restitution": restitution, **more}
    return {f"contact[{k}].{name}": value for name, value in parameters.items()}


#: Messages of the FMI 2.0 instances, by their environment.
MESSAGES2: dict[int, list[str]] = {}


def _keep_message(environment: int | None, _: bytes, __: int, ___: bytes, message: bytes) -> None:
    """Keep what an instance says under its environment."""
    if environment in MESSAGES2:
        MESSAGES2[environment].append(message.decode())


#: FMPy's proxy keeps one logger for the whole life of the process: so this logger lives as long.
LOGGER2 = fmi2CallbackLoggerTYPE(_keep_message)


class ComponentFmu:
    """One initialized instance of a component or of an exported file; its time is the end of the last step."""

    def __init__(
        self,
        component: str | Path,
        parameters: Mapping[str, float] = {},
        *,
        version: str = "3.0",
        start_time: float = 0.0,
        event_mode: bool = False,
        early_return: bool = False,
        initialize: bool = True,
        messages: list[str] | None = None,
    ) -> None:
        self.path = component if isinstance(component, Path) else fmu_path(component, version)
        folder, description = unpacked(self.path)
        self.version = version
        self.time = start_time
        self.messages = [] if messages is None else messages
        self.needs_event = self.returned_early = False
        self._variables = {v.name: v for v in description.modelVariables}
        arguments: dict[str, Any] = {
            "guid": description.guid if version == "2.0" else description.instantiationToken,
            "unzipDirectory": str(folder),
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "instanceName": "instance",
        }
        self.fmu: Any
        if version == "3.0":
            self.fmu = FMU3Slave(**arguments)
            self.fmu.instantiate(
                eventModeUsed=event_mode, earlyReturnAllowed=event_mode or early_return, logMessage=self._log3
            )
        else:
            self.fmu = FMU2Slave(**arguments)
            self._callbacks = fmi2CallbackFunctions()
            self._callbacks.logger = LOGGER2
            self._callbacks.componentEnvironment = id(self)
            addLoggerProxy(byref(self._callbacks))  # FMI 2.0 loggers are variadic, Python's are not
            MESSAGES2[id(self)] = self.messages
            self.fmu.instantiate(callbacks=self._callbacks)
        for name, value in parameters.items():
            self.set(name, value)
        if initialize:
            self.initialize(start_time)
            if event_mode:
                self.fmu.updateDiscreteStates()
                self.fmu.enterStepMode()

    def _log3(self, _: Any, __: int, ___: bytes, message: bytes) -> None:
        self.messages.append(message.decode())

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.free()

    def free(self) -> None:
        """Free the instance."""
        self.fmu.freeInstance()
        MESSAGES2.pop(id(self), None)

    def initialize(self, start_time: float = 0.0) -> None:
        if self.version == "3.0":
            self.fmu.enterInitializationMode(startTime=start_time)
        else:
            self.fmu.setupExperiment(startTime=start_time)
            self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()

    def reference(self, name: str) -> int:
        return int(self._variables[name].valueReference)

    def _accessor(self, kind: str, name: str) -> Any:
        types = {"Enumeration": "Int64"} if self.version == "3.0" else {"Enumeration": "Integer"}
        own = self._variables[name].type
        return getattr(self.fmu, kind + types.get(own, own))

    def get(self, name: str) -> Any:
        return self._accessor("get", name)([self.reference(name)])[0]

    def set(self, name: str, value: float) -> None:
        self._accessor("set", name)([self.reference(name)], [value])

    def get_each(self, name: str, count: int) -> NDArray[np.float64]:
        """Return name[1] to name[count]; `name` has {} in the place of the index."""
        return np.array([self.get(name.format(k + 1)) for k in range(count)])

    def start_values(self) -> dict[str, float]:
        """Return the start value of every parameter and input, from the model description, by name."""
        described = [v for v in self._variables.values() if v.start is not None and not v.dimensions]
        kinds = {"Boolean": lambda text: text == "true", "Float64": float, "Real": float}
        return {v.name: kinds.get(v.type, int)(v.start) for v in described}

    def rows(self) -> np.ndarray:
        """Return the rows of the record, shape (n, 8)."""
        table = self.fmu.getFloat64([self.reference("record.rows")], nValues=512 * 8)
        rows = np.array(table).reshape(512, 8)[: self.get("record.count")]
        self.set("record.taken", len(rows))
        return rows

    def step(self, size: float) -> float:
        """Advance by `size`; return the time reached."""
        if self.version == "2.0":
            self.fmu.doStep(currentCommunicationPoint=self.time, communicationStepSize=size)
            self.time += size
        else:
            self.needs_event, _, self.returned_early, reached = self.fmu.doStep(
                currentCommunicationPoint=self.time, communicationStepSize=size
            )
            self.time = reached
        return self.time

    def advance(self, end: float) -> Self:
        """Advance to `end`, over early returns."""
        while self.time < end:
            self.step(end - self.time)
        return self

    def advance_to_event(self, limit: float = 1e3) -> None:
        """Advance to the next contact with an external law and enter event mode."""
        while not self.needs_event:
            assert self.time < limit
            self.step(1.0)
        self.fmu.enterEventMode()

    def answer(self, restitution: float, k: int = 1) -> None:
        """Answer the contact that waits in event mode, and return to step mode."""
        self.set(f"contact[{k}].applied_restitution", restitution)
        self.fmu.updateDiscreteStates()
        self.fmu.enterStepMode()
        self.needs_event = False

    def state(self) -> tuple[float, float]:
        return self.get("displacement"), self.get("velocity")

    def contact(self, *names: str, k: int = 1) -> list[Any]:
        return [self.get(f"contact[{k}].{name}") for name in names]

    def serialized(self) -> bytes:
        """Return the current state as bytes."""
        state = self.fmu.getFMUState()
        try:
            return bytes(self.fmu.serializeFMUState(state))
        finally:
            self.fmu.freeFMUState(state)

    def restore(self, data: bytes) -> None:
        """Restore a state from `serialized`."""
        state = self.fmu.deserializeFMUState(data)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)


class OscillatorFmu(ComponentFmu):
    """One initialized instance of the Oscillator."""

    def __init__(self, parameters: Mapping[str, float] = {}, **options: Any) -> None:
        super().__init__("Oscillator", parameters, **options)


def simulate(
    component: str,
    parameters: Mapping[str, float],
    output: list[str],
    stop_time: float,
    output_interval: float,
    *,
    version: str = "3.0",
    **options: Any,
) -> np.ndarray:
    """Run the FMU alone by FMPy's `simulate_fmu`; return its structured result."""
    folder, description = unpacked(fmu_path(component, version))
    result: np.ndarray = simulate_fmu(
        str(folder),
        model_description=description,
        validate=options.pop("validate", True),
        start_values=dict(parameters),
        output=output,
        stop_time=stop_time,
        output_interval=output_interval,
        **options,
    )
    return result
