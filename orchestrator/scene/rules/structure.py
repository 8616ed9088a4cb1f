"""Rules of several bodies: their points, links and contacts, what they cannot have, and a start on the free side."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from vibroimpact.orchestrator.scene.body_models import ModesBody, StructureBody
from vibroimpact.orchestrator.scene.body_models.base import NoPoint
from vibroimpact.orchestrator.scene.body_models.points import (
    ALL,
    GROUND,
    OneBody,
    PointOfBody,
    find_point,
)
from vibroimpact.orchestrator.scene.body_models.structure import (
    MOST_LINKS,
    label_of,
)
from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import MOST_MODES
from vibroimpact.orchestrator.scene.problems import KeyPath, Problem, key_path, quoted
from vibroimpact.orchestrator.scene.rules.body import ALONE, keys_left_out
from vibroimpact.orchestrator.scene.rules.stop import is_beyond, motions_are_whole, start_shift
from vibroimpact.orchestrator.scene.several_bodies import of_part

Span = tuple[float, float]


def structure_problems(draft: Draft) -> Iterator[Problem]:
    """Yield the problems between the tables of several bodies; of their points only if the bodies are valid."""
    yield from _tables_of_one_body(draft)
    yield from _keys_of_one_body(draft)
    yield from motions_are_whole(draft)
    too_many = list(_counts_are_few(draft))
    yield from too_many
    if too_many or not isinstance(draft.body, StructureBody):
        return
    points = _Points(draft, draft.body)
    problems = list(points.problems())
    yield from problems
    if not problems:
        yield from list(_contacts_leave_room(draft, points)) or _start_is_on_the_free_side(draft, points)


# ---- what several bodies cannot have ----


def _tables_of_one_body(draft: Draft) -> Iterator[Problem]:
    reads = "replay" in draft.document  # gain and offset of what is compared
    for name in CHAIN_TABLES if reads else ("sensor", *CHAIN_TABLES):
        if name in draft.document:
            yield Problem(name, f"[{name}] {ALONE}", "one beside [[body]]", "Remove it, or run one [body].")
    if reads and "location" in draft.written("sensor"):
        hint = "Observe its point: observed = [...] in [record]."
        yield Problem("sensor.location", f"location {ALONE}", "it beside [[body]]", hint)
    if draft.written("execution").get("how") == "coupled":
        hint = "Several bodies are one FMU, with all of their contacts inside."
        yield Problem("execution.how", '"auto" or "fused" beside [[body]]', '"coupled"', hint)


def _keys_of_one_body(draft: Draft) -> Iterator[Problem]:
    for number, part in enumerate(draft.parts, start=1):
        keeps_modes = part.body is not None and part.body.KEEPS_MODES and part.body.IS_STRUCTURE
        for key in keys_left_out(part):
            where = f"body[{number}].{key}"
            if key == "modes" and keeps_modes:
                yield Problem(
                    where,
                    f"a number of modes, 1 to {MOST_MODES}",
                    '"auto"',
                    "It is found for one body alone.",
                )
            else:
                yield Problem(where, f"{key} {ALONE}", "it beside [[body]]", f"Remove {key}.")
    for number, stop in enumerate(draft.stops, start=1):
        for key in ("mass", "location"):
            if stop is not None and getattr(stop, key) is not None:
                hint = 'Say which point by at, such as at = "chain.2" or at = "beam.tip".'
                yield Problem(f"stop[{number}].{key}", f"{key} {ALONE}", "it beside [[body]]", hint)


def _counts_are_few(draft: Draft) -> Iterator[Problem]:
    if not draft.parts:
        yield Problem("body", "one [[body]] table or more", "none", "Add [[body]] with a name.")
    sizes = [part.body.size for part in draft.parts if part.body is not None and not part.finds_modes]
    if sum(sizes) > MOST_MODES:
        hint = "Each mass of an oscillator or a chain counts, and each mode of a beam."
        yield Problem("body", f"at most {MOST_MODES} modes in all", f"{sum(sizes)}", hint)
    contacts, most = len(draft.stops) + len(draft.meetings), StructureBody.MOST_STOPS
    observed = () if draft.record is None else draft.record.observed
    if contacts <= most < contacts + len(observed) - 1:
        got = f"{contacts} and {len(observed) - 1}"
        expected = f"at most {most} stops, contacts and observed points after the first in all"
        yield Problem("record.observed", expected, got, "Leave some of them out.")
    if contacts > most:
        yield Problem(
            "contact", f"at most {most} stops and contacts in all", f"{contacts}", "Remove some of them."
        )
    if len(draft.links) > MOST_LINKS:
        yield Problem("link", f"at most {MOST_LINKS} links", f"{len(draft.links)}", "Remove some of them.")


# ---- points ----


class _Limit(NamedTuple):
    """A stop or a contact: its key, its points in order, whether it is above, its law, its lowest and highest place."""

    key: str
    points: tuple[PointOfBody, ...]
    is_upper: bool
    is_rigid: bool
    span: Span
    moves: bool = False
    shift: float | None = 0.0


class _Points:
    """The points that the tables of a draft name."""

    def __init__(self, draft: Draft, body: StructureBody) -> None:
        self._draft, self._body = draft, body

    def _find(self, text: str) -> PointOfBody | NoPoint:
        return find_point(text, self._body.names, self._body.parts)

    def _problem(self, where: str, text: str) -> Iterator[Problem]:
        found = self._find(text)
        if isinstance(found, NoPoint):
            yield Problem(where, found.expected, quoted(text), found.hint)

    def problems(self) -> Iterator[Problem]:
        """Yield the problems of points that are not there, or that are the same."""
        draft = self._draft
        for place, link in enumerate(draft.links):
            if link is not None:
                yield from self._between(("link", place, "between"), link.between, GROUND)
        for place, contact in enumerate(draft.meetings):
            if contact is not None:
                yield from self._between(("contact", place, "between"), contact.between, "")
        for number, stop in enumerate(draft.stops, start=1):
            if stop is not None and stop.at is not None:
                yield from self._problem(f"stop[{number}].at", stop.at)
            elif stop is not None:
                hint = f'For example at = "{self._body.names[-1]}".'
                yield Problem(f"stop[{number}].at", "the point that it limits", "nothing", hint)
        for key, force, _ in draft.written_forces():
            if force is not None and force.at == ALL and ALL not in self._body.names:
                yield from self._all_masses(f"{key}.at")
            elif force is not None and force.at is not None:
                yield from self._problem(f"{key}.at", force.at)
        replay = self._draft.replay
        if replay is not None and replay.at is not None:
            yield from self._problem("replay.at", replay.at)
        yield from self._observed()

    def _all_masses(self, where: str) -> Iterator[Problem]:
        """Yield the problem of a force on all masses where a body has none of its own."""
        without = [
            f"{'beam' if part.PLACE == 'location' else 'modes'} {quoted(name)}"
            for name, part in zip(self._body.names, self._body.parts, strict=True)
            if not part.HAS_MASSES
        ]
        if without:
            hint = 'A base that moves loads all points: kind = "base_acceleration".'
            yield Problem(where, '"all" for oscillators and chains', f"it beside the {without[0]}", hint)

    def _observed(self) -> Iterator[Problem]:
        """Yield the problems of observed points: not there, the same twice in a pair, or listed twice."""
        for place, each in enumerate(self._body.observed):
            if isinstance(each, str):
                yield from self._problem(key_path(("record", "observed", place)), each)
            else:
                yield from self._between(("record", "observed", place), each, "")
        for each, times in Counter(map(label_of, self._body.observed)).items():
            if times > 1:
                yield Problem("record.observed", "each point once", f"{quoted(each)} {times} times")

    def _between(self, where: KeyPath, between: Sequence[str], fixed: str) -> Iterator[Problem]:
        wrong = [
            problem
            for end, text in enumerate(between)
            if text != fixed
            for problem in self._problem(key_path((*where, end)), text)
        ]
        if GROUND in between and not fixed:
            end = list(between).index(GROUND)
            hint = "A point alone moves against the ground."
            if where[0] == "contact":
                hint = "A stop limits a point against the ground: [[stop]] with at."
            wrong = [Problem(key_path((*where, end)), "a point of a body", quoted(GROUND), hint)]
        yield from wrong
        first, second = (None if text == fixed else self._find(text) for text in between)
        if not wrong and first == second:
            got = f"{quoted(between[0])} and {quoted(between[1])}"
            yield Problem(key_path(where), "two points that are not the same", got)
        elif not wrong and where[0] == "contact" and self._move_alike(first, second):
            got = f"{quoted(between[0])} and {quoted(between[1])}"
            yield Problem(key_path(where), "two points that move apart", got, "Their shapes are the same.")

    def _move_alike(self, first: PointOfBody | NoPoint | None, second: PointOfBody | NoPoint | None) -> bool:
        """Return whether two points of one body by its modes have the same shapes."""
        if not (
            isinstance(first, PointOfBody) and isinstance(second, PointOfBody) and first.body == second.body
        ):
            return False
        part = self._body.parts[first.body]
        if not isinstance(part, ModesBody):
            return False
        one, other = (part.shapes[part.points[int(point.place) - 1]] for point in (first, second))
        return one == other

    def limits(self) -> Iterator[_Limit]:
        """Yield stops and contacts, with the points of each contact in one order, if all points are there."""
        draft = self._draft
        for number, stop in enumerate(draft.stops, start=1):
            span = draft.span(f"stop[{number}].position")
            if stop is not None and stop.at is not None and span is not None:
                point = self._body.point(stop.at)
                yield _Limit(
                    f"stop[{number}]",
                    (point,),
                    stop.side == "upper",
                    LAWS[stop.law].is_rigid,
                    span,
                    stop.moves,
                    start_shift(draft, number - 1),
                )
        for number, contact in enumerate(draft.meetings, start=1):
            span = draft.span(f"contact[{number}].clearance")
            if contact is None or span is None:
                continue
            first, second = (self._body.point(text) for text in contact.between)
            key, is_rigid = f"contact[{number}]", LAWS[contact.law].is_rigid
            if first <= second:
                yield _Limit(key, (first, second), True, is_rigid, span)
            else:
                yield _Limit(key, (second, first), False, is_rigid, (-span[1], -span[0]))

    def start(self, point: PointOfBody) -> Span | None:
        """Return the lowest and highest start of a point; None where only its FMU knows it, and for a beam."""
        part: OneBody = self._body.parts[point.body]
        if part.KEEPS_MODES and part.IS_STRUCTURE:
            return None if part.displacement_start else (0.0, 0.0)
        key = f"body[{point.body + 1}].displacement_start"
        if not part.PLACE:
            return self._draft.span(key)
        return self._draft.span(f"{key}[{point.place}]") if part.displacement_start else (0.0, 0.0)


# ---- room and start ----


def _contacts_leave_room(draft: Draft, points: _Points) -> Iterator[Problem]:
    for one, other in combinations(points.limits(), 2):
        if one.points != other.points or one.moves or other.moves:
            continue
        if one.is_upper == other.is_upper:
            yield from _hidden(one, other)
            continue
        upper, lower = (one, other) if one.is_upper else (other, one)
        if upper.span[0] <= lower.span[1]:
            got = f"upper {quoted(upper.span[0])} and lower {quoted(lower.span[1])}{draft.worst('stop', 'contact')}"
            expected = f"room for motion between {one.key} and {other.key}"
            yield Problem(other.key, expected, got, "They limit one motion from above and from below.")


def _hidden(one: _Limit, other: _Limit) -> Iterator[Problem]:
    """Yield the problem of two limits on one side if the nearer one is rigid."""
    for near, far in ((one, other), (other, one)):
        is_nearer = near.span[0] <= far.span[1] if near.is_upper else near.span[1] >= far.span[0]
        if near.is_rigid and is_nearer:
            hint = "Motion never reaches the farther of two on one side: remove it."
            got = "two on one side, the nearer one rigid"
            yield Problem(other.key, f"another point or side than that of {one.key}", got, hint)
            return


def _start_is_on_the_free_side(draft: Draft, points: _Points) -> Iterator[Problem]:
    for limit in points.limits():
        spans = [points.start(point) for point in limit.points]
        if not limit.is_rigid or limit.shift is None or any(span is None for span in spans):
            continue
        known = [span for span in spans if span is not None]
        low, high = known[0] if len(known) == 1 else (known[0][0] - known[1][1], known[0][1] - known[1][0])
        bound, start = (limit.span[0], high) if limit.is_upper else (limit.span[1], low)
        bound += limit.shift
        if is_beyond(start, bound, limit.shift, upper=limit.is_upper):
            relation = "<=" if limit.is_upper else ">="
            expected = f"a start on the free side (displacement {relation} {quoted(bound)})"
            got = f"{quoted(start)}{draft.worst('stop', 'contact', 'body')}"
            yield Problem(limit.key, expected, got, "Start on it or away from it, or move it.")


def part_problems(draft: Draft, rules: Sequence[Callable[[Draft], Iterator[Problem]]]) -> Iterator[Problem]:
    """Yield the problems of each body by rules of one body, with its keys among several."""
    for number, part in enumerate(draft.parts, start=1):
        for rule in rules:
            yield from (of_part(number, problem) for problem in rule(part))
