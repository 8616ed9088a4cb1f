"""Rules of stops: their places on the body, room for motion, and a start on their free side."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import combinations, pairwise

from vibroimpact.orchestrator.scene.body_models import BODY_MODELS, Body, StructureBody
from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.laws import LAWS
from vibroimpact.orchestrator.scene.models import LAWS_THAT_YIELD, OwnStop, Stop
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted
from vibroimpact.orchestrator.scene.rules.body import fixed_point_problems


def stops_are_few(draft: Draft) -> Iterator[Problem]:
    """The number of stops is at most the number of contact ports of the body."""
    most = _most_stops(draft)
    if len(draft.stops) > most:
        yield Problem("stop", f"at most {most} stops", str(len(draft.stops)), "Remove [[stop]] tables.")


def _most_stops(draft: Draft) -> int:
    kind = str(draft.written("body").get("kind", "oscillator"))
    return BODY_MODELS.get(kind, BODY_MODELS["oscillator"]).MOST_STOPS


def stops_are_on_the_body(draft: Draft) -> Iterator[Problem]:
    """A stop limits a mass of a chain, or a moving point of a beam."""
    if draft.body is None:
        return
    for number, stop in enumerate(draft.stops, start=1):
        if stop is not None:
            yield from _place_problems(draft, draft.body, stop, f"stop[{number}]")


def _place_problems(draft: Draft, body: Body, stop: Stop, where: str) -> Iterator[Problem]:
    for key, owner in (("mass", "a chain"), ("location", "a beam"), ("at", "several bodies")):
        if getattr(stop, key) is not None and key != body.PLACE:
            hint = body.PLACE_HINT or f"Remove {key}."
            yield Problem(f"{where}.{key}", f"{key} for {owner}", f"it beside {body.NAME}", hint)
    if body.PLACE == "mass" and body.place_of(stop) > body.size:
        expected = f"a mass of the chain, 1 to {body.size}"
        yield Problem(f"{where}.mass", expected, str(stop.mass), "Masses count from the ground.")
    span = draft.span(f"{where}.location")
    if span is None and body.fixed_end:
        hint = f"Add location = ... to [[stop]]: {body.fixed_end}."
        yield Problem(f"{where}.location", "a number between 0 and 1", "nothing", hint)
    if span is not None:
        yield from fixed_point_problems(f"{where}.location", body, span)


def stops_leave_room(draft: Draft) -> Iterator[Problem]:
    """Two stops at one place are above and below the motion with room between them, or the nearer one is compliant."""
    if draft.body is None or len(draft.stops) > _most_stops(draft):
        return
    for first, second in combinations(range(len(draft.stops)), 2):
        one, other = draft.stops[first], draft.stops[second]
        if one is None or other is None or draft.body.place_of(one) != draft.body.place_of(other):
            continue
        if one.moves or other.moves:
            continue  # a run ends where moving stops leave no room
        if one.side == other.side:
            yield from _same_side_problems(draft, first, second, one.side)
        else:
            upper, lower = (first, second) if one.side == "upper" else (second, first)
            yield from _room_problems(draft, upper, lower)


def _same_side_problems(draft: Draft, first: int, second: int, side: str) -> Iterator[Problem]:
    is_structure = draft.body is None or draft.body.IS_STRUCTURE
    if is_structure and not _hides(draft, first, second):
        return
    hint = "Motion never reaches the farther of two stops on one side: remove it."
    if is_structure:
        expected = f"another place or side than that of stop[{first + 1}]"
        got = f"two {side} stops at one place, the nearer one rigid"
    else:
        expected, got = "one upper and one lower stop", f"two {side} stops"
    yield Problem(f"stop[{second + 1}].side", expected, got, hint)


def _hides(draft: Draft, first: int, second: int) -> bool:
    """Return whether one of two stops on one side is rigid and, in the worst case, the nearer one."""
    for near, far in ((first, second), (second, first)):
        stop = draft.stops[near]
        if stop is None or not LAWS[stop.law].is_rigid:
            continue
        rigid, other = _position(draft, near), _position(draft, far)
        if rigid[0] <= other[1] if stop.side == "upper" else rigid[1] >= other[0]:
            return True
    return False


def _room_problems(draft: Draft, upper: int, lower: int) -> Iterator[Problem]:
    lowest_upper, highest_lower = _position(draft, upper)[0], _position(draft, lower)[1]
    if lowest_upper <= highest_lower:
        expected = f"the upper stop[{upper + 1}] above the lower stop[{lower + 1}]"
        got = f"upper {quoted(lowest_upper)} and lower {quoted(highest_lower)}{draft.worst('stop')}"
        yield Problem(
            f"stop[{upper + 1}].position", expected, got, "Leave room for motion between the stops."
        )


def _position(draft: Draft, index: int) -> tuple[float, float]:
    span = draft.span(f"stop[{index + 1}].position")
    assert span is not None
    return span


def start_is_on_the_free_side(draft: Draft) -> Iterator[Problem]:
    """The start is not beyond a rigid stop; a compliant stop may be pressed in.

    Only the FMU of a bent beam has the start displacement at a stop, so the FMU refuses a wrong start itself.
    """
    for index, stop in enumerate(draft.stops):
        if stop is None or not LAWS[stop.law].is_rigid:
            continue
        (key, start), shift = _start(draft, stop), start_shift(draft, index)
        if start is None or shift is None:
            continue
        upper = stop.side == "upper"
        limit, displacement = (
            (_position(draft, index)[0], start[1]) if upper else (_position(draft, index)[1], start[0])
        )
        limit += shift
        if displacement > limit if upper else displacement < limit:
            relation = "<=" if upper else ">="
            expected = (
                f"a start on the free side of stop[{index + 1}] (displacement {relation} {quoted(limit)})"
            )
            got = f"{quoted(displacement)}{draft.worst('stop', 'body.displacement_start')}"
            yield Problem(key, expected, got, "Start on the stop or away from it, or move the stop.")


def start_shift(draft: Draft, index: int) -> float | None:
    """Return the displacement of a stop from its position at time 0, m; None where only the FMU knows it."""
    stop = draft.stops[index]
    if stop is None or not stop.moves:
        return 0.0
    names = ("motion_amplitude", "motion_phase")
    spans = [draft.span(f"stop[{index + 1}].{name}") or (0.0, 0.0) for name in names]
    if stop.motion_times is not None or any(low != high for low, high in spans):
        return None
    (amplitude, _), (phase, _) = spans
    return amplitude * math.cos(phase)


def _start(draft: Draft, stop: Stop) -> tuple[str, tuple[float, float] | None]:
    """Return the key of the start displacement at a stop, and its lowest and highest value."""
    body, key = draft.body, "body.displacement_start"
    if body is None or isinstance(body, StructureBody):
        return key, None
    if body.IS_STRUCTURE and not body.displacement_start:
        return key, (0.0, 0.0)
    if body.PLACE == "location":
        return key, None
    key = f"{key}[{body.place_of(stop)}]" if body.PLACE else key
    return key, draft.span(key)


def motions_are_whole(draft: Draft) -> Iterator[Problem]:
    """A motion of a stop has its frequency, or a table with ascending instants; no run continues it."""
    for number, stop in enumerate(draft.stops, start=1):
        if stop is not None and stop.moves:
            yield from _sine_problems(draft, stop, f"stop[{number}]")
            yield from _table_problems(stop, f"stop[{number}]")
    drifting = next((number for number, stop in enumerate(draft.stops, start=1) if stop and stop.drifts), 0)
    for axis in draft.axes:
        if drifting and axis.continuation:
            hint = "It moves on from time 0, so that the end of a run is no start of the next."
            key = key_path(("sweep", axis.key, "path"))
            yield Problem(key, f'"independent" beside a stop[{drifting}] that drifts', "a continuation", hint)


def _sine_problems(draft: Draft, stop: OwnStop, where: str) -> Iterator[Problem]:
    amplitude = draft.span(f"{where}.motion_amplitude") or (0.0, 0.0)
    frequency = draft.span(f"{where}.motion_angular_frequency") or (0.0, 0.0)
    if any(amplitude) and frequency[0] == 0.0:
        hint = "The stop moves by motion_amplitude cos(motion_angular_frequency time + motion_phase)."
        yield Problem(f"{where}.motion_angular_frequency", "a number > 0 with a motion_amplitude", "0", hint)


def _table_problems(stop: OwnStop, where: str) -> Iterator[Problem]:
    times, values = stop.motion_times, stop.motion_values
    if times is None and values is None:
        return
    if times is None or values is None:
        missing = "motion_times" if times is None else "motion_values"
        yield Problem(f"{where}.{missing}", "an array of 2 numbers or more", "nothing", f"Add {missing}.")
        return
    if len(times) != len(values):
        got = f"{len(values)} beside {len(times)} motion_times"
        yield Problem(f"{where}.motion_values", "as many numbers as motion_times", got)
    for place, (before, after) in enumerate(pairwise(times), start=2):
        if after <= before:
            expected = f"more than the instant before, {quoted(before)}"
            yield Problem(f"{where}.motion_times[{place}]", expected, quoted(after))
            return


def a_surface_that_lags_is_fused(draft: Draft) -> Iterator[Problem]:
    """A stop with a relaxation time runs fused: its surface is a state of the body; an ImpactStop FMU has no state."""
    if draft.written("execution").get("how") != "coupled":
        return
    for number, stop in enumerate(draft.stops, start=1):
        key = f"stop[{number}].relaxation_time"
        if hasattr(stop, "relaxation_time") and (draft.span(key) or (0.0, 0.0))[1] > 0.0:
            hint = 'Run it fused: how = "fused", or relaxation_time = 0.'
            yield Problem(key, 'a surface that relaxes at once beside how = "coupled"', "a time", hint)


def residual_vectors_have_stops_that_yield(draft: Draft) -> Iterator[Problem]:
    """Residual vectors need compliant stops, and more modes than places of stops.

    A rigid stop meets the contact mass of all modes, which falls to 0 with their number: equations.md 6.6.
    """
    body = draft.body
    if body is None or not body.has_residual_vectors:
        return
    stops = [stop for stop in draft.stops if stop is not None]
    for number, stop in enumerate(draft.stops, start=1):
        if stop is not None and LAWS[stop.law].is_rigid:
            hint = f"Use law = {LAWS_THAT_YIELD}."
            yield Problem(
                f"stop[{number}].law", "a stop that yields beside residual = true", "a rigid one", hint
            )
    places = len({body.place_of(stop) for stop in stops})
    span = draft.span("body.modes")
    fewest = body.size if span is None else int(span[0])
    if fewest <= places:
        expected = f"more than {places}: one for each place of a stop, and natural ones before them"
        yield Problem("body.modes", expected, f"{fewest} beside residual = true", "Use more modes.")
    elif draft.forcing is not None and (draft.forcing.mode or 0) > fewest - places:
        expected = f"a natural mode, 1 to {fewest - places}"
        hint = f"The last {places} of the {fewest} are residual vectors."
        yield Problem("forcing.mode", expected, quoted(draft.forcing.mode), hint)


def modes_that_are_found_converge(draft: Draft) -> Iterator[Problem]:
    """`modes = "auto"` needs a tolerance, and on a beam compliant stops: nothing converges at a rigid stop.

    The contact mass at a rigid stop falls as 1 / modes: equations.md 6.6.
    """
    body = draft.body
    if body is None or not body.finds_modes:
        return
    for number, stop in enumerate(draft.stops, start=1):
        if stop is not None and LAWS[stop.law].is_rigid and not body.HAS_MASSES:
            hint = (
                f"The mass that a rigid stop meets falls as 1 / modes: use law = {LAWS_THAT_YIELD}, or say how many "
                "modes."
            )
            yield Problem(
                f"stop[{number}].law", 'a stop that yields beside modes = "auto"', "a rigid one", hint
            )
    if draft.execution is not None and draft.execution.tolerance is None:
        hint = "Add tolerance = 1e-3 to [execution]: the relative error of what is recorded."
        yield Problem("execution.tolerance", 'a number beside modes = "auto"', "nothing", hint)


STOP_RULES = (
    stops_are_few,
    stops_are_on_the_body,
    stops_leave_room,
    start_is_on_the_free_side,
    motions_are_whole,
    a_surface_that_lags_is_fused,
    residual_vectors_have_stops_that_yield,
    modes_that_are_found_converge,
)
