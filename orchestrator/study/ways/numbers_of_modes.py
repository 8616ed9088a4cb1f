"""Other numbers of modes of structures: of modes, of matrices, and of beams among several bodies."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from vibroimpact.fmus.errors import SceneError, UsageError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.fmi.instance import Wrapper
from vibroimpact.orchestrator.scene import Scene
from vibroimpact.orchestrator.scene.body_models import ModesBody, StructureBody
from vibroimpact.orchestrator.scene.file import parse_scene_toml, read_scene_text
from vibroimpact.orchestrator.scene.laws import any_rigid
from vibroimpact.orchestrator.scene.own_structures import START, points_named, request_of
from vibroimpact.orchestrator.structures.modes import Modes
from vibroimpact.orchestrator.structures.truncation import Truncation, truncated
from vibroimpact.orchestrator.study.ways.driven import DrivenTrial
from vibroimpact.orchestrator.study.ways.way import Opener, Trial, Way, opened_part, way_by_scene

MOST_MODES = 64
"""Largest number of modes of all bodies of a scene."""
MODES_TRIED = (1, 2, 4, 8, 16, 32, MOST_MODES)
FINER_BEAM = 4
"""Modes of the reference of a beam on stops that yield, over the modes that the scene gives it."""
SAME_MODES = 1e-9
"""Relative difference of natural frequencies, up to which matrices have the modes of a scene."""


def finest_modes(scene: Scene) -> dict[int, Modes]:
    """Return the most modes that the matrices of a scene's file give to its bodies, by place of the body.

    A body is missing if its matrices are not there any more, have changed, or give no more modes than the scene has.
    """
    if not isinstance(scene.bodies[0], StructureBody) or not Path(scene.source).is_file():
        return {}
    try:
        document = parse_scene_toml(read_scene_text(Path(scene.source), scene.source), scene.source)
    except SceneError:
        return {}  # the scene was read from another text
    parts = scene.bodies[0].parts
    by_matrices = [place for place, part in enumerate(parts) if isinstance(part, ModesBody) and _files(part)]
    others = sum(part.size for place, part in enumerate(parts) if place not in by_matrices)
    found = {}
    for place in by_matrices:
        modes = _more_modes(document, scene, place, (MOST_MODES - others) // len(by_matrices))
        if modes is not None:
            found[place] = modes
    return found


def _files(part: ModesBody) -> Mapping[str, str]:
    return {} if part.origin is None else part.origin.files


def _more_modes(document: Mapping[str, Any], scene: Scene, place: int, most: int) -> Modes | None:
    """Return the modes of a body by matrices up to a number; None where they do not continue those of the scene."""
    from vibroimpact.orchestrator.structures.find import find_modes  # scipy takes time

    body: Any = scene.body
    part: ModesBody = body.parts[place]
    request = request_of(document, body.names[place], Path(scene.source).parent)
    if request is None or most <= part.size or part.displacement_start or part.velocity_start:
        return None
    try:
        found = find_modes(replace(request, modes=most, residual=True, damping_ratio=0.0))
    except UsageError:
        return None
    natural = part.size - part.given_modes().residual_vectors
    is_same = found.files == _files(part) and set(found.shapes) == set(part.shapes)
    if not is_same or not np.allclose(found.natural[:natural], part.natural[:natural], rtol=SAME_MODES):
        return None
    if isinstance(part.damping_ratio, tuple):
        return found if request.damping_ratio == 0.0 else None  # a ratio of each mode has none for more modes
    return replace(found, damping_ratios=np.full(len(found.natural), part.damping_ratio))


def numbers_of_modes(scene: Scene, finest: Mapping[int, Modes], recorded: Scene) -> list[Way]:
    """Return the ways with other numbers of modes of a structure, with and without residual vectors.

    Their reference has the most modes. These are those of `finest_modes`, or all that a body is given. A beam has four
    times its own on contacts that yield. A count holds for each body that has as many. Masses of oscillators and
    chains stay.

    Parameters
    ----------
    scene : Scene
        A scene of several bodies without a sweep.
    finest : mapping of int to Modes
        Modes by place of the body, in place of its own.
    recorded : Scene
        The scene with all of its recording, in place of `scene` where a stop is rigid. Each impact on it excites all
        modes: motions are compared as a whole, and not by their impacts.
    """
    as_whole = any_rigid(scene.stops) and scene.replay is None
    ladder = _Ladder(recorded if as_whole else scene, finest)
    best = ladder.finest()
    if best is None:
        return []
    ways, seen = [], {_sizes(best)}
    for residual in (False, True):
        for count in ladder.counts():
            one = ladder.scene_of(count, residual)
            if one is None or _sizes(one) in seen:
                continue
            seen.add(_sizes(one))
            name = "residual vectors" if residual else "modes"
            most = max(size for size, _ in _sizes(one))
            ways.append(way_by_scene(name, "modes", min(count, most), one, {}, model=True))
    own = ladder.scene
    if _sizes(own) not in seen:
        ways.append(way_by_scene("modes of the scene", "", math.nan, own, {}, model=True))
    return [_against(way, best, own, as_whole=as_whole) for way in ways]


def _against(way: Way, best: Scene, own: Scene, *, as_whole: bool) -> Way:
    """Return a way whose errors are measured against the most modes."""
    assert way.scene is not None
    opener = _opens_with_extremes(way.scene) if as_whole else way.open
    is_own = _sizes(way.scene) == _sizes(own)
    return replace(way, open=opener, as_whole=as_whole, against=best, is_own_model=is_own)


def _opens_with_extremes(scene: Scene) -> Opener:
    def opened(wrap: Wrapper | None, part: float = 1.0) -> Trial:
        return opened_with_extremes(scene, part, wrap)

    return opened


def opened_with_extremes(scene: Scene, part: float, wrap: Wrapper | None = None) -> Trial:
    """Open a scene with its own settings so that it has a range without forcing, too, whose runs have no extremes."""
    return opened_part(scene, part, wrap) if scene.period is not None else DrivenTrial(scene, part, wrap)


def _sizes(scene: Scene) -> tuple[tuple[int, int], ...]:
    """Return the number of modes of each body, and of residual vectors among them; 1 for those of a beam."""
    body: Any = scene.body
    given = (
        part.origin.residual_vectors if _is_given(part) else part.has_residual_vectors for part in body.parts
    )
    return tuple((part.size, int(vectors)) for part, vectors in zip(body.parts, given, strict=True))


def _is_given(part: Any) -> bool:
    return isinstance(part, ModesBody) and part.origin is not None


class _Ladder:
    """The bodies of a scene with other numbers of modes."""

    def __init__(self, scene: Scene, finest: Mapping[int, Modes]) -> None:
        self.scene, self._document = scene, parse_toml(scene.text)
        body: Any = scene.body
        written = self._document["body"]
        self._tables: list[dict[str, Any]] = written if isinstance(written, list) else [written]
        self._names: tuple[str, ...] = body.names
        self._is_alone = not isinstance(written, list)
        self._given: dict[int, Modes] = {}
        self._beams: dict[int, int] = {}
        rigid = any_rigid(scene.stops)
        for place, part in enumerate(body.parts):
            if isinstance(part, ModesBody):
                self._given[place] = finest.get(place) or part.given_modes()
            elif part.kind == "beam":
                self._beams[place] = part.size * (1 if rigid else FINER_BEAM)
        room = MOST_MODES - sum(len(each.natural) for each in self._given.values())
        room -= sum(part.size for place, part in enumerate(body.parts) if not self._has_modes(place))
        if sum(self._beams.values()) > room:
            self._beams = {place: body.parts[place].size for place in self._beams}
        self._own = {body.parts[place].size for place in (*self._given, *self._beams)}

    def _has_modes(self, place: int) -> bool:
        return place in self._given or place in self._beams

    def counts(self) -> list[int]:
        """Return the numbers of modes of a body to try, ascending."""
        most = max([len(each.natural) for each in self._given.values()] + list(self._beams.values()))
        return sorted({count for count in MODES_TRIED if count < most} | self._own | {most})

    def finest(self) -> Scene | None:
        """Return the scene with the most modes; None where no body has modes."""
        if not self._given and not self._beams:
            return None
        given = {place: Truncation(modes, np.eye(len(modes.natural))) for place, modes in self._given.items()}
        return self._with(given, self._beams, residual=True)

    def scene_of(self, count: int, residual: bool) -> Scene | None:
        """Return the scene with a number of modes of each body; None where some body cannot have it."""
        given = {}
        for place, modes in self._given.items():
            points = [
                name for name in points_named(self._document, self._names[place]) if name in modes.shapes
            ]
            size = min(count, len(modes.natural))
            found = truncated(modes, dict.fromkeys(points or modes.shapes), size, residual=residual)
            if found is None:
                return None
            given[place] = found
        beams = {place: min(count, most) for place, most in self._beams.items()}
        return self._with(given, beams, residual=residual)

    def _with(
        self, given: Mapping[int, Truncation], beams: Mapping[int, int], *, residual: bool
    ) -> Scene | None:
        """Return the scene with these modes, and with residual vectors of a beam alone; None where it is invalid."""
        tables = [dict(table) for table in self._tables]
        for place, each in given.items():
            tables[place] = dict(_table(tables[place], each))
        for place, count in beams.items():
            tables[place] |= {"modes": count} | ({"residual": residual} if self._is_alone else {})
        document = {**self._document, "body": tables[0] if self._is_alone else tables}
        try:
            return Scene.from_dict(document, self.scene.source)
        except SceneError:
            return None


def _table(own: Mapping[str, Any], found: Truncation) -> Iterator[tuple[str, Any]]:
    """Yield the table of a body with other modes, with its name and its start in them."""
    if "name" in own:
        yield "name", own["name"]
    table = found.modes.table()
    ratios = found.modes.damping_ratios
    yield from (table | {"damping_ratio": float(ratios[0])} if (ratios == ratios[0]).all() else table).items()
    for key in START:
        if key in own:
            start = np.zeros(len(found.weights))
            start[: min(len(own[key]), len(start))] = own[key][: len(start)]
            yield key, (start @ found.weights).tolist()
