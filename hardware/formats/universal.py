"""Contents of a universal file (UFF) besides functions over time: frequency responses, spectra, shapes, geometry.

A recording has only channels over time, so they are not imported; analyses of modes read them here.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vibroimpact.fmus.errors import DatasetError
from vibroimpact.hardware.formats.probe import one_refusal
from vibroimpact.hardware.formats.reading import read_datasets_apart
from vibroimpact.hardware.formats.table import MOST_SAMPLES, Floats
from vibroimpact.hardware.formats.uff import DIRECTIONS, KINDS, text_of

_FUNCTION, _SHAPE, _NODES, _TRACE, _NODES_IN_FULL, _UNITS = 58, 55, 15, 82, 2411, 164
_READ = frozenset({_FUNCTION, _SHAPE, _NODES, _TRACE, _NODES_IN_FULL, _UNITS})
_SHAPE_KINDS = {
    2: "a normal mode",
    3: "a complex mode",
    5: "a frequency response at one frequency",
    7: "a complex mode of velocity",
}

Numbers = NDArray[np.float64] | NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class Place:
    """A node and a direction: `+X`, `-RZ`; empty if the file has none."""

    node: int
    direction: str


@dataclass(frozen=True, slots=True)
class UniversalFunction:
    """A function of dataset 58.

    Attributes
    ----------
    kind : str
        `a frequency response`, `a power spectral density`, `a time response`, ...
    name : str
    abscissa : ndarray of float, shape (point,)
        In `abscissa_unit`: Hz for a spectrum, s for a time response.
    values : ndarray of float or complex, shape (point,)
        In `unit`, over `per_unit` if there is one: `m/s^2` per `N`.
    response, reference : Place
    """

    kind: str
    name: str
    abscissa: Floats
    values: Numbers
    abscissa_unit: str
    unit: str
    per_unit: str
    response: Place
    reference: Place


@dataclass(frozen=True, slots=True)
class UniversalShape:
    """Data at nodes, from dataset 55.

    Attributes
    ----------
    kind : str
        `a normal mode`, `a complex mode`, ...
    name : str
    number : int
        Number of the mode, or of the frequency step.
    frequency : float
        Hz; NaN for a complex mode.
    damping_ratio : float
        Viscous, relative to the critical one; NaN if the dataset has none.
    eigenvalue : complex
        1/s; NaN for a normal mode.
    nodes : ndarray of int, shape (node,)
    values : ndarray of float or complex, shape (node, direction)
        X, Y, Z, and rotations about them if there are six.
    """

    kind: str
    name: str
    number: int
    frequency: float
    damping_ratio: float
    eigenvalue: complex
    nodes: NDArray[np.intp]
    values: Numbers


@dataclass(frozen=True, slots=True)
class UniversalFile:
    """Datasets of a universal file, by kind.

    Attributes
    ----------
    functions : sequence of UniversalFunction
    shapes : sequence of UniversalShape
    nodes : ndarray of int, shape (node,)
        Labels of the nodes of datasets 15 and 2411.
    coordinates : ndarray of float, shape (node, 3)
        In the unit of length of the file, `units`.
    traces : mapping
        Labels of nodes joined by lines, by the name of the trace; 0 lifts the pen.
    units : str
        The system of units of dataset 164, or empty.
    left_out : mapping
        Number of datasets of other types, by type.
    """

    functions: Sequence[UniversalFunction]
    shapes: Sequence[UniversalShape]
    nodes: NDArray[np.intp]
    coordinates: Floats
    traces: Mapping[str, NDArray[np.intp]]
    units: str
    left_out: Mapping[int, int]


def read_universal(path: os.PathLike[str] | str) -> UniversalFile:
    """Return functions, shapes and geometry of a universal file, equal to pyuff's.

    Parameters
    ----------
    path : path

    Returns
    -------
    UniversalFile
        From datasets 58, 55, 15, 82, 2411 and 164.

    Raises
    ------
    DatasetError
        pyuff is not installed, or the file is damaged, cut off, or larger than an import takes.
    """
    types, datasets, cut = read_datasets_apart(Path(path), _READ)
    if cut:
        raise DatasetError(f"{path}: expected a whole universal file (UFF), got one that is cut off.")
    of_type = {kind: [found for found in datasets if found["type"] == kind] for kind in _READ}
    if sum(len(found["data"]) for found in of_type[_FUNCTION]) > MOST_SAMPLES:
        raise DatasetError(f"{path}: expected at most {MOST_SAMPLES} samples, got more. Cut it into pieces.")
    with one_refusal("a whole universal file (UFF)"):
        geometry = [*of_type[_NODES], *of_type[_NODES_IN_FULL]]
        nodes = [np.asarray(found["node_nums"], dtype=np.intp) for found in geometry]
        places = [np.column_stack([found["x"], found["y"], found["z"]]) for found in geometry]
        units = [text_of(found.get("units_description")) for found in of_type[_UNITS]]
        return UniversalFile(
            [_function(found) for found in of_type[_FUNCTION]],
            [_shape(found) for found in of_type[_SHAPE]],
            np.concatenate(nodes) if nodes else np.empty(0, dtype=np.intp),
            np.concatenate(places).astype(np.float64) if places else np.empty((0, 3)),
            {_trace_name(found): np.asarray(found["nodes"], dtype=np.intp) for found in of_type[_TRACE]},
            units[0] if units else "",
            {kind: types.count(kind) for kind in sorted(set(types) - _READ)},
        )


def _function(found: Mapping[str, Any]) -> UniversalFunction:
    kind = int(found.get("func_type", 0))
    values = np.asarray(found["data"])
    return UniversalFunction(
        KINDS.get(kind, f"a function of type {kind}"),
        text_of(found.get("id1")),
        np.asarray(found["x"], dtype=np.float64),
        _numbers(values),
        text_of(found.get("abscissa_axis_units_lab")),
        text_of(found.get("ordinate_axis_units_lab")),
        text_of(found.get("orddenom_axis_units_lab")),
        _place(found, "rsp"),
        _place(found, "ref"),
    )


def _numbers(values: NDArray[Any]) -> Numbers:
    """Return real or complex numbers in double precision."""
    if np.iscomplexobj(values):
        return values.astype(np.complex128)
    return values.astype(np.float64)


def _place(found: Mapping[str, Any], which: str) -> Place:
    """Return the node and direction of a response (`rsp`) or reference (`ref`)."""
    direction = int(found.get(f"{which}_dir", 0))
    sign = DIRECTIONS.get(abs(direction), "")
    return Place(int(found.get(f"{which}_node", 0)), sign.replace("+", "-") if direction < 0 else sign)


def _shape(found: Mapping[str, Any]) -> UniversalShape:
    kind = int(found["analysis_type"])
    parts = [np.asarray(found[key]) for key in ("r1", "r2", "r3", "r4", "r5", "r6") if key in found]
    values = np.column_stack(parts)
    return UniversalShape(
        _SHAPE_KINDS.get(kind, f"data of analysis {kind}"),
        text_of(found.get("id1")),
        int(found.get("mode_n", found.get("freq_step_n", 0))),
        float(found.get("freq", np.nan)),
        float(found.get("modal_damp_vis", np.nan)),
        complex(found.get("eig", complex(np.nan, np.nan))),
        np.asarray(found["node_nums"], dtype=np.intp),
        _numbers(values),
    )


def _trace_name(found: Mapping[str, Any]) -> str:
    return f"{text_of(found.get('id'))} {int(found.get('trace_num', 0))}".strip()
