"""Rules of the mappings of connections: pairs of values between whole numbers, enumerations and truth values."""

from __future__ import annotations

from collections.abc import Iterator

from vibroimpact.orchestrator.scene.component_facts import Misfit, VariableFacts, typed_value
from vibroimpact.orchestrator.scene.component_models import ConnectionTable
from vibroimpact.orchestrator.scene.components import GeneralDraft
from vibroimpact.orchestrator.scene.problems import Problem, quoted

MAPPED_KINDS = ("integer", "enumeration", "boolean")


def mapping_problems(
    connection: ConnectionTable, where: str, source: VariableFacts, target: VariableFacts
) -> Iterator[Problem]:
    """Yield the problems of a mapping between two variables."""
    ends = (source, connection.source), (target, connection.target)
    wrong = next((each for each in ends if each[0].kind not in MAPPED_KINDS), None)
    if wrong is not None:
        expected = "a mapping only between whole numbers, enumerations and truth values"
        yield Problem(where, expected, f"the {wrong[0].shape} {wrong[1]}", "Give a gain instead.")
        return
    if (connection.gain, connection.offset) != (1.0, 0.0):
        got = f"gain {connection.gain:g} and offset {connection.offset:g}"
        yield Problem(where, "no gain and no offset beside a mapping", got)
    seen: set[object] = set()
    for number, pair in enumerate(connection.mapping, start=1):
        for (variable, _), value in zip(ends, pair, strict=True):
            typed = typed_value(variable, value)
            if isinstance(typed, Misfit):
                yield Problem(f"{where}[{number}]", typed.expected, quoted(value), typed.hint)
            elif variable is source and typed in seen:
                yield Problem(f"{where}[{number}]", "each value of the output once", quoted(value))
            elif variable is source:
                seen.add(typed)


def mapped_numbers(connection: ConnectionTable, draft: GeneralDraft) -> tuple[tuple[int, int], ...]:
    """Return the pairs of a valid mapping as numbers: of items their numbers, of truth values 0 and 1."""
    if not connection.mapping:
        return ()
    variables = [draft.variable(end) for end in (connection.source, connection.target)]
    typed = [
        [typed_value(variable, value) for variable, value in zip(variables, pair, strict=True) if variable]
        for pair in connection.mapping
    ]
    return tuple(
        (int(a), int(b))
        for a, b in typed
        if not isinstance(a, Misfit | str | float) and not isinstance(b, Misfit | str | float)
    )
