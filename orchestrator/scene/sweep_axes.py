"""From the entries of `[sweep]` to its axes: ranges, lists, keys that move together, drawn and adaptive axes."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice, pairwise

from pydantic import ValidationError

from vibroimpact.analysis.dataset.schema import DRAW, RESERVED_NAMES, SCATTERED
from vibroimpact.orchestrator.scene.designs import (
    BALANCED,
    Quantile,
    drawn,
    has_probability,
    log_uniform,
    normal,
    uniform,
    unit_design,
)
from vibroimpact.orchestrator.scene.fields import listed
from vibroimpact.orchestrator.scene.problems import Problem, key_path, problems_of, quoted, read_table
from vibroimpact.orchestrator.scene.sweep import (
    MOST_LISTED,
    Adaptive,
    SpacedValues,
    SweepAxis,
    axis_of_range,
    dimensions,
    log_axis,
    run_count,
)
from vibroimpact.orchestrator.scene.sweep_models import AxisTable, SampleTable

FORMS = "{ start = 0.6, stop = 1.6, points = 401 } or { values = [0.6, 0.7] }"
SAMPLE = "sample"
"""The entry of `[sweep]` that is not a swept key."""
_SAMPLE_FORM = '{ design = "sobol", points = 256 }'
_MOST_ADAPTIVE = 2
_RANGE = ("start", "stop", "points")
_ENDS = {"uniform": ("low", "high"), "log-uniform": ("low", "high"), "normal": ("mean", "deviation")}
"""Required keys of each distribution."""


def read_axis_table(key: str, entry: object, problems: list[Problem]) -> AxisTable | None:
    """Return one entry of a sweep as its model; None for an invalid entry, whose problems are added to `problems`."""
    path = ("sweep", key)
    if not isinstance(entry, dict):
        problems.append(Problem(key_path(path), "a table", quoted(entry), f"Write {FORMS}."))
        return None
    try:
        table = AxisTable.model_validate(entry)
    except ValidationError as error:
        problems += problems_of(error, AxisTable, path)
        return None
    found = list(_form_problems(key, table))
    problems += found
    return None if found else table


def _form_problems(key: str, table: AxisTable) -> Iterator[Problem]:
    """Yield the problems of the combination of keys in an entry."""
    where = key_path(("sweep", key))
    forms = [name for name in ("values", "distribution") if getattr(table, name) is not None]
    given = [name for name in _RANGE if getattr(table, name) is not None]
    if table.distribution is None and (stray := [n for n in _MOMENTS if getattr(table, n) is not None]):
        yield Problem(
            where, "a distribution beside them", listed(stray, "and"), 'Say which: distribution = "normal".'
        )
    elif len(forms) > 1 or (forms and given):
        got = "both" if len(forms) == 1 and forms != ["distribution"] else listed([*forms, *given], "and")
        expected = (
            "start, stop and points, or values"
            if forms == ["values"]
            else "one of a range, values and a distribution"
        )
        advice = f"Remove values or {listed(given, 'and')}." if forms == ["values"] else "Remove the others."
        yield Problem(where, expected, got, advice)
    elif table.distribution is not None:
        yield from _distribution_problems(key, table)
    elif table.values is not None:
        if table.spacing != "linear":
            hint = "A list says its values itself: remove spacing."
            yield Problem(where, "a range beside spacing", "values", hint)
    else:
        yield from _range_problems(key, table, given)
    yield from _company_problems(key, table)


_MOMENTS = ("low", "high", "mean", "deviation")
_WIDEST = 10.0
"""Number of deviations from the mean that must be a finite distance; no value is drawn farther away."""


def _range_problems(key: str, table: AxisTable, given: Sequence[str]) -> Iterator[Problem]:
    where = key_path(("sweep", key))
    if table.start is None or table.stop is None or table.points is None:
        missing = [name for name in _RANGE if name not in given]
        yield Problem(where, FORMS, listed(given, "and") or "neither", f"Add {listed(missing, 'and')}.")
    elif table.spacing == "log" and not (
        min(table.start, table.stop) > 0.0 or max(table.start, table.stop) < 0.0
    ):
        got = f"start = {quoted(table.start)} and stop = {quoted(table.stop)}"
        expected = 'ends that are both > 0, or both < 0, of a range with spacing = "log"'
        yield Problem(where, expected, got, 'No ratio leads from one to the other: use spacing = "linear".')
    elif table.points == 1 and table.start != table.stop:
        hint = "One point cannot be at both ends; make stop equal to start, or give values."
        yield Problem(key_path(("sweep", key, "points")), "a whole number >= 2", "1", hint)
    elif table.points > MOST_LISTED and (table.spacing == "log" or table.adaptive is not None):
        kind = "an adaptive axis" if table.adaptive is not None else 'a range with spacing = "log"'
        where = key_path(("sweep", key, "points"))
        yield Problem(where, f"at most {MOST_LISTED} values of {kind}", str(table.points), "Lower points.")


def _distribution_problems(key: str, table: AxisTable) -> Iterator[Problem]:
    assert table.distribution is not None
    where, needed = key_path(("sweep", key)), _ENDS[table.distribution]
    missing = [name for name in needed if getattr(table, name) is None]
    foreign = [n for n in ("mean", "deviation") if n not in needed and getattr(table, n) is not None]
    low, high = _ends(table)
    got = f"low = {quoted(table.low)} and high = {quoted(table.high)}"
    if table.spacing != "linear":
        yield Problem(where, "a range beside spacing", "a distribution", 'Use distribution = "log-uniform".')
    if missing or foreign:
        hint = f"Add {listed(missing, 'and')}." if missing else f"Remove {listed(foreign, 'and')}."
        has = [name for name in _MOMENTS if getattr(table, name) is not None]
        yield Problem(
            where,
            f"{listed(needed, 'and')} of a {table.distribution} distribution",
            listed(has, "and") or "neither",
            hint,
        )
    elif not low < high:
        yield Problem(where, "low < high", got, "Exchange them.")
    elif table.distribution == "log-uniform" and not low > 0.0:
        yield Problem(where, "low > 0 of a log-uniform distribution", got, 'Use distribution = "uniform".')
    elif table.distribution == "uniform" and not math.isfinite(high - low):
        yield Problem(where, "ends whose distance is a number", got, "Bring them nearer.")
    elif table.distribution == "log-uniform" and not math.isfinite(high / low):
        yield Problem(where, "ends whose ratio is a number", got, "Bring them nearer.")
    elif table.distribution == "normal" and not math.isfinite(_WIDEST * (table.deviation or 0.0)):
        yield Problem(where, "a deviation whose multiples are numbers", quoted(table.deviation), "Lower it.")
    elif table.distribution == "normal" and not has_probability(
        table.mean or 0.0, table.deviation or 1.0, low, high
    ):
        hint = "Less than a millionth of the distribution is between them: move mean, low or high."
        yield Problem(where, "low and high around the mean", got, hint)


def _ends(table: AxisTable) -> tuple[float, float]:
    low = -math.inf if table.low is None else table.low
    return low, math.inf if table.high is None else table.high


def _company_problems(key: str, table: AxisTable) -> Iterator[Problem]:
    """Yield the problems of an axis that moves with other axes, is drawn or is adaptive."""
    drawn_or_zipped = "zip" if table.zip is not None else "a distribution" if table.distribution else ""
    if table.zip is not None and table.distribution is not None:
        yield Problem(
            key_path(("sweep", key, "zip")),
            "no zip beside a distribution",
            quoted(table.zip),
            "Drawn keys move together as it is.",
        )
    if drawn_or_zipped and table.path != "independent":
        where = key_path(("sweep", key, "path"))
        hint = "A path needs an axis of its own; it may be beside this one."
        yield Problem(where, f'"independent" beside {drawn_or_zipped}', quoted(table.path), hint)
    if drawn_or_zipped and table.adaptive is not None:
        where = key_path(("sweep", key, "adaptive"))
        yield Problem(where, f"no adaptive beside {drawn_or_zipped}", "one", "An adaptive axis moves alone.")
    if table.zip is not None and table.zip in RESERVED_NAMES | {DRAW, SCATTERED}:
        where = key_path(("sweep", key, "zip"))
        yield Problem(
            where, "a name that datasets do not use themselves", quoted(table.zip), "Choose another."
        )


def axes_of(
    tables: Mapping[str, AxisTable], sample: object, *, expects_keys: bool = True
) -> tuple[list[SweepAxis], list[Problem]]:
    """Return the valid axes of a sweep, in the order of the scene, and the problems of all other axes."""
    problems: list[Problem] = []
    if isinstance(sample, dict) and expects_keys and not any(t.distribution for t in tables.values()):
        hint = 'Give a key a distribution: { distribution = "uniform", low = 0.5, high = 0.9 }.'
        problems.append(Problem(key_path(("sweep", SAMPLE)), "keys that are drawn", "none", hint))
    values = _drawn_values(tables, sample, problems)
    axes = [
        _axis(key, table, values.get(key, ()))
        for key, table in tables.items()
        if _is_known(table, key, values)
    ]
    problems += _group_problems(axes)
    problems += _adaptive_problems([axis for axis in axes if axis.adaptive is not None], axes)
    wrong = {problem.key for problem in problems}
    return [axis for axis in axes if key_path(("sweep", axis.key)) not in wrong], problems


def _is_known(table: AxisTable, key: str, values: Mapping[str, object]) -> bool:
    return table.distribution is None or key in values


def _drawn_values(
    tables: Mapping[str, AxisTable], sample: object, problems: list[Problem]
) -> dict[str, tuple[float, ...]]:
    """Return the values of drawn keys; empty if the design is invalid."""
    keys = {key: table for key, table in tables.items() if table.distribution is not None}
    if sample is None:
        for key in keys:
            hint = f"Add {SAMPLE} = {_SAMPLE_FORM} to [sweep]."
            problems.append(
                Problem(key_path(("sweep", key)), f"{SAMPLE} beside a distribution", "none", hint)
            )
        return {}
    if not isinstance(sample, dict):
        problems.append(
            Problem(
                key_path(("sweep", SAMPLE)), "a table", quoted(sample), f"Write {SAMPLE} = {_SAMPLE_FORM}."
            )
        )
        return {}
    design = read_table(SampleTable, sample, ("sweep", SAMPLE), problems)
    if design is None or not keys:
        return {}
    if found := list(_design_problems(design, list(keys))):
        problems += found
        return {}
    shares = unit_design(design.design, design.points, len(keys), design.seed)
    return {
        key: drawn(shares[:, place], _quantile(table), *_ends(table))
        for place, (key, table) in enumerate(keys.items())
    }


def _design_problems(design: SampleTable, keys: Sequence[str]) -> Iterator[Problem]:
    """Yield the problems of a design for these keys."""
    place, points = key_path(("sweep", SAMPLE, "points")), design.points
    if design.design in BALANCED and points.bit_count() != 1:
        lower = 1 << (points.bit_length() - 1)
        hint = f"Use {lower} or {2 * lower}."
        yield Problem(place, f"a power of 2 of a {design.design} design", quoted(points), hint)
    elif design.design == "saltelli" and len(keys) < 2:
        hint = 'Nothing is compared with one: use design = "sobol", or draw another key.'
        yield Problem(
            key_path(("sweep", SAMPLE, "design")), "two drawn keys or more beside saltelli", keys[0], hint
        )
    elif design.design == "saltelli" and points * (len(keys) + 2) > MOST_LISTED:
        most = 1 << ((MOST_LISTED // (len(keys) + 2)).bit_length() - 1)
        got = f"{points}, which is {points * (len(keys) + 2)} runs of {len(keys)} keys"
        yield Problem(
            place, f"at most {most} points of a saltelli design", got, "It has keys + 2 runs for each."
        )


def _quantile(table: AxisTable) -> Quantile:
    if table.distribution == "normal":
        assert table.mean is not None
        assert table.deviation is not None
        return normal(table.mean, table.deviation, table.low, table.high)
    assert table.low is not None
    assert table.high is not None
    return (uniform if table.distribution == "uniform" else log_uniform)(table.low, table.high)


def _axis(key: str, table: AxisTable, values: tuple[float, ...]) -> SweepAxis:
    """Return the axis of a valid entry; `values` are the values of a drawn key."""
    if table.distribution is not None:
        return SweepAxis(key, values, together=DRAW)
    if table.values is not None:
        ordered = table.values if table.path == "independent" else tuple(sorted(table.values))
        axis = SweepAxis(key, ordered, table.path)
    else:
        assert table.start is not None
        assert table.stop is not None
        assert table.points is not None
        make = log_axis if table.spacing == "log" else axis_of_range
        axis = make(key, table.start, table.stop, table.points, table.path)
    given = table.adaptive
    adaptive = None if given is None else Adaptive(given.tolerance, given.at_most or 0, given.jump)
    return replace(axis, together=table.zip or "", adaptive=adaptive) if table.zip or adaptive else axis


def _group_problems(axes: Sequence[SweepAxis]) -> Iterator[Problem]:
    """Yield the problems between axes that move together, and the problems of repeated values."""
    for members in dimensions(axes):
        where, name = key_path(("sweep", members[0].key)), members[0].together
        lengths = [len(axis.values) for axis in members]
        if len(set(lengths)) > 1:
            got = listed([f"{n} of {axis.key}" for n, axis in zip(lengths, members, strict=True)], "and")
            yield Problem(
                where,
                f"as many values of each key with zip = {quoted(name)}",
                got,
                "Each point takes one of each.",
            )
            continue
        values, times = _most_repeated(members)
        if times > 1:
            hint = "Each point is run once: remove the repeated value or lower points."
            if name == DRAW:
                hint = "Drawn values have 12 digits: widen the distribution or lower points."
            got = f"{', '.join(map(quoted, values))} {times} times"
            yield Problem(where, "values that differ from each other", got, hint)
        if name and name in {axis.key.rpartition(".")[2] for axis in axes}:
            yield Problem(where, "a zip that is no name of a swept key", quoted(name), "Choose another.")


def _most_repeated(members: Sequence[SweepAxis]) -> tuple[tuple[float, ...], int]:
    """Return the values of axes that move together which most points have, and the number of these points."""
    spaced = [axis.values for axis in members if isinstance(axis.values, SpacedValues)]
    if not spaced:
        return Counter(zip(*(axis.values for axis in members), strict=True)).most_common(1)[0]
    for values in spaced:
        if values.differ:
            return (values[0],), 1
    blocks = zip(*(axis.values for axis in members), strict=True)
    return Counter(islice(blocks, MOST_LISTED)).most_common(1)[0]


def _adaptive_problems(adaptive: Sequence[SweepAxis], axes: Sequence[SweepAxis]) -> Iterator[Problem]:
    """Yield the problems of adaptive axes, whose points are added where the motion jumps."""
    if len(adaptive) > _MOST_ADAPTIVE:
        where = key_path(("sweep", adaptive[-1].key, "adaptive"))
        keys = listed([axis.key for axis in adaptive], "and")
        yield Problem(where, "one or two adaptive axes", keys, "Give the others values.")
        return
    if len(adaptive) == _MOST_ADAPTIVE and len(axes) > _MOST_ADAPTIVE:
        where = key_path(("sweep", adaptive[-1].key, "adaptive"))
        yield Problem(
            where,
            "no axis beside two adaptive ones",
            f"{len(axes)} axes",
            "Run a scene for each value of the others.",
        )
    for axis in axes if adaptive else ():
        if axis.continuation and axis.adaptive is None:
            where = key_path(("sweep", axis.key, "path"))
            hint = "A path is refined along itself only: make its own axis the adaptive one."
            yield Problem(where, '"independent" beside an adaptive axis', quoted(axis.path), hint)
    for axis in adaptive:
        yield from _refinement_problems(axis, len(adaptive))
    limits = {axis.adaptive.at_most for axis in adaptive if axis.adaptive is not None} - {0}
    if not adaptive:
        return
    where, first = key_path(("sweep", adaptive[0].key, "adaptive", "at_most")), run_count(axes)
    if not limits:
        yield Problem(where, "the most points of the sweep", "nothing", f"Add at_most = {10 * first}.")
    elif len(limits) > 1:
        got = listed([str(limit) for limit in sorted(limits)], "and")
        yield Problem(where, "one number of points for the whole sweep", got, "Remove one.")
    elif (limit := limits.pop()) <= first:
        hint = f"That is what the axes have without it: use {10 * first}, or fewer points."
        yield Problem(where, f"more than {first} points", str(limit), hint)


def _refinement_problems(axis: SweepAxis, count: int) -> Iterator[Problem]:
    assert axis.adaptive is not None
    where = key_path(("sweep", axis.key, "adaptive", "tolerance"))
    values, tolerance = sorted(axis.values), axis.adaptive.tolerance
    finest = 4.0 * math.ulp(max(map(abs, values)))
    if len(values) < 2:
        yield Problem(
            key_path(("sweep", axis.key)),
            "two values or more of an adaptive axis",
            "1",
            "Points are put between them.",
        )
    elif not math.isfinite(values[-1] - values[0]):
        got = f"{quoted(values[0])} and {quoted(values[-1])}"
        yield Problem(
            key_path(("sweep", axis.key)), "ends whose distance is a number", got, "Bring them nearer."
        )
    elif tolerance < finest:
        hint = "Numbers of this size are no finer."
        yield Problem(where, f"a tolerance >= {finest:.3g}", quoted(tolerance), hint)
    elif tolerance >= (widest := max(b - a for a, b in pairwise(values))):
        yield Problem(
            where,
            f"a tolerance < {widest:.3g}, the distance of the values",
            quoted(tolerance),
            "Nothing is finer than that: lower it.",
        )
    if count > 1 and axis.continuation:
        hint = "A branch between two others has no predecessor to start from."
        yield Problem(
            key_path(("sweep", axis.key, "path")),
            '"independent" of two adaptive axes',
            quoted(axis.path),
            hint,
        )
