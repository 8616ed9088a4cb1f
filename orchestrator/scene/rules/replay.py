"""Rules of `[replay]`: named channels, and known variables of the body."""

from __future__ import annotations

from collections.abc import Iterator

from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.problems import Problem, quoted
from vibroimpact.orchestrator.scene.rules.forcing import base_moves_given_modes
from vibroimpact.orchestrator.scene.sampled_names import sampled_names, variable_hint

SENSOR = "sensor."
_OWNERS = ("body.", "oscillator.", "chain.", "beam.")


def plain_variable(simulated: str) -> tuple[str, bool]:
    """Return the variable of a compared name, and whether it is a reading of `[sensor]`.

    Examples
    --------
    >>> plain_variable("beam.sensor.acceleration"), plain_variable("displacement")
    (('acceleration', True), ('displacement', False))
    """
    name = next(
        (simulated.removeprefix(owner) for owner in _OWNERS if simulated.startswith(owner)), simulated
    )
    return (name.removeprefix(SENSOR), True) if name.startswith(SENSOR) else (name, False)


def replay_has_something_to_do(draft: Draft) -> Iterator[Problem]:
    """A replay drives or compares, or both, and a drive has a channel."""
    replay = draft.replay
    assert replay is not None  # these rules are only for replays
    if replay.drive is None and not replay.compare:
        hint = 'Add drive = "base_acceleration" and from = "CHANNEL", or compare = [...].'
        yield Problem("replay", "something to drive or to compare", "neither", hint)
    if (replay.drive is None) != (replay.channel is None):
        key, other = ("from", "drive") if replay.channel is None else ("drive", "from")
        yield Problem(
            f"replay.{key}", f"{key} beside {other}", "nothing", f"Add {key} = ..., or remove {other}."
        )
    if replay.drive == "force" and draft.body is not None and "force" in draft.body.AMPLITUDES:
        hint = "A force on one mass is not replayed yet; the base's acceleration is."
        yield Problem("replay.drive", '"base_acceleration" for a chain', '"force"', hint)
    yield from _drive_reaches_the_bodies(draft)
    spans = [("replay.peaks", replay.peaks)] if replay.peaks is not None else []
    spans += [(f"replay.windows[{place}]", span) for place, span in enumerate(replay.windows, start=1)]
    for where, span in spans:
        if span[1] <= span[0]:
            yield Problem(
                where, "a span [start, stop] that ends after its start", f"{span[0]:g} to {span[1]:g}"
            )
    if replay.start is not None and replay.stop is not None and replay.stop <= replay.start:
        yield Problem("replay.stop", "a time after replay.start", quoted(replay.stop))


def _drive_reaches_the_bodies(draft: Draft) -> Iterator[Problem]:
    replay = draft.replay
    assert replay is not None
    if replay.drive == "base_acceleration":
        yield from base_moves_given_modes(draft)
    if draft.is_structure and replay.drive == "force" and replay.at is None:
        hint = "Several bodies, and given modes, have many points."
        yield Problem("replay.at", "the point where the force acts", "nothing", hint)
    elif replay.at is not None and (not draft.is_structure or replay.drive != "force"):
        expected = 'drive = "force" beside it, on several bodies or given modes'
        yield Problem("replay.at", expected, quoted(replay.at), "Remove it.")


def compared_variables_are_known(draft: Draft) -> Iterator[Problem]:
    """Each simulated name is a possible variable of a time series of this scene, and each pair occurs once."""
    if draft.body is None:
        return
    assert draft.replay is not None
    known = sampled_names(draft.body, len(draft.stops) + len(draft.meetings), draft.forces)
    seen: set[tuple[str, str]] = set()
    for place, compared in enumerate(draft.replay.compare, start=1):
        variable, is_reading = plain_variable(compared.simulated)
        where = f"replay.compare[{place}].simulated"
        if variable not in known:
            hint = variable_hint(variable, known)
            yield Problem(where, "a variable of the body", quoted(compared.simulated), hint)
        elif is_reading and draft.sensor is None and "sensor" not in draft.document:
            hint = "Add [sensor], or leave `sensor.` out of the name."
            yield Problem(where, "a scene with [sensor]", quoted(compared.simulated), hint)
        if (compared.simulated, compared.measured) in seen:
            yield Problem(f"replay.compare[{place}]", "each pair once", "it again", "Remove it.")
        seen.add((compared.simulated, compared.measured))


def no_record_beside_replay(draft: Draft) -> Iterator[Problem]:
    """A replay has no keys of `[record]` for duration and rate, which come from the recording."""
    for key in ("transient_periods", "recorded_periods", "transient_time", "recorded_time", "time_series"):
        if key in draft.written("record"):
            hint = "The recording says how long it lasts and at which rate; replay.start and stop cut it."
            yield Problem(f"record.{key}", "none beside [replay]", "one", hint)


REPLAY_RULES = (replay_has_something_to_do, compared_variables_are_known, no_record_beside_replay)
