"""Any FMU of the package in both versions, driven by FMPy as any tool would."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from fmpy.model_description import ModelDescription, read_model_description
from numpy.typing import NDArray

from support.oscillator_fmu import OscillatorFmu
from vibroimpact.fmus import fmu_path
from vibroimpact.fmus.packaging.archive import unpack


@cache
def unpacked_file(path: Path) -> tuple[Path, ModelDescription]:
    """Return the folder of an unpacked FMU and its description."""
    folder = unpack(path).folder
    return folder, read_model_description(str(folder))


class ComponentFmu(OscillatorFmu):
    """One initialized instance of a component of the package, or of an exported file."""

    def __init__(
        self,
        component: str | Path,
        parameters: Mapping[str, float] = {},
        *,
        version: str = "3.0",
        **options: Any,
    ) -> None:
        self.path = component if isinstance(component, Path) else fmu_path(component, version)
        super().__init__(parameters, version=version, **options)

    def described(self, version: str) -> tuple[Path, ModelDescription]:
        return unpacked_file(self.path)

    def get_each(self, name: str, count: int) -> NDArray[np.float64]:
        """Return name[1] to name[count], where `name` has {} in the place of the index."""
        return np.array([self.get(name.format(k + 1)) for k in range(count)])

    def start_values(self) -> dict[str, float]:
        """Return the start value of every parameter and input, as described, by name."""
        described = [v for v in self._variables.values() if v.start is not None and not v.dimensions]
        kinds = {"Boolean": lambda text: text == "true", "Float64": float, "Real": float}
        return {v.name: kinds.get(v.type, int)(v.start) for v in described}
