"""Derivatives of outputs over parameters since the start, as further outputs of an export: equations.md 6.17."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.description import ComponentDescription, Variable

#: Member with the pairs of an output and a parameter; its format is in resources.h.
SENSITIVITIES_MEMBER = "resources/sensitivities.txt"
#: Most parameters and most pairs of one FMU: VI_KEYS and VI_MOST_SENSITIVITIES of the C.
MOST_KEYS, MOST_PAIRS = 16, 512
#: Outputs that have derivatives, where the description has them.
OUTPUTS = re.compile(
    r"(displacement|velocity|acceleration)(\[\d+\])?"
    r"|sensor\[\d+\]\.(displacement|velocity|acceleration)"
    r"|contact\[\d+\]\.(displacement|velocity|force|last_time|last_velocity)"
)
#: Parameters of all bodies, and those of each component, over which the C has derivatives.
COMMON = (
    r"contact\[\d+\]\.(position|restitution|yield_velocity|stiffness|damping|exponent)"
    r"|forcing\.(angular_frequency|phase)"
)
KEYS = {
    "Oscillator": r"mass|damping|stiffness|(displacement|velocity)_start|forcing\.(amplitude|base_acceleration)",
    "Chain": r"(mass|damping|stiffness|(displacement|velocity)_start|forcing\.amplitude)\[\d+\]"
    r"|far_(stiffness|damping)|forcing\.base_acceleration",
    "Beam": r"(damping_ratio|modal_(displacement|velocity)_start)\[\d+\]|forcing\.amplitude",
    "Structure": r"forcing\.(amplitude|base_acceleration)",
}


def with_sensitivities(
    component: ComponentDescription, original: ComponentDescription, names: str
) -> tuple[ComponentDescription, bytes]:
    """Return a description with `sensitivity.OUTPUT.KEY` for each output and key, and the list of their pairs.

    Such a description is for co-simulation alone, and has no derivatives at an instant.

    Parameters
    ----------
    component, original : ComponentDescription
        As described, and as compiled.
    names : str
        Parameters with commas between them; `stop[k]` of a scene is `contact[k]`.

    Raises
    ------
    UsageError
        A name is no parameter of the description whose derivative the body has, or is there twice; there are too many.
    """
    keys = _keys(component, [name.strip() for name in names.split(",")])
    outputs = [v for v in component.variables if v.causality == "output" and OUTPUTS.fullmatch(v.name)]
    pairs = [(output, key, name) for name, key in keys for output in outputs]
    if len(keys) > MOST_KEYS or len(pairs) > MOST_PAIRS:
        raise UsageError(
            f"{component.name}: sensitivities: expected at most {MOST_KEYS} parameters and {MOST_PAIRS} outputs of "
            f"their derivatives, got {len(keys)} and {len(pairs)}. Name fewer, or describe fewer masses and contacts."
        )
    first = len(original.variables)
    added = (_derivative(*pair, first + place) for place, pair in enumerate(pairs))
    described = replace(
        component,
        model_exchange=False,
        partial_derivatives=False,
        variables=(*(_plain(v) for v in component.variables), *added),
    )
    lines = (f"{output.value_reference} {key.value_reference}\n" for output, key, _ in pairs)
    return described, "".join(lines).encode("ascii")


def _keys(component: ComponentDescription, names: Sequence[str]) -> list[tuple[str, Variable]]:
    known = {v.name: v for v in component.variables if _is_key(component, v.name)}
    found = [(name, known.get(_own_name(name))) for name in names]
    problems = [*_problems(component, known, found)]
    if problems:
        raise UsageError("\n".join(problems))
    return [(name, variable) for name, variable in found if variable is not None]


def _problems(
    component: ComponentDescription, known: dict[str, Variable], found: Sequence[tuple[str, Variable | None]]
) -> Iterator[str]:
    seen = set()
    for name, variable in found:
        where = f"{component.name}: sensitivities: {name}"
        if variable is None:
            near = difflib.get_close_matches(_own_name(name), known, n=1)
            hint = f" Did you mean {near[0]}?" if near else ""
            yield f"{where}: expected a parameter over which the body has derivatives, got another.{hint}"
        elif variable.name in seen:
            yield f"{where}: expected each parameter once, got it twice."
        else:
            seen.add(variable.name)


def _is_key(component: ComponentDescription, name: str) -> bool:
    own = KEYS.get(component.name)
    return own is not None and re.fullmatch(f"{COMMON}|{own}", name) is not None


def _own_name(name: str) -> str:
    """Return the FMU's name of a parameter of a scene."""
    return re.sub(r"^stop\[", "contact[", name)


def _plain(variable: Variable) -> Variable:
    """Return a variable without what only model exchange needs."""
    return replace(variable, derivative="", event_indicator=False)


def _derivative(output: Variable, key: Variable, name: str, reference: int) -> Variable:
    per = f"; {output.unit or '1'} per {key.unit or '1'}"
    text = f"Derivative of {output.name} over {key.name} since the start{per}"
    return replace(
        output,
        name=f"sensitivity.{output.name}.{name}",
        description=text,
        shown_name=f"sensitivity.{output.name}.{name}",
        shown_description=text,
        value_reference=reference,
        unit="",
        repeat="",
        repeat_index=0,
        code=f"SENSITIVITY_{reference}",
    )
