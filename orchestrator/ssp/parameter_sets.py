"""Outside parameter sets of a system: one set changes its start values, several are the points of a sweep."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.messages import Argument, message
from vibroimpact.fmus.packaging.zip_members import opened
from vibroimpact.fmus.safe_xml import LARGEST_XML
from vibroimpact.orchestrator.scene.component_facts import ComponentFacts, StartValue
from vibroimpact.orchestrator.scene.component_numbers import gain_place
from vibroimpact.orchestrator.ssp.archive import SspArchive, undeclared_prefixes
from vibroimpact.orchestrator.ssp.flat import FlatSystem, Path
from vibroimpact.orchestrator.ssp.scene_tables import names_of
from vibroimpact.orchestrator.ssp.values import Parameter, read_parameter_set
from vibroimpact.orchestrator.ssp.xml_names import ssp_root

Sets = Mapping[str, tuple[Parameter, ...]]
_PARAMETERS = Argument("parameters")


def read_sets(archive: SspArchive, files: Sequence[FilePath]) -> dict[str, tuple[Parameter, ...]]:
    """Return parameter sets by the names of their files; a name without a file is a member of the archive."""
    sets: dict[str, tuple[Parameter, ...]] = {}
    for file in files:
        name = str(file)
        if file.exists():
            with opened(file, "SSV") as stream:
                content = stream.read(LARGEST_XML + 1)
            if len(content) > LARGEST_XML:
                raise ComponentFileError(f"{file}: expected XML of at most {LARGEST_XML} bytes, got more.")
            root, undeclared = ssp_root(content, name)
            archive.remarks += undeclared_prefixes(name, undeclared)
        else:
            root = archive.xml(archive.member(file.as_posix(), message(_PARAMETERS)))
        sets[name] = read_parameter_set(root, name, None, archive.remarks)
    return sets


def with_sets(
    tables: dict[str, Any], flat: FlatSystem, facts: Mapping[Path, ComponentFacts], sets: Sets
) -> None:
    """Put parameter sets into the tables of a scene: one as start values, several as its sweep.

    UsageError: a set has no parameter of the system, or several sets do not form a grid.
    """
    names = names_of(list(flat.components))
    points = [_point(name, parameters, flat, facts, names) for name, parameters in sets.items()]
    if len(points) == 1:
        swept = tables.get("sweep", {})
        for key, value in points[0].items():
            _give(tables, key, value)
            if isinstance(swept, dict):  # the scene's rules report other types
                swept.pop(key, None)
        return
    tables["sweep"] = {key: {"values": values} for key, values in _axes(points).items()}
    for key, value in points[0].items():
        if key not in tables["sweep"]:
            _give(tables, key, value)


def _point(
    name: str,
    parameters: tuple[Parameter, ...],
    flat: FlatSystem,
    facts: Mapping[Path, ComponentFacts],
    names: Mapping[Path, str],
) -> dict[str, StartValue]:
    """Return the start values in a set, by key of the scene."""
    values: dict[Path, dict[str, StartValue]] = {path: {} for path in facts}
    named = [one for parameter in parameters for one in flat.named(parameter)]
    connected = flat.connected()
    taken = [node for parameter in named for node in flat.apply(parameter, (), values, connected)]
    if not taken:
        raise UsageError(
            f"{name}: expected a parameter of this system such as {_example(facts, names)}, got none."
        )
    point: dict[str, StartValue] = dict(_gains(flat, values))
    for path, variable in dict.fromkeys(taken):
        if path not in flat.components:
            continue
        value = values[path][variable]
        items = facts[path].variables[variable].items
        point[f"{names[path]}.{variable}"] = items.get(value, value) if isinstance(value, str) else value
    return point


def _gains(
    flat: FlatSystem, values: Mapping[Path, Mapping[str, StartValue]]
) -> Iterator[tuple[str, StartValue]]:
    """Yield the gains of connections in a set, for gains that are components of the system."""
    given = {
        path: float(own["gain"])
        for path, own in values.items()
        if path not in flat.components and "gain" in own
    }
    for number, link in enumerate(flat.links(given) if given else (), start=1):
        if not given.keys().isdisjoint(link.through):
            yield f"connection[{number}].gain", link.gain


def _example(facts: Mapping[Path, ComponentFacts], names: Mapping[Path, str]) -> str:
    path, first = next(iter(facts.items()))
    settable = (variable.name for variable in first.variables.values() if variable.settable)
    return f"{names[path]}.{next(settable, 'parameter')}"


def _axes(points: list[dict[str, StartValue]]) -> dict[str, list[StartValue]]:
    """Return the values of each key in which points differ; the points must be all their combinations."""
    keys = dict.fromkeys(key for point in points for key in point)
    lacking = next((key for key in keys if any(key not in point for point in points)), None)
    if lacking is not None:
        raise UsageError(
            message(
                _PARAMETERS,
                f": expected sets of the same parameters, got some without {lacking}. Write it into each.",
            )
        )
    values = {key: list(dict.fromkeys(point[key] for point in points)) for key in keys}
    axes = {key: several for key, several in values.items() if len(several) > 1}
    different = {tuple(point[key] for key in axes) for point in points}
    if len(different) != len(points):
        raise UsageError(message(_PARAMETERS, ": expected sets that differ, got two that say the same."))
    if math.prod(map(len, axes.values())) != len(points):
        raise UsageError(
            message(
                _PARAMETERS,
                ": expected sets that differ in one number, or all combinations of several, got "
                f"{len(points)} sets of {', '.join(axes)}. Import each set by itself.",
            )
        )
    wrong = next((key for key, several in axes.items() if not all(map(_is_number, several))), None)
    if wrong is not None:
        raise UsageError(
            message(
                _PARAMETERS,
                f": expected sets that differ in numbers, got different {wrong}. Import each set by itself.",
            )
        )
    return axes


def _is_number(value: StartValue) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _give(tables: dict[str, Any], key: str, value: StartValue) -> None:
    place = gain_place(key)
    if place is not None:
        tables["connection"][place]["gain"] = value
        return
    component, _, variable = key.partition(".")
    tables["component"][component].setdefault("parameters", {})[variable] = value
