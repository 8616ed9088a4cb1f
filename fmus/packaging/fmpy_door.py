"""The only use of FMPy: descriptions are read and validated by the reference implementation of FMI in Python.

No other module imports fmpy; the drivers of FMUs call their functions directly. FMPy also integrates FMUs for model
exchange, which this package does not.
"""

from __future__ import annotations

import ctypes.util
import io
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import ComponentError, ComponentFileError
from vibroimpact.fmus.packaging.archive import unpack
from vibroimpact.fmus.packaging.model_description import Finding, amended


@contextmanager
def _libraries_of_this_process() -> Iterator[None]:
    """Make FMPy find the C library in this process; on Linux it would start `ldconfig`, again in every worker."""
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
        read_model_description,
    )

__all__ = [
    "ModelDescription",
    "ModelVariable",
    "Reading",
    "integrated",
    "read",
    "read_description",
    "reading_of",
    "schema_folder",
]

DESCRIPTION = "modelDescription.xml"


@dataclass(frozen=True, slots=True)
class Reading:
    """A model description as it was read.

    Attributes
    ----------
    description : ModelDescription
        The description in FMPy's form.
    findings : tuple of Finding
        Faults that did not prevent the reading: remarks and doubts.
    """

    description: ModelDescription
    findings: tuple[Finding, ...]


def read(content: bytes) -> Reading:
    """Read a modelDescription.xml; faults are repaired and reported where the repair changes no number.

    The function is pure: it reads no file but FMI's schemas. Raise ComponentFileError with all problems, one a line, if
    the content breaks FMI's rules beyond repair.
    """
    mended = amended(content, schema_folder())
    if mended.refusals:
        raise ComponentFileError("\n".join(f"{DESCRIPTION}: {text}" for text in mended.refusals))
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w") as members:
        members.writestr(DESCRIPTION, mended.content)
    try:
        return Reading(read_model_description(archive, validate=False), mended.findings)
    except MemoryError:  # not a fault of the description
        raise
    except Exception as error:
        # FMPy raises plain Exception for faults beyond FMI's schema
        raise ComponentFileError(f"{DESCRIPTION}: {error}") from error


def reading_of(path: Path) -> Reading:
    """Read the model description of an FMU, after the checks of `archive.unpack`.

    Raises
    ------
    ComponentFileError
        The file is unsafe, or its description breaks FMI's rules beyond repair.
    """
    content = (unpack(path).folder / DESCRIPTION).read_bytes()
    try:
        return read(content)
    except ComponentFileError as error:
        lines = str(error).splitlines() or [""]
        raise ComponentFileError("\n".join(f"{path}: {line}" for line in lines)) from error


def read_description(path: Path) -> ModelDescription:
    """Return the model description of an FMU; see `reading_of`."""
    return reading_of(path).description


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
    """Return the results of an FMU for model exchange, integrated by FMPy's CVode.

    Parameters
    ----------
    path : Path
        The FMU.
    stop_time : float
        End of the run, s, from time 0.
    output : sequence of str
        Names of numeric variables.
    tolerance : float
        Relative tolerance of the integrator.
    start_values : mapping of str to float
        Start values by variable name; enumerations as integers.
    interval : float
        Time between two rows, s; events have rows too.
    step_finished : callable
        Function of the time, called after each step; it returns whether to go on.

    Returns
    -------
    ndarray
        A structured array with `time` and the variables.

    Raises
    ------
    ComponentError
        The integrator or the FMU failed; the message quotes FMPy.
    """
    folder = unpack(path).folder
    try:
        found: np.ndarray[Any, Any] = simulate_fmu(
            str(folder),
            model_description=_description_in(folder),
            logger=_ignored_log,
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
        # FMPy raises plain Exception when a solver gives up
        raise ComponentError(f"{path.stem}: model exchange: {error}") from error
    return found


@lru_cache(maxsize=4)
def _description_in(folder: Path) -> ModelDescription:
    """Return the model description of an unpacked FMU, read once: its folder is named by its content."""
    return read((folder / DESCRIPTION).read_bytes()).description


def _ignored_log(*message: object) -> None:
    """Drop a log message of an FMU: FMPy would print it between the lines of a command."""


def schema_folder() -> Path:
    """Return the folder of FMI's XML schemas, with one folder for each version (`fmi2`, `fmi3`)."""
    return Path(fmpy.__file__).parent / "schema"
