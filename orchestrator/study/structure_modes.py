"""The modes of a structure: of matrices, of a file of modes, or of a body of a scene; and their dataset."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr

from vibroimpact.analysis.dataset.provenance import program_attributes
from vibroimpact.analysis.dataset.results import ResultTable, write_results
from vibroimpact.fmus.bodies.impacting_body import Floats
from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models.modes import MOST_POINTS, POINT_NAME, ModesBody
from vibroimpact.orchestrator.scene.body_models.structure import StructureBody
from vibroimpact.orchestrator.scene.changes import changed_document
from vibroimpact.orchestrator.scene.file import parse_scene_toml, read_scene_text
from vibroimpact.orchestrator.scene.own_structures import apart_from_modes, request_of
from vibroimpact.orchestrator.ssp import opened_scene
from vibroimpact.orchestrator.structures.find import find_modes
from vibroimpact.orchestrator.structures.matrices import AXES
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.modes_files import read_modes
from vibroimpact.orchestrator.structures.modes_files import write_modes as write_text
from vibroimpact.orchestrator.structures.modes_files.writing import ENDINGS
from vibroimpact.orchestrator.structures.readers.child import SUFFIXES as OF_MATRICES
from vibroimpact.orchestrator.structures.request import Request, Weights

KIND, AUTO = "modes", "auto"
TABLE = ResultTable(
    KIND,
    ("frequency", "mode", "Hz", "natural frequency; 0 of a rigid body"),
    ("damping_ratio", "mode", "1", "damping ratio"),
    ("damping_matrix", "mode other_mode", "s-1", "modal damping matrix, besides the damping ratios"),
    ("participation", "mode", "kg0.5", "participation in a motion of the base"),
    ("effective_mass", "mode", "kg", "effective mass in a motion of the base"),
    ("is_residual", "mode", "1", "whether the mode is a residual vector: 1, or 0"),
    ("shape", "point mode", "kg-0.5", "mass-normalised shape at the point"),
    ("point_mass", "point mode", "kg", "effective mass of the mode at the point; NaN at a node of the mode"),
    ("flexibility", "point", "m N-1", "static flexibility of the elastic modes at the point"),
    ("flexibility_without", "point", "m N-1", "static flexibility without residual vectors"),
    ("x", "point", "m", "place of the point along x"),
    ("y", "point", "m", "place of the point along y"),
    ("z", "point", "m", "place of the point along z"),
    ("total_mass", "axis", "kg", "mass that moves along the axis"),
    ("centre_of_mass", "axis", "m", "place of the centre of mass along the axis"),
    ("mode", "mode", "1", "number of the mode"),
    ("axis", "axis", "1", "x, y or z", "text"),
    ("point", "point", "1", "name of the point", "text"),
)
AT_NODE = 1e-10
"""Share of the largest shape below which a point counts as a node of a mode: shapes are rounded to some 1e-14."""
_DATASET = ".nc"
_ONE_MATRIX = ".mtx"
_SCENE_TABLES = frozenset(
    {"scene", "stop", "contact", "link", "forcing", "record", "execution", "sweep", "sensor"}
)
"""Tables by which a TOML file is a scene, and no file of modes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """The choices of a caller about matrices; None where nothing is chosen. `Request` explains them.

    Attributes
    ----------
    stiffness, mass, damping : str or None
        The file of a matrix, or its name in the studied file.
    freedoms : Path or None
    points : mapping of str to str or mapping of str to float, or None
        Degree of freedom at each named point, or weights of several.
    modes : int, "auto" or None
    tolerance, damping_ratio : float or None
    rayleigh : mapping of str to float, or None
        `mass`, 1/s, and `stiffness`, s: factors of both matrices in the damping.
    residual : False or None
    base : str or None
    """

    stiffness: str | None = None
    mass: str | None = None
    damping: str | None = None
    freedoms: Path | None = None
    points: Mapping[str, str | Weights] | None = None
    modes: int | Literal["auto"] | None = None
    tolerance: float | None = None
    residual: bool | None = None
    base: str | None = None
    damping_ratio: float | None = None
    rayleigh: Mapping[str, float] | None = None

    def refuse(self, words: str) -> None:
        """Raise UsageError if something is chosen beside another file than one of matrices."""
        for each in fields(self):
            if getattr(self, each.name) is not None:
                name = "point" if each.name == "points" else each.name
                raise UsageError(
                    message(Argument(name), f": expected none beside {words}, got one. Leave it out.")
                )


def modes_of(
    file: Path | Scene,
    choices: Choices,
    *,
    body: str | None = None,
    changes: tuple[str, ...] = (),
    figure: bool = False,
) -> Modes:
    """Return the modes of a structure.

    Parameters
    ----------
    file : Path or Scene
        Matrices, modes, or a scene with a body by matrices or modes.
    choices : Choices
        For matrices alone.
    body : str or None
        Name of the body of a scene; None where there is one.
    changes : tuple of str
        Changes of the scene, `KEY=VALUE`.
    figure : bool
        Whether a figure needs shapes at further degrees of freedom. Without points they have shapes in any case.

    Raises
    ------
    UsageError
        The file cannot be read, a choice does not fit it, or the scene has no such body.
    SceneError
        The scene has problems.
    """
    if isinstance(file, Scene) or is_scene(file):
        choices.refuse("a scene")
        name, found = _of_scene(opened_scene(file, changes) if isinstance(file, Path) else file, body)
        return _with_matrices(found, file, name, changes, figure=figure) if isinstance(file, Path) else found
    for name, given in (("body", body), ("set", changes)):
        if given:
            raise UsageError(message(Argument(name), ": expected a scene with it, got another file."))
    if _suffix(file) in OF_MATRICES:
        request = _request(file, choices, figure)
        try:
            return find_modes(request)
        except UsageError as error:
            said = str(error)
            raise UsageError(f"{file}: {said}" if said.startswith("expected") else said) from None
    choices.refuse("a file of modes")
    return read_modes(file)


def is_scene(path: Path) -> bool:
    """Return whether a file is a scene, or a system: a TOML file with other tables than that of one body of modes."""
    if path.suffix == ".ssp":
        return True
    if _suffix(path) != ".toml":
        return False
    try:
        document = parse_toml(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return True  # the scene reader names the problem
    body = document.get("body", document)
    if isinstance(body, list) and len(body) == 1:
        body = body[0]
    own = isinstance(body, dict) and body.get("kind", KIND) == KIND and "file" not in body
    return not own or not _SCENE_TABLES.isdisjoint(document)


def _suffix(path: Path) -> str:
    name = path.name.lower()
    return Path(name.removesuffix(".gz")).suffix


def _request(file: Path, choices: Choices, figure: bool) -> Request:
    """Return the request of a file of matrices; a matrix that is a file makes the first file the stiffness matrix."""
    points = {name: {at: 1.0} if isinstance(at, str) else at for name, at in (choices.points or {}).items()}
    for name in points:
        if POINT_NAME.fullmatch(name) is None:
            raise UsageError(
                message(Argument("point"), f": expected a name of letters and digits, got {name[:60]!r}.")
            )
    apart = any(each is not None and Path(each).is_file() for each in (choices.mass, choices.damping))
    given: dict[str, Any] = {
        each.name: getattr(choices, each.name)
        for each in fields(choices)
        if getattr(choices, each.name) is not None
    }
    if apart and choices.stiffness is not None:
        raise UsageError(
            message(
                Argument("stiffness"),
                ": expected none beside a file of the mass matrix, got one. Leave it out.",
            )
        )
    if not apart and _suffix(file) == _ONE_MATRIX:
        got = "none" if choices.mass is None else f"{choices.mass}, which is no file"
        raise UsageError(message(Argument("mass"), f": expected the file of the mass matrix, got {got}."))
    given |= {"rayleigh": _rayleigh(choices.rayleigh)} if choices.rayleigh is not None else {}
    if choices.damping_ratio is not None and not 0.0 <= choices.damping_ratio < math.inf:
        got = f": expected a damping ratio >= 0, got {choices.damping_ratio:g}."
        raise UsageError(message(Argument("damping_ratio"), got))
    matrices = {"stiffness": str(file), "mass": ""} if apart else {"file": file, "stiffness": "", "mass": ""}
    shown = MOST_POINTS - len(points) if figure or not points else 0
    return Request(**{**matrices, **given, "points": points, "folder": Path(), "shown": shown})


def _rayleigh(given: Mapping[str, float]) -> tuple[float, float]:
    """Return the factors of the mass and of the stiffness in the damping; others raise UsageError."""
    is_known = isinstance(given, Mapping) and given and given.keys() <= {"mass", "stiffness"}
    if not is_known or not all(
        isinstance(each, int | float) and 0.0 <= each < math.inf for each in given.values()
    ):
        expected = ": expected {mass = .., stiffness = ..} of numbers >= 0, got others."
        raise UsageError(message(Argument("rayleigh"), expected))
    return float(given.get("mass", 0.0)), float(given.get("stiffness", 0.0))


def _with_matrices(modes: Modes, file: Path, name: str, changes: tuple[str, ...], *, figure: bool) -> Modes:
    """Return modes of a body of a scene with what its matrices know: masses, and shapes at nodes for a figure."""
    if file.suffix != ".toml":
        return modes
    written = parse_scene_toml(read_scene_text(file, str(file)), str(file))
    before, _ = apart_from_modes(written, changes)
    document = changed_document(written, before)[0] if before else written
    request = request_of(document, name, file.parent)
    if request is None:
        return modes
    found = find_modes(replace(request, shown=MOST_POINTS - len(modes.shapes)) if figure else request)
    shapes = {**modes.shapes, **{key: each for key, each in found.shapes.items() if key not in modes.shapes}}
    return replace(
        modes, shapes=shapes, coordinates=found.coordinates, masses=found.masses, centre=found.centre
    )


def _of_scene(scene: Scene, body: str | None) -> tuple[str, Modes]:
    """Return the name and the modes of a body of a scene."""
    whole = scene.bodies[0]
    parts = dict(zip(whole.names, whole.parts, strict=True)) if isinstance(whole, StructureBody) else {}
    there = {name: part for name, part in parts.items() if isinstance(part, ModesBody)}
    if not there:
        raise UsageError(f"{scene.source}: expected a body by matrices or modes, got none.")
    if body is None and len(there) > 1:
        raise UsageError(
            message(
                f"{scene.source}: expected one body, got {', '.join(there)}. Name it: ", Argument("body"), "."
            )
        )
    if body is not None and body not in there:
        raise UsageError(message(Argument("body"), f": expected one of {', '.join(there)}, got {body!r}."))
    name = body or next(iter(there))
    return name, there[name].given_modes()


def refuse_ending(path: Path) -> None:
    """Raise UsageError unless the name of a file of modes has a known ending."""
    if path.suffix.lower() not in (*ENDINGS, _DATASET):
        endings = ", ".join((*ENDINGS, _DATASET))
        raise UsageError(f"{path}: expected a name ending in {endings}, got {path.suffix[:60] or 'none'!r}.")


def write_modes(path: Path, modes: Modes, named: Collection[str] | None) -> None:
    """Write modes in the format of the file's name, with the named points alone where some are named.

    UsageError: the modes do not fit into the format. OSError: the file cannot be written.
    """
    if path.suffix.lower() == _DATASET:
        write_results(dataset_of(modes), path)
        return
    kept = {name: shape for name, shape in modes.shapes.items() if not named or name in named}
    try:
        write_text(path, replace(modes, shapes=kept))
    except UsageError as error:
        said = str(error)
        raise UsageError(f"{path}: {said}" if said.startswith("expected") else said) from None


def dataset_of(modes: Modes, title: str = "") -> xr.Dataset:
    """Return the dataset of modes, which `kind = "modes"` reads from a NetCDF file.

    Parameters
    ----------
    modes : Modes
    title : str
        Name of the structure, for a figure and a print.
    """
    shapes = np.array(list(modes.shapes.values()))
    with_all, without = flexibilities(modes)
    places = np.array([modes.coordinates.get(name, (np.nan,) * 3) for name in modes.shapes])
    squares = np.where(np.abs(shapes) > AT_NODE * np.abs(shapes).max(initial=0.0), shapes, 0.0) ** 2
    values: dict[str, Any] = {
        "frequency": modes.natural / (2.0 * np.pi),
        "damping_ratio": modes.damping_ratios,
        "damping_matrix": modes.damping,
        "participation": modes.participation,
        "effective_mass": None if modes.participation is None else modes.participation**2,
        "is_residual": np.arange(len(modes.natural)) >= len(modes.natural) - modes.residual_vectors,
        "shape": shapes,
        "point_mass": np.divide(1.0, squares, out=np.full(squares.shape, np.nan), where=squares > 0.0),
        "flexibility": with_all,
        "flexibility_without": without,
        **(dict(zip("xyz", places.T, strict=True)) if modes.coordinates else {}),
        "total_mass": [modes.masses.get(axis, np.nan) for axis in AXES] if modes.masses else None,
        "centre_of_mass": modes.centre or None,
        "mode": np.arange(1, len(modes.natural) + 1),
        "point": list(modes.shapes),
    }
    attributes: dict[str, Any] = {
        "title": title,
        "residual_vectors": modes.residual_vectors,
        "files": json.dumps(dict(modes.files)),
    }
    attributes |= {} if modes.error is None else {"error": modes.error}
    attributes |= {"remarks": "\n".join(modes.remarks)} if modes.remarks else {}
    if modes.masses:
        values["axis"] = list(AXES)
    given = {name: value for name, value in values.items() if value is not None}
    return TABLE.dataset(given, attributes | program_attributes())


def effective_ratios(modes: Modes) -> Floats:
    """Return the damping ratio of each mode alone, the diagonal of its damping matrix included; 0 of a rigid body."""
    if modes.damping is None:
        return modes.damping_ratios
    elastic = np.where(modes.natural > 0.0, modes.natural, np.inf)
    return modes.damping_ratios + np.diag(modes.damping) / (2.0 * elastic)


def flexibilities(modes: Modes) -> tuple[Floats, Floats]:
    """Return the static flexibility of the elastic modes at each point, with and without residual vectors, m/N."""
    shapes = np.array(list(modes.shapes.values()))
    elastic = modes.natural > 0.0
    parts = np.where(elastic, shapes**2 / np.where(elastic, modes.natural, 1.0) ** 2, 0.0)
    kept = len(modes.natural) - modes.residual_vectors
    return parts.sum(axis=1), parts[:, :kept].sum(axis=1)
