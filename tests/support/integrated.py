"""An instance of the package's FMUs for model exchange, driven call by call through FMPy."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from ctypes import byref, c_double
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Model,
    FMU2Slave,
    calloc,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    free,
)
from fmpy.fmi3 import FMU3Model, FMU3Slave, fmi3LogMessageCallback
from fmpy.logging import addLoggerProxy

from support.component_fmu import LOGGER2, MESSAGES2
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.shipped import fmu_path


class Integrated:
    """An instance for model exchange (or, by `kind`, co-simulation) in initialization mode."""

    def __init__(self, component: str, version: str, path: Path | None = None, kind: str = "ModelExchange"):
        fmu = unpack(path or fmu_path(component, version))
        self.description = fmpy.read_model_description(str(fmu.folder))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.new = version == "3.0"
        self.messages: list[str] = []
        of = {"ModelExchange": (FMU2Model, FMU3Model), "CoSimulation": (FMU2Slave, FMU3Slave)}[kind][self.new]
        self.fmu = of(
            guid=fmu.token,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=component,
            instanceName="it",
        )
        self.fmu.instantiate(**self._logger())
        if not self.new:
            self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()

    def _logger(self) -> dict[str, Any]:
        if self.new:
            return {
                "logMessage": fmi3LogMessageCallback(lambda *texts: self.messages.append(texts[-1].decode()))
            }
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.componentEnvironment = id(self)
        self.callbacks.logger = LOGGER2
        self.callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
        self.callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
        addLoggerProxy(byref(self.callbacks))
        MESSAGES2[id(self)] = self.messages
        return {"callbacks": self.callbacks}

    def set(self, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            whole = isinstance(value, int)
            kinds = ("setInt64", "setFloat64") if self.new else ("setInteger", "setReal")
            getattr(self.fmu, kinds[not whole])([self.references[name]], [value])

    def get(self, name: str) -> float:
        reader = self.fmu.getFloat64 if self.new else self.fmu.getReal
        return float(reader([self.references[name]])[0])

    def begin(self) -> None:
        """End initialization and handle the events of the start."""
        self.fmu.exitInitializationMode()
        self.update()
        self.fmu.enterContinuousTimeMode()

    def update(self) -> tuple[Any, ...]:
        return tuple(self.fmu.updateDiscreteStates() if self.new else self.fmu.newDiscreteStates())

    def numbers(self, what: str, count: int) -> list[float]:
        values = (c_double * max(count, 1))()
        getattr(self.fmu, what)(values, count)
        return list(values)[:count]

    def move(self, time: float, *states: float) -> None:
        self.fmu.setTime(time)
        self.fmu.setContinuousStates((c_double * len(states))(*states), len(states))

    def derivatives(self, count: int) -> list[float]:
        return self.numbers("getContinuousStateDerivatives" if self.new else "getDerivatives", count)

    def message(self, call: Callable[..., Any], *arguments: Any) -> str:
        """Return the message of a call that fails."""
        self.messages.clear()
        with pytest.raises(FMICallException):
            call(*arguments)
        return self.messages[-1]
