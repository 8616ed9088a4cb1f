"""What an importer is made of: components, connections, watched events. Scenes expand to these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from vibroimpact.fmus.shipped import package_folder

Crossing = Literal["falling", "rising", "either"]
Exchange = Literal["jacobi", "gauss_seidel", "iterated"]


@dataclass(frozen=True, slots=True)
class ComponentSpec:
    """One component.

    Attributes
    ----------
    name : str
        Its name in the scene.
    fmu : Path
        Its FMU file.
    parameters : mapping of str to number, bool or str
        Start values by variable name; enumerations by number or by item name.
    """

    name: str
    fmu: Path
    parameters: Mapping[str, float | int | bool | str] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Any, ...]:
        package = package_folder()
        if self.fmu.is_relative_to(package):
            # Another machine may have the package elsewhere.
            return _shipped, (self.name, self.fmu.relative_to(package), self.parameters)
        return ComponentSpec, (self.name, self.fmu, self.parameters)


def _shipped(name: str, place: Path, parameters: Mapping[str, float | int | bool | str]) -> ComponentSpec:
    return ComponentSpec(name, package_folder() / place, parameters)


@dataclass(frozen=True, slots=True)
class ConnectionSpec:
    """An output that feeds an input, times a gain.

    Attributes
    ----------
    source, target : tuple of str
        Component and variable.
    gain : float
        The input is gain * output.
    gain_unit : str or None
        Unit of the gain; None: dimensionless.
    """

    source: tuple[str, str]
    target: tuple[str, str]
    gain: float = 1.0
    gain_unit: str | None = None


@dataclass(frozen=True, slots=True)
class EventSpec:
    """A crossing of `level` by a variable of a component that has states but no events of its own."""

    component: str
    variable: str
    direction: Crossing = "falling"
    level: float = 0.0
