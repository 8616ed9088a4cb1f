"""Bodies by matrices or by files of modes become given modes when a scene is read, so that it needs no file later."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vibroimpact.fmus.errors import UsageError
from vibroimpact.orchestrator.scene.body_models.matrices import MatricesBody
from vibroimpact.orchestrator.scene.changes import changed_key
from vibroimpact.orchestrator.scene.driving import highest_drive
from vibroimpact.orchestrator.scene.fields import known_keys
from vibroimpact.orchestrator.scene.problems import KeyPath, Problem, key_path, quoted, read_table

if TYPE_CHECKING:
    from vibroimpact.orchestrator.structures.request import Request

PATHS = ("file", "stiffness", "mass", "damping", "freedoms")
"""Keys of a body by matrices that name files."""
START = ("displacement_start", "velocity_start")
"""Keys of the modes that a body by files may have."""
LARGEST_TOLERANCE = 0.5
MODES = (
    "frequencies",
    "angular_frequencies",
    "damping_ratio",
    "damping_matrix",
    "shapes",
    "participation",
    *START,
)
"""Keys of the modes, which may be changed once they are known."""


def files_named(document: Mapping[str, Any]) -> Iterator[str]:
    """Yield the keys of bodies that name files.

    >>> list(files_named({"body": [{"kind": "modes", "file": "a.uff"}, {"kind": "chain"}]}))
    ['body[1].file']
    """
    for path, body in _bodies(document):
        yield from (key_path((*path, key)) for key in _keys_of_files(body))


def _keys_of_files(body: Mapping[str, Any]) -> Iterator[str]:
    kind = body.get("kind")
    keys = PATHS if kind == "matrices" else ("file",) if kind == "modes" else ()
    yield from (key for key in keys if key in body)


def with_given_modes(document: dict[str, Any], folder: Path) -> tuple[dict[str, Any], list[Problem]]:
    """Return a document whose bodies by files have their modes as numbers, and the problems of their tables."""
    if not any(body.get("kind") == "matrices" or "file" in body for _, body in _bodies(document)):
        return document, []
    problems: list[Problem] = []
    found: list[Any] = []
    auto = _for_auto(document)
    for path, body in _bodies(document):
        names = set(points_named(document, str(body.get("name", path[0]))))
        if body.get("kind") == "matrices":
            found.append(_of_matrices(body, path, folder, names, auto, problems))
        elif body.get("kind") == "modes" and "file" in body:
            found.append(_of_modes(body, path, folder, names, problems))
        else:
            found.append(body)
    written = document["body"]
    return {**document, "body": found if isinstance(written, list) else found[0]}, problems


def request_of(document: Mapping[str, Any], name: str, folder: Path) -> Request | None:
    """Return the request of a body by matrices in a document that is a scene; None of any other body."""
    for path, body in _bodies(document):
        if body.get("name", path[0]) == name and body.get("kind") == "matrices":
            table = _table(body, path, [])
            named = set(points_named(document, name))
            return None if table is None else _request(table, folder, named, _for_auto(document))
    return None


def apart_from_modes(document: Mapping[str, Any], changes: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the changes to make before bodies by files have their modes, and those of the modes themselves.

    >>> body = {"kind": "matrices", "mass": "m.mtx", "stiffness": "k.mtx"}
    >>> apart_from_modes({"body": body}, ["body.modes=8", "body.frequencies[1]=20"])
    (['body.modes=8'], ['body.frequencies[1]=20'])
    """
    owners = {tuple(path) for path, body in _bodies(document) if any(_keys_of_files(body))}

    def is_of_modes(text: str) -> bool:
        path = changed_key(text)
        depth = next((len(owner) for owner in owners if path[: len(owner)] == owner), len(path))
        key = path[depth:]
        known = known_keys(MatricesBody) if key else ()
        return key[:1] != () and key[0] in MODES and (len(key) > 1 or key[0] not in known)

    before = [text for text in changes if not is_of_modes(text)]
    return before, [text for text in changes if is_of_modes(text)]


def with_bodies_in_text(text: str, document: Mapping[str, Any]) -> str:
    """Return the text of a scene with the bodies of a document, and with the comments of its other tables."""
    import tomlkit  # the import takes time, and few scenes are written anew

    edited = tomlkit.parse(text)
    edited["body"] = document["body"]
    return tomlkit.dumps(edited)


def _bodies(document: Mapping[str, Any]) -> Iterator[tuple[KeyPath, dict[str, Any]]]:
    bodies = document.get("body")
    if isinstance(bodies, dict):
        yield ("body",), bodies
    for place, body in enumerate(bodies if isinstance(bodies, list) else ()):
        yield ("body", place), body if isinstance(body, dict) else {}


def points_named(document: Mapping[str, Any], name: str) -> Iterator[str]:
    """Yield what follows the name of a body in all points of a document."""

    def texts(value: object) -> Iterator[str]:
        if isinstance(value, str):
            yield value
        elif isinstance(value, list):
            for each in value:
                yield from texts(each)

    tables = [document.get(each) for each in ("stop", "contact", "link", "forcing", "replay")]
    rows = [row for table in tables for row in (table if isinstance(table, list) else [table])]
    record = document.get("record")
    for row in (*rows, record):
        for key in ("at", "between", "observed"):
            for text in texts(row.get(key) if isinstance(row, dict) else None):
                owner, _, rest = text.partition(".")
                if owner == name and rest:
                    yield rest


def _for_auto(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the highest frequency and the tolerance of a scene for `modes = "auto"`, the tolerance if it is sound."""
    execution = document.get("execution")
    given = execution.get("tolerance") if isinstance(execution, dict) else None
    found = {"driven": highest_drive(document)}
    if isinstance(given, int | float) and 0.0 < given <= LARGEST_TOLERANCE:
        found["tolerance"] = float(given)
    return found


def _of_matrices(
    body: dict[str, Any],
    path: KeyPath,
    folder: Path,
    named: set[str],
    auto: Mapping[str, Any],
    problems: list[Problem],
) -> dict[str, Any]:
    """Return the modes of a body by matrices as its table."""
    from vibroimpact.orchestrator.structures.find import find_modes, fitting  # scipy takes time

    table = _table(body, path, problems)
    if table is None:
        return body
    try:
        modes = fitting(find_modes(_request(table, folder, named, auto)), named)
    except UsageError as error:
        problems.append(_problem(path, error))
        return body
    one_ratio = table.rayleigh is None and not isinstance(table.damping_ratio, tuple)
    # a key for all modes, as it is written
    ratio = {"damping_ratio": table.damping_ratio} if one_ratio else {}
    return {key: body[key] for key in ("name", *START) if key in body} | modes.table() | ratio


def _table(body: Mapping[str, Any], path: KeyPath, problems: list[Problem]) -> MatricesBody | None:
    """Return the table of a body by matrices, without its name and its start."""
    own = {key: value for key, value in body.items() if key not in ("name", *START)}
    table = read_table(MatricesBody, own, path, problems)
    for key in ("stiffness", "mass"):
        if table is not None and table.file is None and getattr(table, key) is None:
            problems.append(
                Problem(key_path((*path, key)), "a file", "nothing", "Or give file, which holds both.")
            )
            return None
    return table


def _request(table: MatricesBody, folder: Path, named: set[str], auto: Mapping[str, Any]) -> Request:
    from vibroimpact.orchestrator.structures.request import Request

    rayleigh = table.rayleigh
    found = Request(
        stiffness=table.stiffness or "",
        mass=table.mass or "",
        damping=table.damping,
        file=None if table.file is None else Path(table.file),
        freedoms=None if table.freedoms is None else Path(table.freedoms),
        folder=folder,
        points={name: {at: 1.0} if isinstance(at, str) else at for name, at in table.points.items()},
        named=tuple(sorted(named - table.points.keys())),
        modes=table.modes,
        residual=table.residual,
        base=table.base,
        damping_ratio=table.damping_ratio,
        rayleigh=(0.0, 0.0) if rayleigh is None else (rayleigh.mass, rayleigh.stiffness),
    )
    return replace(found, **auto) if table.modes == "auto" else found


def _of_modes(
    body: dict[str, Any], path: KeyPath, folder: Path, named: set[str], problems: list[Problem]
) -> dict[str, Any]:
    """Return the modes of a file as a table, with the keys that the body has itself."""
    from vibroimpact.orchestrator.structures.find import modes_of_file

    file = body["file"]
    if not isinstance(file, str):
        problems.append(Problem(key_path((*path, "file")), "the name of a file", quoted(file)))
        return body
    try:
        table = modes_of_file(folder / file, named).table()
    except UsageError as error:
        problems.append(_problem((*path, "file"), error))
        return body
    if "angular_frequencies" in body:
        del table["frequencies"]
    return table | {key: value for key, value in body.items() if key != "file"}


def _problem(path: KeyPath, error: UsageError) -> Problem:
    """Return the problem that the error of a file is: the place in the file follows the key."""
    said, _, got = str(error).partition(", got ")
    place, _, expected = said.rpartition("expected ")
    key = ": ".join(filter(None, (key_path(path), place.removesuffix(": "))))
    return Problem(key, expected, got.removesuffix("."))
