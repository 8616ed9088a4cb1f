"""Export of an FMU for another tool: a lean description with given start values, without a compiler.

The binary is the one that was built, with its maximum sizes. It reads the sizes of the description and the start values
from the FMU's resources. Contacts outside of the description keep the law `none`. FMI 2.0 keeps the value references.
In FMI 3.0 they are places in the description, and a list in the resources maps them back.
"""

from __future__ import annotations

import difflib
import math
import os
import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from vibroimpact.fmus.errors import UsageError
from vibroimpact.fmus.packaging.cross import Note
from vibroimpact.fmus.packaging.description import (
    ComponentDescription,
    Number,
    UnitDefinition,
    Variable,
    lean,
    plural,
    with_starts,
    with_strobes,
    with_structural,
    with_units,
)
from vibroimpact.fmus.packaging.experiment import default_experiment
from vibroimpact.fmus.packaging.fmu_zip import write_fmu
from vibroimpact.fmus.packaging.members import Contents, component_of, edition_of, members_of
from vibroimpact.fmus.packaging.sensitivities import SENSITIVITIES_MEMBER, with_sensitivities
from vibroimpact.fmus.packaging.structure_file import STRUCTURE_MEMBER, natural_frequencies
from vibroimpact.fmus.shipped import component_name

#: Member with the start values that differ from the component's own; its format is in resources.h.
STARTS_MEMBER = "resources/starts.txt"
#: Default number of each repeated block in a lean description.
LEAN_COUNTS = {"contact": 2, "sensor": 0}

#: Prefix of start values that set a body in motion.
SET_IN_MOTION = "forcing."

#: Component whose FMUs are made of recordings only.
REPLAY = "Replay"

Start = Number | str


def export_fmu(
    name: str,
    output: str | os.PathLike[str],
    *,
    contacts: int | None = None,
    modes: int | None = None,
    masses: int | None = None,
    sensors: int | None = None,
    fmi: str = "3.0",
    starts: Mapping[str, Start] | None = None,
    full: bool = False,
    external: bool = False,
    enumerations: bool = False,
    model_exchange: bool = False,
    sensitivities: str | None = None,
    strobes: bool = False,
    structural: bool = False,
    stop_time: float | None = None,
    platform: str | None = None,
    units: Mapping[str, UnitDefinition] | None = None,
    structure: bytes | None = None,
    note: Note = lambda _: None,
) -> Path:
    """Write an FMU of a component of the package.

    Parameters
    ----------
    name : str
        Name of the component.
    output : path
        File to write.
    contacts, modes, masses, sensors : int, optional
        Numbers in the description. `modes` of a Beam and `masses` of a Chain start with this number. The default is the
        number that `starts` needs, with at least two contacts, no sensors, and the component's own number of modes or
        masses. For a `full` description it is the number that was compiled in.
    fmi : str
        `3.0` or `2.0`.
    starts : mapping of str to number or str, optional
        Start values by variable name, SI: a number, a truth value, or the name of an enumeration's value; the others
        are the component's own. If none of them sets the forcing or the initial state, the body starts displaced, so
        that a run shows motion. The displacement is to a side where contacts leave room.
    full : bool
        Whether to describe all variables, as this package's own importer needs them.
    external : bool
        Whether to describe the variables for tools that answer contacts themselves.
    enumerations : bool
        Whether to describe enumerations as such, not as integers.
    model_exchange : bool
        Whether to describe the states of a Structure, for tools that integrate it. Other bodies always have their
        states.
    sensitivities : str, optional
        Parameters, with commas between them, over which outputs have derivatives since the start: further outputs
        `sensitivity.OUTPUT.KEY`, in co-simulation alone.
    strobes : bool
        Whether to describe `phase_zero`, an output clock that ticks at forcing phase zero, and the displacement and the
        velocity at its ticks. FMI 3.0 alone has clocks.
    structural : bool
        Whether `modes`, `masses` and `contacts` are structural parameters, which FMI 3.0 alone has.
    stop_time : float, optional
        Default end of a run, s; without it, a time that suits the body's frequencies.
    platform : str, optional
        Platforms of the FMU: `all`, or names with commas between them (`x86_64-windows,x86_64-linux`). The default is
        this platform and those whose libraries a release contains.
    units : mapping of str to UnitDefinition, optional
        Units, by variable name, for variables without a unit of their own: those of a Gain.
    structure : bytes, optional
        Modes of a Structure: `structure_file`. `modes` and `contacts` should be their numbers. Without it, the body is
        an oscillator of mass 1 and stiffness 1.
    note : callable
        Function that gets a line about each compilation for another machine, and each warning of the library.

    Returns
    -------
    Path
        The written file.

    Raises
    ------
    ComponentFileError
        The component is unknown, or it was not built.
    ComponentError
        A platform has no library, and no compiler was found to build it.
    UsageError
        A number is larger than compiled in, or the component has no such block. A start value has no variable, is out
        of its range, or is refused by the library. The file cannot be written.
    """
    target = Path(output)
    full_name = component_name(name)
    if full_name == REPLAY:
        raise UsageError(
            f"{name}: expected a component that needs no recording, got one that plays it. Make its FMU by "
            "`vibroimpact fmu replay recording.nc -o replay.fmu`."
        )
    original = component_of(full_name)
    requested = {"contact": contacts, "mode": modes, "mass": masses, "sensor": sensors}
    counts = {block: count for block, count in requested.items() if count is not None}
    _check_counts(original, counts)
    for option, given_option in (("strobes", strobes), ("structural", structural)):
        if given_option and fmi != "3.0":
            raise UsageError(f"{full_name}: {option}: expected FMI 3.0 with this option, got FMI {fmi}.")

    def members_with(given: Mapping[str, Start]) -> dict[str, bytes]:
        own_starts = _checked_starts(original, given)
        component, shown, edition = original, counts, None
        if not full:
            shown = _lean_counts(original, own_starts) | counts
        component = with_starts(original.with_repeats(shown), own_starts)
        natural = natural_frequencies(structure) if structure is not None else ()
        experiment = default_experiment(full_name, _numbers(component), stop_time, natural)
        suitable = default_experiment(full_name, _numbers(component), natural=natural)
        if not full:
            edition = edition_of(experiment)
            component = lean(
                component, external=external, enumerations=enumerations, model_exchange=model_exchange
            )
        component = with_structural(component) if structural else component
        component = with_strobes(component) if strobes else component
        component = with_units(component, units or {})
        _refuse_starts_beyond(component, own_starts)
        pairs = None
        if sensitivities is not None:
            component, pairs = with_sensitivities(component, original, sensitivities)
        resources = {} if structure is None else {STRUCTURE_MEMBER: structure}
        if pairs is not None:
            resources[SENSITIVITIES_MEMBER] = pairs
        if own_starts:
            resources[STARTS_MEMBER] = "".join(_start_lines(original, own_starts)).encode("ascii")
        tried = replace(experiment, stop_time=min(experiment.stop_time, suitable.stop_time))
        contents = Contents(original, component, fmi, edition, tried, shown, resources, platform, note)
        return members_of(contents)

    given = dict(starts or {})
    displaced = [] if full or structure is not None else _displacements(original, given)
    write_fmu(target, _first_taken([*(given | one for one in displaced), given], members_with))
    return target


def _first_taken(
    choices: Sequence[Mapping[str, Start]], members_with: Callable[[Mapping[str, Start]], dict[str, bytes]]
) -> dict[str, bytes]:
    """Return the members with the first start values that the library accepts, or raise the error of the last ones."""
    *first, last = choices
    for choice in first:
        with suppress(UsageError):
            return members_with(choice)
    return members_with(last)


def _displacements(component: ComponentDescription, starts: Mapping[str, Start]) -> list[dict[str, Start]]:
    """Return start values that displace a body to either side; empty if a given start value moves the body."""
    if any(name.startswith(SET_IN_MOTION) or "_start" in name for name in starts):
        return []
    displaced: dict[str, Start] = dict(component.start_of_export)
    return (
        [displaced, {name: -value for name, value in component.start_of_export.items()}] if displaced else []
    )


def _numbers(component: ComponentDescription) -> dict[str, Number]:
    return {v.name: v.start for v in component.variables if v.start is not None}


def _lean_counts(component: ComponentDescription, starts: Mapping[str, Number]) -> dict[str, int]:
    """Return the number of each block in a lean description, large enough for all start values."""
    counts = dict.fromkeys(component.repeats, 0) | {
        block: min(count, component.repeats[block])
        for block, count in LEAN_COUNTS.items()
        if block in component.repeats
    }
    for variable in component.variables:
        if variable.counts and variable.counts not in LEAN_COUNTS:
            counts[variable.counts] = int(starts.get(variable.name, variable.start or 0))
    for variable in component.variables:
        if variable.repeat and variable.name in starts:
            counts[variable.repeat] = max(counts[variable.repeat], variable.repeat_index)
    return counts


def _checked_starts(component: ComponentDescription, starts: Mapping[str, Start]) -> dict[str, Number]:
    variables = {v.name: v for v in component.variables}
    checked: dict[str, Number] = {}
    problems = []
    for name, value in starts.items():
        variable = variables.get(name)
        if variable is None or variable.start is None or variable.dimensions:
            problems.append(f"{component.name}: {_no_such_start(component, name)}")
            continue
        number = _as_number(component, variable, value)
        if number is None:
            problems.append(
                f"{component.name}: {name}: expected {_expected(component, variable)}, got {value!r}."
            )
            continue
        checked[name] = number
    if problems:
        raise UsageError("\n".join(problems))
    return checked


def _no_such_start(component: ComponentDescription, name: str) -> str:
    known = [v.name for v in component.variables if v.start is not None and not v.dimensions]
    if bracketed := re.match(r"(\w+)\[(\d+)\]", name):
        block = bracketed[1] if bracketed[1] in component.repeats else ""
        most = component.repeats.get(block, 0)
        if block and int(bracketed[2]) > most:
            return f"{name}: expected {block} 1 to {most}, got {bracketed[2]}."
    near = difflib.get_close_matches(name, known, n=1)
    hint = f" Did you mean {near[0]}?" if near else ""
    return f"{name}: expected a parameter or an input, got none of this name.{hint}"


def _as_number(component: ComponentDescription, variable: Variable, value: Start) -> Number | None:
    """Return a start value in the type of its variable; None if it has another type or is out of range."""
    number: Number | None
    names = {
        item.name: item.value
        for e in component.enumerations
        if e.name == variable.enumeration
        for item in e.items
    }
    if variable.type == "Boolean":
        return {"true": True, "false": False}.get(str(value).lower())
    try:
        if variable.type == "Float64":
            number = float(value)
        else:
            number = names[str(value)] if str(value) in names else int(str(value))
    except (ValueError, OverflowError):
        return None
    lowest = -math.inf if variable.minimum is None else variable.minimum
    highest = math.inf if variable.maximum is None else variable.maximum
    fits = (
        math.isfinite(number)
        and lowest <= number <= highest
        and (isinstance(number, float) or abs(number) < 2**31)
    )
    return number if fits and (not names or number in names.values()) else None


def _expected(component: ComponentDescription, variable: Variable) -> str:
    for enumeration in component.enumerations:
        if enumeration.name == variable.enumeration:
            return f"one of {', '.join(item.name for item in enumeration.items)}"
    if variable.type == "Boolean":
        return "true or false"
    what = "a number" if variable.type == "Float64" else "a whole number"
    if variable.minimum is not None and variable.maximum is not None:
        return f"{what} from {variable.minimum:g} to {variable.maximum:g}"
    return what if variable.minimum is None else f"{what} >= {variable.minimum:g}"


def _refuse_starts_beyond(component: ComponentDescription, starts: Mapping[str, Number]) -> None:
    """Raise UsageError for start values of variables that the description leaves out, or beyond its sizes."""
    shown = (v for v in component.variables if v.versions)
    most = {v.name: math.inf if v.maximum is None else v.maximum for v in shown}
    more = "Ask for more of them, for external ports, or for the full description."
    for name, start in starts.items():
        if name not in most:
            raise UsageError(
                f"{component.name}: {name}: expected a variable of this description, got one that it leaves out. {more}"
            )
        if start > most[name]:
            raise UsageError(
                f"{component.name}: {name}: expected at most {most[name]:g} in this description, got {start:g}. {more}"
            )


def _start_lines(component: ComponentDescription, starts: Mapping[str, Number]) -> Iterator[str]:
    for variable in component.variables:
        if variable.name in starts:
            value = starts[variable.name]
            packed = struct.pack(">d", value) if variable.type == "Float64" else struct.pack(">q", value)
            yield f"{variable.value_reference} {packed.hex()}\n"


def _check_counts(component: ComponentDescription, counts: Mapping[str, int]) -> None:
    problems = []
    for block, count in counts.items():
        if block not in component.repeats:
            known = ", ".join(map(plural, component.repeats)) or "nothing"
            problems.append(
                f"{component.name}: {plural(block)}: expected no number of them, since this component repeats "
                f"{known}, got {count}. Leave the option out."
            )
            continue
        # the minimum of the variable that counts the blocks is their least number
        least = max((int(v.minimum or 0) for v in component.variables if v.counts == block), default=0)
        most = component.repeats[block]
        if not isinstance(count, int) or not least <= count <= most:
            problems.append(f"{component.name}: {plural(block)}: expected {least} to {most}, got {count}.")
    if problems:
        raise UsageError("\n".join(problems))
