"""The one door to FMPy: descriptions read and validated by the reference implementation of FMI in Python.

No other module imports fmpy; the drivers of FMUs call their functions directly. What integrates an FMU for model
exchange, which this package does not, is FMPy's too.
"""

from __future__ import annotations

import ctypes.util
import re
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.safe_xml import root_of


@contextmanager
def _libraries_of_this_process() -> Iterator[None]:
    """Let FMPy find the C library in this process: on Linux it would start `ldconfig`, in every worker again."""
    find_library = ctypes.util.find_library
    if sys.platform == "linux":
        # `CDLL(None)` has the symbols of the process
        ctypes.util.find_library = lambda name: None
    try:
        yield
    finally:
        ctypes.util.find_library = find_library


with _libraries_of_this_process():
    import fmpy
    from fmpy import simulate_fmu
    from fmpy.model_description import (
        ModelDescription,
        ModelVariable,
        ValidationError,
        read_model_description,
    )
    from fmpy.validation import validate_fmu

__all__ = ["ModelDescription", "ModelVariable", "integrated", "read_description", "schema_folder", "validate"]

_PART = r"[A-Za-z_][A-Za-z_0-9]*(\[[0-9]+(,[0-9]+)*\])?"
PLAIN_NAME = re.compile(rf"{_PART}(\.{_PART})*")
"""Names that both naming conventions of FMI allow: `contact[1].law`; `der(x)` and quoted ones are left to FMPy."""


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
    folder = unpack(path).folder
    with zipfile.ZipFile(path) as archive:
        members = [member.orig_filename for member in archive.filelist]
    if any("\\" in member for member in members) or not _has_plain_names(folder):
        return tuple(validate_fmu(str(path)))
    try:
        read_model_description(str(path), validate_model_structure=True)
    except ValidationError as error:
        return tuple(error.problems)
    except Exception as error:
        return (str(error),)
    return ()


def _has_plain_names(folder: Path) -> bool:
    """Return whether all names of variables are legal at a glance; FMPy parses a name in a hundredth of a second."""
    root = root_of((folder / "modelDescription.xml").read_bytes(), f"{folder.name}: modelDescription.xml")
    return all(
        PLAIN_NAME.fullmatch(variable.get("name", "")) for variable in root.iterfind("ModelVariables/*")
    )


def integrated(
    path: Path,
    stop_time: float,
    output: Sequence[str],
    *,
    tolerance: float,
    start_values: Mapping[str, float],
    interval: float,
    step_finished: Callable[[float], bool] = lambda time: True,
) -> np.ndarray[Any, Any]:
    """Return what an FMU for model exchange gives when FMPy's CVode integrates it.

    Parameters
    ----------
    path : Path
        The FMU.
    stop_time : float
        The end, s, from time 0.
    output : sequence of str
        Variables, numbers.
    tolerance : float
        Relative tolerance of the integrator.
    start_values : mapping of str to float
        Enumerations as integers.
    interval : float
        Time between two rows, s; events have rows too.
    step_finished : callable
        Given the time after each step; what it answers says whether to go on.

    Returns
    -------
    ndarray
        A structured array: `time`, then the variables.

    Raises
    ------
    ComponentError
        The integrator or the FMU failed, with what FMPy says.
    """
    folder = str(unpack(path).folder)
    try:
        found: np.ndarray[Any, Any] = simulate_fmu(
            folder,
            fmi_type="ModelExchange",
            solver="CVode",
            stop_time=stop_time,
            output=list(output),
            relative_tolerance=tolerance,
            start_values=dict(start_values),
            output_interval=interval,
            step_finished=lambda time, recorder: step_finished(time),
        )
    except Exception as error:
        # FMPy raises plain Exception where a solver gives up
        raise ComponentError(f"{path.stem}: model exchange: {error}") from error
    return found


def schema_folder() -> Path:
    """Return the folder of FMI's XML schemas, one folder in it for each version (`fmi2`, `fmi3`)."""
    return Path(fmpy.__file__).parent / "schema"
