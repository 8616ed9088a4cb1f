"""Reading of `variables.toml`; every problem of the file is reported at once.

`[component] include` names files whose units, enumerations and variables follow the component's own; content shared by
several components is written once there. Dependencies that a component lacks are dropped from included files. An
enumeration has its `items`, or names as `laws` the C file of the contact laws: `contact_laws`.
"""

from __future__ import annotations

import tomllib
import uuid
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError
from vibroimpact.fmus.packaging.description.contact_laws import contact_laws
from vibroimpact.fmus.packaging.description.model import (
    DEFAULT_INITIAL,
    ComponentDescription,
    Enumeration,
    EnumerationItem,
    UnitDefinition,
    Variable,
    plural,
)
from vibroimpact.fmus.units import BASE_UNITS

#: Namespace of the tokens. A token is a uuid5 of the bytes of variables.toml: equal files have equal tokens.
TOKEN_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_DNS, "vibroimpact")

TYPES = ("Float64", "Int64", "Boolean", "Enumeration", "Clock")
REQUIRED_KEYS = {"name", "description", "causality", "variability", "type", "field", "code"}
OPTIONAL_KEYS = {
    *("unit", "enumeration", "start", "min", "max", "initial"),
    *(
        "repeat",
        "dimensions",
        "fmi",
        "dependencies",
        "counts",
        "ports",
        "derivative",
        "event_indicator",
        "clock",
    ),
}
PORTS = ("importer", "external", "strobes", "structural")
#: Mark in a dependency for every index of a repeated block; `{k}` is the variable's own index.
ALL = "{*}"


def read_component(path: Path) -> ComponentDescription:
    """Read one component's `variables.toml`, with repeated blocks written out.

    Raise ComponentFileError with all problems of the file, one a line.
    """
    table, content = _table(path)
    included = [_table(path.parent / name) for name in table.get("component", {}).get("include", ())]
    table = _merged(table, [part for part, _ in included])
    content += b"".join(more for _, more in included)
    content += b"".join(repr(e["items"]).encode() for e in table.get("enumeration", ()) if "laws" in e)
    problems = list(_problems_of_table(table)) or list(_problems_of_variables(table))
    if problems:
        raise ComponentFileError("\n".join(f"{path}: {problem}" for problem in problems))
    return _component(table, path, str(uuid.uuid5(TOKEN_NAMESPACE, content.hex())))


def _table(path: Path) -> tuple[dict[str, Any], bytes]:
    try:
        content = path.read_bytes()
        table = tomllib.loads(content.decode("utf-8"))
    except OSError as error:
        raise ComponentFileError(f"{path}: expected a file, got: {error.strerror}.") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ComponentFileError(f"{path}: expected a TOML file, got one with: {error}.") from error
    for entry in table.get("enumeration", ()):
        if "laws" in entry:
            entry["items"] = contact_laws(path.parent / entry["laws"], of_stop=entry.get("of_stop", False))
    return table, content


def _merged(table: Mapping[str, Any], included: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    lists = {
        key: [entry for part in (table, *included) for entry in part.get(key, ())]
        for key in ("unit", "enumeration", "variable")
    }
    names = {entry.get("name") for entry in lists["variable"]}
    own = len(table.get("variable", ()))
    rest = (_with_known_dependencies(entry, names) for entry in lists["variable"][own:])
    return {**table, **lists, "variable": [*lists["variable"][:own], *rest]}


def _with_known_dependencies(entry: Mapping[str, Any], names: set[Any]) -> Mapping[str, Any]:
    if "dependencies" not in entry:
        return entry
    return {**entry, "dependencies": [d for d in entry["dependencies"] if _entry_name(d) in names]}


def _entry_name(dependency: str) -> str:
    return dependency.replace(ALL, "{k}")


def _component(table: Mapping[str, Any], path: Path, token: str) -> ComponentDescription:
    head = table["component"]
    repeats = {name: _repeat_count(head, name) or 0 for name in _repeat_names(table)}
    return ComponentDescription(
        name=head["name"],
        folder=head["folder"],
        struct=head["struct"],
        header=head["header"],
        description=head["description"],
        event_mode=head.get("event_mode", False),
        model_exchange=head.get("model_exchange", False),
        partial_derivatives=head.get("model_exchange", False),
        growing=head.get("growing", False),
        degree=head.get("degree", 1),
        token=f"{{{token}}}",
        source=path,
        repeats=repeats,
        units=tuple(UnitDefinition(**{"base": {}, **unit}) for unit in table.get("unit", ())),
        enumerations=tuple(_enumeration(entry) for entry in table.get("enumeration", ())),
        variables=tuple(_numbered(table["variable"], repeats)),
        start_of_export=head.get("start_of_export", {}),
        core=tuple(head.get("core", ())),
    )


def _enumeration(entry: Mapping[str, Any]) -> Enumeration:
    items = tuple(entry["items"]) if "laws" in entry else tuple(EnumerationItem(**i) for i in entry["items"])
    return Enumeration(entry["name"], items, entry.get("description", ""))


def _repeat_names(table: Mapping[str, Any]) -> list[str]:
    return list(dict.fromkeys(v["repeat"] for v in table["variable"] if "repeat" in v))


def _repeat_count(head: Mapping[str, Any], repeat: str) -> int | None:
    # `contacts = 2` counts the block `contact`, `masses` the block `mass`
    count: int | None = head.get(plural(repeat))
    return count


def _numbered(entries: list[Mapping[str, Any]], repeats: Mapping[str, int]) -> Iterator[Variable]:
    blocks = {entry["name"]: entry.get("repeat", "") for entry in entries}
    for reference, (entry, index) in enumerate(_written_out(entries, repeats)):
        written = (_dependency(d, index, blocks, repeats) for d in entry.get("dependencies", ()))
        dependencies = tuple(name for names in written for name in names)
        yield _variable(entry, index, reference, dependencies if "dependencies" in entry else None)


def _dependency(
    text: str, index: int, blocks: Mapping[str, str], repeats: Mapping[str, int]
) -> Iterator[str]:
    if ALL not in text:
        yield _indexed(text, index)
        return
    for other in range(1, repeats[blocks[_entry_name(text)]] + 1):
        yield text.replace(ALL, str(other))


def _written_out(
    entries: list[Mapping[str, Any]], repeats: Mapping[str, int]
) -> Iterator[tuple[Mapping[str, Any], int]]:
    for repeat, block in groupby(entries, key=lambda entry: entry.get("repeat", "")):
        members = list(block)
        indices = range(1, repeats[repeat] + 1) if repeat else (0,)
        for index in indices:
            yield from ((entry, index) for entry in members)


def _variable(
    entry: Mapping[str, Any], index: int, reference: int, dependencies: tuple[str, ...] | None
) -> Variable:
    default = DEFAULT_INITIAL[entry["causality"], entry["variability"]]
    return Variable(
        name=_indexed(entry["name"], index),
        description=_indexed(entry["description"], index),
        type=entry["type"],
        causality=entry["causality"],
        variability=entry["variability"],
        initial=None if entry["type"] == "Clock" else entry.get("initial", default),
        value_reference=reference,
        field=_indexed(entry["field"], index),
        code=f"{entry['code']}_{index}" if index else entry["code"],
        unit=entry.get("unit", ""),
        enumeration=entry.get("enumeration", ""),
        start=entry.get("start"),
        minimum=entry.get("min"),
        maximum=entry.get("max"),
        dimensions=tuple(entry.get("dimensions", ())),
        dependencies=dependencies,
        versions=_versions(entry),
        repeat=entry.get("repeat", ""),
        repeat_index=index,
        counts=entry.get("counts", ""),
        ports=entry.get("ports", ""),
        derivative=_indexed(entry.get("derivative", ""), index),
        event_indicator=entry.get("event_indicator", False),
        clock=entry.get("clock", ""),
        shown_name=entry["name"].replace("{k}", "k"),
        shown_description=entry["description"].replace("{k}", "k"),
    )


def _versions(entry: Mapping[str, Any]) -> tuple[int, ...]:
    # FMI 2.0 has no arrays, and time is a variable only since FMI 3.0
    only_fmi3 = "dimensions" in entry or entry["causality"] == "independent"
    return (3,) if only_fmi3 else tuple(entry.get("fmi", (2, 3)))


def _indexed(text: str, index: int) -> str:
    return text.replace("{k}", str(index)).replace("{i}", str(index - 1)) if index else text


def _problems_of_table(table: Mapping[str, Any]) -> Iterator[str]:
    head = table.get("component", {})
    for key in ("name", "folder", "struct", "header", "description"):
        if not isinstance(head.get(key), str):
            yield f"component.{key}: expected a string, got {head.get(key)!r}."
    if not table.get("variable"):
        yield "variable: expected at least one [[variable]], got none."
        return
    for number, entry in enumerate(table["variable"], 1):
        where = f"variable {entry.get('name', number)}"
        missing = REQUIRED_KEYS - entry.keys()
        unknown = entry.keys() - REQUIRED_KEYS - OPTIONAL_KEYS
        if missing:
            yield f"{where}: expected the keys {', '.join(sorted(missing))}, got none of them."
        if unknown:
            yield f"{where}: expected only known keys, got {', '.join(sorted(unknown))}."
    for unit in table.get("unit", ()):
        wrong = unit.get("base", {}).keys() - set(BASE_UNITS)
        if wrong:
            yield f"unit {unit.get('name')}: expected base units {' '.join(BASE_UNITS)}, got {sorted(wrong)}."


def _problems_of_variables(table: Mapping[str, Any]) -> Iterator[str]:
    entries = table["variable"]
    if entries[0]["causality"] != "independent":
        yield (
            f"variable {entries[0]['name']}: expected the independent variable time first, "
            f"got causality {entries[0]['causality']}."
        )
    names = [entry["name"] for entry in entries]
    yield from (
        f"variable {n}: expected a unique name, got it twice." for n in set(names) if names.count(n) > 1
    )
    for entry in entries:
        for key, expected, holds in _rules(table):
            if not holds(entry):
                yield f"variable {entry['name']}: {key}: expected {expected}, got {entry.get(key)!r}."


Rule = tuple[str, str, Callable[[Mapping[str, Any]], bool]]


def _rules(table: Mapping[str, Any]) -> tuple[Rule, ...]:
    names = {entry["name"] for entry in table["variable"]}
    units = {unit["name"] for unit in table.get("unit", ())}
    enumerations = {entry["name"] for entry in table.get("enumeration", ())}
    return (
        ("type", f"one of {', '.join(TYPES)}", lambda e: e["type"] in TYPES),
        (
            "variability",
            "a variability that FMI allows with this causality",
            lambda e: (e["causality"], e["variability"]) in DEFAULT_INITIAL,
        ),
        (
            "variability",
            "continuous only for Float64",
            lambda e: e["type"] == "Float64" or e["variability"] != "continuous",
        ),
        ("unit", "a unit of the file", lambda e: "unit" not in e or e["unit"] in units),
        (
            "enumeration",
            "an enumeration of the file, and only for type Enumeration",
            lambda e: e.get("enumeration") in (enumerations if e["type"] == "Enumeration" else {None}),
        ),
        (
            "start",
            "a start value for each parameter and input, and for none that is calculated",
            _start_is_right,
        ),
        (
            "dependencies",
            "names of variables of the file",
            lambda e: {_entry_name(d) for d in e.get("dependencies", ())} <= names,
        ),
        (
            "counts",
            "a repeated block of the file",
            lambda e: "counts" not in e or e["counts"] in _repeat_names(table),
        ),
        (
            "derivative",
            "the name of a variable of the file",
            lambda e: e.get("derivative", e["name"]) in names,
        ),
        (
            "clock",
            "the name of a clock of the file",
            lambda e: (
                "clock" not in e
                or e["clock"] in {v["name"] for v in table["variable"] if v["type"] == "Clock"}
            ),
        ),
        ("ports", f"one of {', '.join(PORTS)}, or none", lambda e: e.get("ports", PORTS[0]) in PORTS),
        ("repeat", "a count in [component]", lambda e: _repeat_is_counted(table["component"], e)),
    )


def _start_is_right(entry: Mapping[str, Any]) -> bool:
    default = DEFAULT_INITIAL.get((entry["causality"], entry["variability"]))
    needed = entry["causality"] == "input" or entry.get("initial", default) in {"exact", "approx"}
    return ("start" in entry) == needed


def _repeat_is_counted(head: Mapping[str, Any], entry: Mapping[str, Any]) -> bool:
    return "repeat" not in entry or isinstance(_repeat_count(head, entry["repeat"]), int)
