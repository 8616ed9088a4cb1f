"""Rules between the fields and tables of a scene; each rule yields its problems.

A rule checks only parts that are valid by themselves, so that one mistake is reported once. Swept keys count with
their lowest and highest value. The axes of a sweep span all combinations, so a rule that holds at the worst corner
holds everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.keys import CHAIN_TABLES, MODES, START_STATE
from vibroimpact.orchestrator.scene.models import MOST_SAMPLES_PER_RUN
from vibroimpact.orchestrator.scene.problems import Problem, key_path, quoted
from vibroimpact.orchestrator.scene.rules.body import (
    BODY_RULES,
    arrays_have_one_size,
    beam_is_given_once,
    modes_are_whole,
    sampled_variables_are_known,
)
from vibroimpact.orchestrator.scene.rules.forcing import FORCING_RULES
from vibroimpact.orchestrator.scene.rules.stop import STOP_RULES
from vibroimpact.orchestrator.scene.sweep import SweepAxis, run_count

MOST_POINTS = 10**9
PERIOD_KEYS = ("transient_periods", "recorded_periods")
TIME_KEYS = ("transient_time", "recorded_time")
COUPLING_KEYS = ("macro_step", "exchange", "guard")
ADAPTIVE_HINT = "Only a scene of components has steps that an error estimate chooses."
DraftRule = Callable[[Draft], Iterator[Problem]]


def rule_problems(draft: Draft) -> list[Problem]:
    """Return all problems between the tables of a scene."""
    rules = (
        *(_several_bodies(draft) if draft.is_structure else _of_one_body()),
        *FORCING_RULES,
        *_recording_rules(draft),
        _record_counts_what_there_is,
        _samples_fit,
        *((_adaptive_axes_can_tell_motions,) if draft.axes else ()),
        _coupling_is_asked_for,
    )
    problems = [problem for rule in rules for problem in rule(draft)]
    return [*problems, *sweep_problems(draft.axes)] if draft.axes else problems


def _of_one_body() -> Iterator[DraftRule]:
    yield from (*_DAMPING_RULES, *BODY_RULES, *STOP_RULES, _several_points_are_observed)


def _several_bodies(draft: Draft) -> Iterator[DraftRule]:
    """Yield the rules of several bodies, imported only for scenes with them."""
    from vibroimpact.orchestrator.scene.rules.structure import part_problems, structure_problems

    yield partial(
        part_problems, rules=(*_DAMPING_RULES, arrays_have_one_size, modes_are_whole, beam_is_given_once)
    )
    yield structure_problems
    yield sampled_variables_are_known


def _recording_rules(draft: Draft) -> Iterator[DraftRule]:
    """Yield the rules of a measuring chain, of a time series and of a replay, imported only for scenes with them."""
    measures = draft.channels or not draft.document.keys().isdisjoint(("sensor", *CHAIN_TABLES))
    if measures and not draft.is_structure:
        from vibroimpact.orchestrator.scene.rules.measuring import MEASURING_RULES

        yield from MEASURING_RULES
    yield _time_series_has_a_rate
    if draft.replay is not None:
        from vibroimpact.orchestrator.scene.rules.replay import REPLAY_RULES

        yield from REPLAY_RULES


def _coupling_is_asked_for(draft: Draft) -> Iterator[Problem]:
    execution = draft.written("execution")
    if execution.get("macro_step") == "auto":
        yield Problem("execution.macro_step", "a number in a scene of one body", '"auto"', ADAPTIVE_HINT)
    if "coupling_tolerance" in execution:
        got = quoted(execution["coupling_tolerance"])
        expected = "no coupling_tolerance in a scene of one body"
        yield Problem("execution.coupling_tolerance", expected, got, ADAPTIVE_HINT)
    how = execution.get("how", "auto")
    if how not in ("auto", "fused"):
        return
    for key in COUPLING_KEYS:
        if key in execution:
            hint = f'Remove {key}, or run the scene coupled: how = "coupled".'
            yield Problem(f"execution.{key}", 'how = "coupled" beside it', f"how = {quoted(how)}", hint)


def _damping_is_given_once(draft: Draft) -> Iterator[Problem]:
    body = draft.written("body")
    if body.get("kind", "oscillator") == "oscillator" and {"damping", "damping_ratio"} <= body.keys():
        yield Problem("body.damping", "damping or damping_ratio", "both", f"Remove one{draft.swept_counts}.")


def _damping_ratio_has_a_spring(draft: Draft) -> Iterator[Problem]:
    body, stiffness = draft.body, draft.span("body.stiffness")
    ratio = getattr(body, "damping_ratio", None)
    if ratio is not None and stiffness and stiffness[0] <= 0.0:
        hint = "The ratio is to 2 sqrt(stiffness mass); give damping instead."
        yield Problem(
            "body.damping_ratio",
            "a stiffness > 0 beside a damping_ratio",
            f"a stiffness of {stiffness[0]:g}",
            hint,
        )


def _several_points_are_observed(draft: Draft) -> Iterator[Problem]:
    if draft.record is not None and draft.record.observed:
        hint = "A scene of one body observes the point of its stop, observed_mass, or [sensor]."
        yield Problem("record.observed", "several bodies beside it", "one body", hint)


_DAMPING_RULES: tuple[DraftRule, ...] = (_damping_is_given_once, _damping_ratio_has_a_spring)


def _time_series_has_a_rate(draft: Draft) -> Iterator[Problem]:
    series = draft.record.time_series if draft.record else None
    if series is not None and series.rate is None and not draft.samples_channels:
        hint = "Add rate = ..., in samples per unit of time."
        yield Problem("record.time_series.rate", "a number > 0", "nothing", hint)


def _record_counts_what_there_is(draft: Draft) -> Iterator[Problem]:
    span = draft.angular_frequency_span()
    if span is None:
        return
    if span[0] == 0.0 < span[1] and not draft.has_several_forces:
        hint = "A constant force has no period to count; run it as a scene of its own."
        yield Problem("sweep", "frequencies that are all > 0, or all 0", "0 among others", hint)
        return
    if "replay" in draft.document:
        return  # the recording gives the duration: see rules.replay
    forced = span[1] > 0.0
    right, wrong = (PERIOD_KEYS, TIME_KEYS) if forced else (TIME_KEYS, PERIOD_KEYS)
    yield from _wrong_durations(draft, right, wrong, forced)
    yield from _missing_duration(draft, right[1], wrong[1])


def _missing_duration(draft: Draft, right: str, wrong: str) -> Iterator[Problem]:
    raw = draft.document.get("record")
    if raw is None and "body" not in draft.document:
        return  # a file without the main table has only that problem
    if raw is None or (isinstance(raw, dict) and right not in raw and wrong not in raw):
        unit = "a whole number of forcing periods" if right in PERIOD_KEYS else "a number > 0 (time)"
        yield Problem(f"record.{right}", unit, "nothing", f"Add {right} = ... to [record].")


def _wrong_durations(
    draft: Draft, right: tuple[str, ...], wrong: tuple[str, ...], forced: bool
) -> Iterator[Problem]:
    reason = "A forced scene counts forcing periods" if forced else "A scene without a period counts time"
    for key, instead in zip(wrong, right, strict=True):
        value = draft.written("record").get(key)
        if value is not None:
            scene = "a forced scene" if forced else "an unforced scene"
            yield Problem(
                f"record.{key}",
                f"{instead} in {scene}",
                f"{key} = {quoted(value)}",
                f"{reason}: give {instead}.",
            )


def _samples_fit(draft: Draft) -> Iterator[Problem]:
    span = draft.angular_frequency_span()
    rate = draft.sampling_span()
    if span is None or draft.record is None or rate is None:
        return
    forced = span[0] > 0.0
    duration = (
        draft.record.recorded_periods * 2.0 * math.pi / span[0] if forced else draft.record.recorded_time
    )
    key = "daq.rate" if draft.samples_channels else "record.time_series.rate"
    yield from sample_problems(key, rate[1] * duration, "periods" if forced else "time")


def _adaptive_axes_can_tell_motions(draft: Draft) -> Iterator[Problem]:
    if draft.record is None or all(axis.adaptive is None for axis in draft.axes):
        return
    record, beside = draft.record, "beside an adaptive axis"
    of_periods = bool(record.recorded_periods) and (record.extrema or record.strobe)
    clock = draft.clock
    if clock is not None and not clock.is_common:
        hint = "Motions are told by how they repeat from period to period."
        got = "sines without one"
        yield Problem("sweep", "a common period of all sines beside an adaptive axis", got, hint)
    elif not (record.impacts or of_periods):
        hint = "Without them nothing but outcomes is compared."
        yield Problem(
            "record", f"impacts, or the extrema or strobe of periods, {beside}", "none of them", hint
        )
    elif of_periods and not record.each_period:
        hint = "Motions are told by how they repeat from period to period: remove it."
        yield Problem("record.each_period", f"true {beside}", "false", hint)


def sample_problems(key: str, samples: float, recorded: str) -> Iterator[Problem]:
    """Yield the problem of a run with too many samples, in any form of scene."""
    if samples > MOST_SAMPLES_PER_RUN:
        expected = f"at most {MOST_SAMPLES_PER_RUN} samples per run"
        yield Problem(key, expected, f"{samples:.3g}", f"Lower the rate or the recorded {recorded}.")


def sweep_problems(axes: Sequence[SweepAxis]) -> Iterator[Problem]:
    """Yield the problems between the axes of a sweep, in any form of scene."""
    count = run_count(axes)
    if count > MOST_POINTS:
        yield Problem("sweep", f"at most {MOST_POINTS} points in all", str(count), "Lower points of an axis.")
    carried = [axis.key for axis in axes if axis.continuation]
    if len(carried) > 1:
        hint = 'Make the others "independent": they span the branches.'
        yield Problem("sweep", "at most one key with a path up, down or up-down", ", ".join(carried), hint)
    for key in carried:
        if key.endswith(START_STATE) or key.rpartition("[")[0].endswith(START_STATE):
            where = key_path(("sweep", key, "path"))
            hint = "Along a continuation each point starts from the state of the one before."
            yield Problem(where, '"independent" for a start state', "a continuation", hint)
        if key.startswith(("body[", "link[")):
            where = key_path(("sweep", key, "path"))
            hint = (
                "Such a number changes the modes, whose state a continuation carries: each point starts anew."
            )
            yield Problem(where, '"independent" for a number of several bodies', "a continuation", hint)
        if key == MODES:
            hint = "The state of some modes is none of more or fewer: each point starts anew."
            yield Problem(key_path(("sweep", key, "path")), '"independent" for modes', "a continuation", hint)
