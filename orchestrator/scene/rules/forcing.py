"""Rules of forces: their kinds and places on a body, frequencies, numbers, and what only one sine can have."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from vibroimpact.orchestrator.scene.body_models import Body, ModesBody
from vibroimpact.orchestrator.scene.draft import FREQUENCY_KEYS, Draft
from vibroimpact.orchestrator.scene.forcing_models import (
    MOST_CONSTANTS,
    MOST_SINES,
    ConstantForcing,
    Force,
    Forcing,
)
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted
from vibroimpact.orchestrator.scene.rules.body import ALONE, fixed_point_problems, keys_left_out, size_problem
from vibroimpact.orchestrator.scene.rules.signals import signal_problems

_MOST = {"sine": MOST_SINES, "constant": MOST_CONSTANTS}


class _Read(NamedTuple):
    """A valid force with its key and its table as written."""

    key: str
    force: Force
    written: Mapping[str, Any]


def _valid(draft: Draft) -> Iterator[_Read]:
    for key, force, written in draft.written_forces():
        if force is not None:
            yield _Read(key, force, written)


# ---- kinds, amplitudes and places ----


def forces_suit_the_body(draft: Draft) -> Iterator[Problem]:
    """The kind of each force, and its number of amplitudes, are possible for the body."""
    for each in _valid(draft):
        if draft.is_structure:
            yield from _in_a_structure(draft, each)
        elif draft.body is not None:
            yield from _on_one_body(draft, draft.body, each)


def _on_one_body(draft: Draft, body: Body, each: _Read) -> Iterator[Problem]:
    key, force, _ = each
    if force.kind not in body.FORCINGS:
        expected = f'"force" or "base_acceleration" for {body.NAME}'
        yield Problem(f"{key}.kind", expected, quoted(force.kind), "It is a load of a beam.")
        return
    if force.at is not None:
        hint = f"{body.PLACE_HINT or 'Remove at.'}".replace(
            "Say which mass by mass.", "Give amplitude an array."
        )
        yield Problem(f"{key}.at", "at for several bodies", f"it beside {body.NAME}", hint)
    yield from _amplitude_problems(body, each)
    yield from _place_problems(draft, body, each)


def _amplitude_problems(body: Body, each: _Read) -> Iterator[Problem]:
    where, amplitude = f"{each.key}.amplitude", each.force.amplitude
    if each.force.kind in body.AMPLITUDES:
        if isinstance(amplitude, tuple):
            yield from size_problem(where, amplitude, body.size, "mass")
        elif body.size > 1:
            expected = f"an array of {body.size}, one amplitude for each mass"
            hint = f"A force on the last mass alone: amplitude = {[0] * (body.size - 1) + [1]}."
            hint = hint if body.size <= 4 else "Write 0 for each mass that is not forced."
            yield Problem(where, expected, quoted(amplitude), hint)
    elif isinstance(amplitude, tuple):
        what = f"{body.NAME} under {each.force.kind}"
        got = f"an array of {len(amplitude)}"
        yield Problem(where, f"one number for {what}", got, "Write the number alone.")


def _place_problems(draft: Draft, body: Body, each: _Read) -> Iterator[Problem]:
    """Yield the problems of `location` and `mode`, each of which belongs to one kind of load of a beam."""
    owner, force, written = each
    for key, kind in (("location", "force"), ("mode", "mode")):
        belongs = body.FORCING_KEYS.get(key) == force.kind
        if key in written and not belongs:
            got = f"it beside {body.NAME} under {force.kind}"
            yield Problem(f"{owner}.{key}", f'{key} for a beam with kind = "{kind}"', got, f"Remove {key}.")
    if not body.FORCING_KEYS:
        return
    if force.kind == "force":
        yield from fixed_point_problems(f"{owner}.location", body, draft.span(f"{owner}.location"))
    elif force.kind == "mode" and not 1 <= (force.mode or 0) <= body.size:
        hint = "The load has the shape of this mode."
        hint = hint if force.mode else f"Add mode = ... to [forcing]. {hint}"
        expected = f"a mode of the beam, 1 to {body.size}"
        yield Problem(f"{owner}.mode", expected, quoted(force.mode), hint)


def _in_a_structure(draft: Draft, each: _Read) -> Iterator[Problem]:
    """Yield the problems of a force on several bodies, besides those of its point."""
    key, force, written = each
    if force.kind not in ("force", "base_acceleration"):
        hint = "It is a load of one beam."
        yield Problem(
            f"{key}.kind", '"force" or "base_acceleration" beside [[body]]', quoted(force.kind), hint
        )
    elif force.kind == "force" and force.at is None:
        hint = f'For example at = "{draft.names[0]}".' if draft.names else ""
        yield Problem(f"{key}.at", "the point where the force acts", "nothing", hint)
    elif force.kind == "base_acceleration" and force.at is not None:
        yield Problem(
            f"{key}.at", 'it with kind = "force"', "it with base_acceleration", "The base moves all bodies."
        )
    elif force.kind == "base_acceleration":
        yield from base_moves_given_modes(draft)
    if isinstance(force.amplitude, tuple):
        got = f"an array of {len(force.amplitude)}"
        yield Problem(f"{key}.amplitude", "one number beside [[body]]", got, "Write the number alone.")
    for name in ("location", "mode"):
        if name in written:
            yield Problem(f"{key}.{name}", f"{name} {ALONE}", "it beside [[body]]", f"Remove {name}.")


def base_moves_given_modes(draft: Draft) -> Iterator[Problem]:
    """Given modes have their participation beside a base that moves."""
    for number, part in enumerate(draft.parts, start=1):
        if isinstance(part.body, ModesBody) and not part.body.participation:
            where = f"body[{number}].participation"
            hint = "It is phi' M r for 1 m of the base; a body by matrices has it by its key base."
            yield Problem(where, "it beside base_acceleration", "nothing", hint)


# ---- frequencies ----


def _frequency_is_given_once(draft: Draft) -> Iterator[Problem]:
    for key, _, written in draft.written_forces():
        if written.get("signal", "sine") != "sine":
            continue
        given = FREQUENCY_KEYS & written.keys()
        if len(given) == 2:
            expected = "angular_frequency (rad/s) or frequency (Hz)"
            yield Problem(f"{key}.frequency", expected, "both", f"Remove one{draft.swept_counts}.")
        if not given and written:
            hint = "Add angular_frequency = ... to [forcing], in rad/s; 0 makes a constant force."
            if draft.has_several_forces:
                hint = 'Add angular_frequency = ..., in rad/s, or signal = "constant".'
            yield Problem(f"{key}.angular_frequency", "a number >= 0", "nothing", hint)


def _units_agree(draft: Draft) -> Iterator[Problem]:
    if not draft.header or draft.header.units != "nondimensional":
        return
    for key, force, written in draft.written_forces():
        if "frequency" in written and isinstance(force, Forcing):
            hint = 'Hz is an SI unit: give angular_frequency in radians per unit of time, or units = "SI".'
            yield Problem(f"{key}.frequency", "no frequency in Hz in a nondimensional scene", "one", hint)


# ---- several forces ----


def _several_forces(draft: Draft) -> Iterator[Problem]:
    """Forces that the component Structure has: their numbers, their sines, and what is simulated with one sine."""
    if draft.has_moving_stops and not draft.has_several_forces and not draft.is_structure:
        yield from _keys_of_one_sine(draft, "it beside a moving stop")
    if not draft.has_several_forces:
        return
    for rule in (_numbers_are_few, _sines_have_periods, _forces_have_room, signal_problems):
        yield from rule(draft)
    if not draft.is_structure:
        several = "it beside several forces" if len(draft.forces) > 1 else "it beside a force that is no sine"
        yield from _keys_of_one_sine(draft, several)


def _numbers_are_few(draft: Draft) -> Iterator[Problem]:
    counts = Counter(str(each.force.signal) for each in _valid(draft))
    for signal, most in _MOST.items():
        if counts[signal] > most:
            yield Problem("forcing", f"at most {most} forces of signal {quoted(signal)}", f"{counts[signal]}")


def _sines_have_periods(draft: Draft) -> Iterator[Problem]:
    for key, force, written in _valid(draft):
        span = draft.frequency_span(key) if isinstance(force, Forcing) else None
        if span is not None and span[0] == 0.0:
            name = "frequency" if "frequency" in written else "angular_frequency"
            hint = 'Use signal = "constant" for a force that does not change.'
            yield Problem(f"{key}.{name}", "a number > 0 among several forces", "0", hint)


def _forces_have_room(draft: Draft) -> Iterator[Problem]:
    """The FMU has room for the clock and 15 forces; the clock is the first sine or the common period of all."""
    clock, sines = draft.clock, sum(isinstance(each.force, Forcing) for each in _valid(draft))
    first = clock is not None and clock.periods == 1
    constants = sum(isinstance(each.force, ConstantForcing) for each in _valid(draft))
    most = MOST_SINES - 1 + first
    if sines + constants > most and sines <= MOST_SINES and constants <= MOST_CONSTANTS:
        hint = (
            f"The common period has {clock.periods} periods of the first sine." if clock and not first else ""
        )
        yield Problem("forcing", f"at most {most} sines and constants in all", f"{sines + constants}", hint)


def _keys_of_one_sine(draft: Draft, several: str) -> Iterator[Problem]:
    """Yield the tables and keys of one body that only a force of one sine, and stops that stand still, go with."""
    beside = "beside [forcing] with one sine"
    for name in ("sensor", *CHAIN_TABLES, "replay"):
        if name in draft.document:
            yield Problem(name, f"[{name}] {beside}", several, "Remove it, or all forces but one sine.")
    if draft.written("execution").get("how") == "coupled":
        hint = "They are in one FMU, with all contacts inside."
        expected = f'"auto" or "fused" {several.removeprefix("it ")}'
        yield Problem("execution.how", expected, '"coupled"', hint)
    for key in keys_left_out(draft):
        if key != "observed_mass":
            yield Problem(f"body.{key}", f"{key} {beside}", several, f"Remove {key}.")
    for axis in draft.axes:
        if (
            axis.continuation
            and draft.simulated_body is not None
            and draft.simulated_body.is_shaping(axis.key)
        ):
            where = key_path(("sweep", axis.key, "path"))
            hint = "The state that a continuation carries is of the modes, which this number changes."
            yield Problem(where, '"independent" beside several forces', "a continuation", hint)
        if axis.key == "body.modes":
            yield Problem(
                key_path(("sweep", axis.key)), f"modes {beside}", several, "Fix the number of modes."
            )


FORCING_RULES = (
    forces_suit_the_body,
    _frequency_is_given_once,
    _units_agree,
    _several_forces,
)
