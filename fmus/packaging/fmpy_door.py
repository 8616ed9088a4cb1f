"""The one door to FMPy: descriptions read and validated by the reference implementation of FMI in Python.

No other module imports fmpy; the drivers of FMUs call their functions directly.
"""

from __future__ import annotations

from pathlib import Path

import fmpy
from fmpy.model_description import ModelDescription, ModelVariable, ValidationError, read_model_description
from fmpy.validation import validate_fmu

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.archive import unpack

__all__ = ["ModelDescription", "ModelVariable", "read_description", "schema_folder", "validate"]


def read_description(path: Path) -> ModelDescription:
    """Read and validate the model description of an FMU, after the checks of `archive.unpack`.

    Raises
    ------
    ComponentFileError
        The file is unsafe or its description breaks FMI's rules.
    """
    folder = str(unpack(path).folder)
    try:
        return read_model_description(folder)
    except ValidationError as error:
        raise ComponentFileError(f"{path}: {'; '.join(error.problems)}") from error
    except Exception as error:
        # FMPy raises plain Exception for what FMI's schema cannot say
        raise ComponentFileError(f"{path}: modelDescription.xml: {error}") from error


def validate(path: Path) -> tuple[str, ...]:
    """Return what `fmpy validate` finds wrong with an FMU; the file is checked for safety first."""
    unpack(path)
    return tuple(validate_fmu(str(path)))


def schema_folder() -> Path:
    """Return the folder of FMI's XML schemas, one folder in it for each version (`fmi2`, `fmi3`)."""
    return Path(fmpy.__file__).parent / "schema"
