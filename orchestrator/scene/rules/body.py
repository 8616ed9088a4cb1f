"""Rules of a body: arrays of one size, points on the body, known variable names."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from vibroimpact.orchestrator.scene.body_models import Body, ModesBody
from vibroimpact.orchestrator.scene.body_models.modes import POINT_NAME
from vibroimpact.orchestrator.scene.body_models.structure import NOT_IN_STRUCTURES
from vibroimpact.orchestrator.scene.draft import Draft
from vibroimpact.orchestrator.scene.fields import field_of, fmu_variables_of, is_array_only
from vibroimpact.orchestrator.scene.measuring_models import CHANNELS
from vibroimpact.orchestrator.scene.problems import Problem, quoted
from vibroimpact.orchestrator.scene.sampled_names import (
    channel_names,
    sampled_names,
    table_of,
    variable_hint,
)

ALONE = "beside one body alone"
SECTION_KEYS = ("width", "thickness", "youngs_modulus", "density")
RIGIDITY_KEYS = ("flexural_rigidity", "mass_per_length")
FREQUENCY_KEYS = ("frequency", "mass_per_length")
SKEW = 1e-9
"""Largest difference of mirrored entries over the largest entry: a product of matrices is rounded."""


def arrays_have_one_size(draft: Draft) -> Iterator[Problem]:
    """Arrays of a chain have one element for each mass, arrays of a beam one for each mode."""
    body = draft.body
    if body is None or not body.IS_STRUCTURE:
        return
    for variable in fmu_variables_of(type(body)):
        if not variable.is_array:
            continue
        where, value = f"body.{variable.key}", getattr(body, variable.attribute)
        is_start = is_array_only(field_of(type(body), variable.key))
        if not body.KEEPS_MODES:
            yield from size_problem(where, value, body.size, body.ELEMENT)
        elif isinstance(value, tuple) and value and draft.sweeps_modes and not is_start:
            expected = "one number for all modes where it is not yet known how many there are"
            yield Problem(where, expected, f"an array of {len(value)}", "Write the number alone.")
        elif not is_start:
            yield from size_problem(where, value, body.size, body.ELEMENT)
        elif len(value) > body.size:
            expected = f"at most {body.size} numbers, one for each mode"
            yield Problem(where, expected, f"an array of {len(value)}", "Those left out are 0.")


def size_problem(key: str, value: object, size: int, of: str) -> Iterator[Problem]:
    """Yield the problem of an array that has not one number for each element of a body."""
    if isinstance(value, tuple) and len(value) not in (size, 0):
        hint = f"This scene has {size} {of}{'' if size == 1 else 'es' if of == 'mass' else 's'}."
        expected = f"an array of {size}, one number for each {of}"
        yield Problem(key, expected, f"an array of {len(value)}", hint)


def beam_is_given_once(draft: Draft) -> Iterator[Problem]:
    """Rigidity and mass of a beam follow from section and material, or are given themselves, but not both."""
    written = draft.written("body")
    if not hasattr(draft.body, "flexural_rigidity"):
        return
    section = [key for key in SECTION_KEYS if key in written]
    by_frequency = "frequency" in written
    way_without_section = FREQUENCY_KEYS if by_frequency else RIGIDITY_KEYS
    rigidity = [key for key in ("frequency", *RIGIDITY_KEYS) if key in written]
    ways = f"{', '.join(SECTION_KEYS)}, or {' and '.join(RIGIDITY_KEYS)}, or {' and '.join(FREQUENCY_KEYS)}"
    if by_frequency and "flexural_rigidity" in written:
        yield Problem("body", ways, "frequency beside flexural_rigidity", "Remove one of them.")
        return
    if section and rigidity:
        got = f"{', '.join(section)} beside {', '.join(rigidity)}"
        yield Problem("body", ways, got, "Remove those of one way.")
        return
    way, given = (way_without_section, rigidity) if rigidity else (SECTION_KEYS, section)
    missing = [key for key in way if key not in given]
    if missing:
        yield Problem("body", ways, ", ".join(given) or "neither", f"Add {', '.join(missing)}.")


def observed_point_is_there(draft: Draft) -> Iterator[Problem]:
    """The mass or the point of the recorded displacement is on the body."""
    body = draft.body
    if body is None:
        return
    if body.kept_modes > body.size:
        expected = f"at most as many modes as masses, {body.size}"
        yield Problem("body.modes", expected, str(body.kept_modes), "Leave it out for all of them.")
    observed = getattr(body, "observed_mass", None)
    if observed is not None and observed > body.size:
        expected = f"a mass of the chain, 1 to {body.size}"
        yield Problem("body.observed_mass", expected, str(observed), "Masses count from the ground.")
    if "sensor" not in draft.document:
        return
    if body.PLACE != "location":
        if "location" in draft.written("sensor"):
            hint = f"Remove it{body.SENSOR_HINT}."
            yield Problem(
                "sensor.location", "a location in a scene of a beam", f"one beside {body.NAME}", hint
            )
        return
    span = draft.span("sensor.location")
    yield from fixed_point_problems("sensor.location", body, span)


def fixed_point_problems(key: str, body: Body, span: tuple[float, float] | None) -> Iterator[Problem]:
    """Yield the problem of a location, or of the ends of its sweep, at a point that does not move."""
    for location in dict.fromkeys(span or ()):
        fixed = body.fixed_point(location)
        if fixed is not None:
            expected, end = fixed
            yield Problem(key, expected, quoted(location), f"{quoted(location)} is the {end}.")


def sampled_variables_are_known(draft: Draft) -> Iterator[Problem]:
    """A time series names variables of this body, each once."""
    series = draft.record.time_series if draft.record else None
    body = draft.simulated_body
    if series is None or body is None:
        return
    known = (
        *sampled_names(body, len(draft.stops) + len(draft.meetings), draft.forces),
        *channel_names(draft.document),
    )
    for place, name in enumerate(series.variables, start=1):
        if name in CHANNELS and name not in known:
            hint = f"Add [{table_of(name)}], or leave it out."
            where = f"record.time_series.variables[{place}]"
            yield Problem(where, f"[{table_of(name)}] beside {quoted(name)}", "a scene without it", hint)
        elif name not in known:
            hint = variable_hint(name, known)
            yield Problem(f"record.time_series.variables[{place}]", "a variable name", quoted(name), hint)
    for name, times in Counter(series.variables).items():
        if times > 1:
            yield Problem(
                "record.time_series.variables", "each variable once", f"{quoted(name)} {times} times"
            )


def keys_left_out(part: Draft) -> Iterator[str]:
    """Yield the written keys of a body that it cannot have in a structure."""
    keeps_modes = part.body is not None and part.body.KEEPS_MODES and part.body.IS_STRUCTURE
    for key in part.written("body"):
        has_modes = key == "modes" and (part.body is None or (keeps_modes and not part.finds_modes))
        if key in NOT_IN_STRUCTURES and key != "poisson_ratio" and not has_modes:
            yield key


def modes_are_whole(draft: Draft) -> Iterator[Problem]:
    """Given modes have one kind of frequencies, and a number for each mode in every array."""
    body = draft.body
    if not isinstance(body, ModesBody):
        return
    given = [key for key in ("frequencies", "angular_frequencies") if getattr(body, key) is not None]
    if len(given) != 1:
        got = " and ".join(given) or "neither"
        yield Problem("body", "frequencies, Hz, or angular_frequencies, rad/s", got, "Give one of them.")
        return
    shapes = {f"body.shapes.{point}": shape for point, shape in body.shapes.items()}
    rows = {f"body.damping_matrix[{row}]": each for row, each in enumerate(body.damping_matrix, start=1)}
    for key, value in {"body.damping_ratio": body.damping_ratio, **shapes, **rows}.items():
        yield from size_problem(key, value, body.size, "mode")
    yield from size_problem("body.damping_matrix", body.damping_matrix, body.size, "mode")
    yield from size_problem("body.participation", body.participation, body.size, "mode")
    for key in ("displacement_start", "velocity_start"):
        if len(getattr(body, key)) > body.size:
            got = f"an array of {len(getattr(body, key))}"
            yield Problem(f"body.{key}", f"at most {body.size} numbers, one for each mode", got)
    for point in body.shapes:
        if not POINT_NAME.fullmatch(point):
            hint = "A dot is allowed within it."
            yield Problem("body.shapes", "names of letters, digits, _, - and dots", quoted(point), hint)
    if not _is_symmetric(body.damping_matrix):
        hint = "Gyroscopic terms are not modelled."
        yield Problem("body.damping_matrix", "a symmetric matrix", "one that is not", hint)


def _is_symmetric(matrix: Sequence[Sequence[float]]) -> bool:
    """Return whether mirrored entries of a square matrix differ by rounding at most."""
    allowed = SKEW * max((abs(number) for row in matrix for number in row), default=0.0)
    columns = zip(*matrix, strict=False)
    return all(
        abs(one - other) <= allowed
        for row, column in zip(matrix, columns, strict=False)
        for one, other in zip(row, column, strict=False)
    )


BODY_RULES = (
    arrays_have_one_size,
    modes_are_whole,
    beam_is_given_once,
    observed_point_is_there,
    sampled_variables_are_known,
)
