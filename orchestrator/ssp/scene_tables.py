"""Tables of a scene from a flat system, with notes on choices for values that the system leaves open."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.importer.specification import RunAs
from vibroimpact.orchestrator.scene.component_facts import NUMERIC_KINDS, ComponentFacts
from vibroimpact.orchestrator.scene.problems import quoted
from vibroimpact.orchestrator.ssp.flat import FlatSystem, Link, Node, Path
from vibroimpact.orchestrator.ssp.names import SSD_FILE
from vibroimpact.orchestrator.ssp.refusal import RefusalError
from vibroimpact.orchestrator.ssp.structure import Structure

SAMPLES = 1000
"""Default number of samples of each output, and most of them where steps are longer."""
MOST_RECORDED = 100
OWN_TABLES = ("component", "connection")
"""Tables of a scene that SSP expresses itself."""
_ROUNDED = 1e-9
"""Part of a number of steps that is rounding."""
_NOT_OF_A_NAME = re.compile(r"[^A-Za-z0-9_]")


def names_of(paths: Sequence[Path]) -> dict[Path, str]:
    """Return a valid name in a scene for each component.

    >>> names_of([("rig", "body"), ("stop 1",), ("rig_body",)])
    {('rig', 'body'): 'rig_body', ('stop 1',): 'stop_1', ('rig_body',): 'rig_body_2'}
    """
    names: dict[str, Path] = {}
    for path in paths:
        plain = _NOT_OF_A_NAME.sub("_", "_".join(path))
        plain = name = f"_{plain}" if plain[0].isdigit() else plain
        count = 1
        while name in names:
            count += 1
            name = f"{plain}_{count}"
        names[name] = path
    return {path: name for name, path in names.items()}


def noted_tables(structure: Structure) -> dict[str, Any]:
    """Return the tables in this package's annotations of a system; empty for a system from elsewhere."""
    where = f"{SSD_FILE}: annotation"
    try:
        tables = parse_toml(structure.tables)
    except ValueError as error:
        raise RefusalError(where, "TOML", f"an error: {error}", "Take the annotation out.") from None
    for name in OWN_TABLES:
        if name in tables:
            raise RefusalError(where, f"a scene without {name}", "one", "The system itself says it.")
    return tables


class Chosen(NamedTuple):
    """The FMU of a component, as a scene has it."""

    fmu: str
    """A file, or a component of this package."""
    fmi: str | None
    run_as: RunAs


def scene_tables(
    structure: Structure,
    flat: FlatSystem,
    fmus: Mapping[Path, Chosen],
    facts: Mapping[Path, ComponentFacts],
) -> tuple[dict[str, Any], list[str]]:
    """Return the tables of a scene, and notes for a person; `fmus` has the FMU of each component."""
    names, values = names_of(list(flat.components)), flat.start_values()
    noted = noted_tables(structure)
    notes: list[str] = []
    ours = bool(noted)
    if not ours:
        noted["scene"] = {"title": structure.name, "units": "SI"}
    tables: dict[str, Any] = {name: noted.pop(name) for name in ("scene",) if name in noted}
    tables["component"] = {name: _component(fmus[path], values[path]) for path, name in names.items()}
    links = flat.links()
    if links:
        tables["connection"] = [_connection(link, names) for link in links]
    tables |= noted
    notes += _times(tables, structure, facts.values(), connected=bool(links))
    if not ours:
        notes += _record(tables, flat, names, facts)
    return tables, notes


def _component(chosen: Chosen, values: Mapping[str, Any]) -> dict[str, Any]:
    table: dict[str, Any] = {"fmu": chosen.fmu}
    if chosen.fmi:
        table["fmi"] = chosen.fmi
    if chosen.run_as != "auto":
        table["run_as"] = chosen.run_as
    return {**table, "parameters": dict(values)} if values else table


def _connection(link: Link, names: Mapping[Path, str]) -> dict[str, Any]:
    table: dict[str, Any] = {"from": _reference(link.source, names), "to": _reference(link.target, names)}
    if link.gain != 1.0 or link.gain_unit is not None:
        table["gain"] = link.gain
    if link.offset:
        table["offset"] = link.offset
    if link.table is not None:
        table["mapping"] = [list(pair) for pair in link.table]
    return table if link.gain_unit is None else {**table, "gain_unit": link.gain_unit}


def _reference(node: Node, names: Mapping[Path, str]) -> str:
    return f"{names[node.element]}.{node.name}"


def _times(tables: dict[str, Any], structure: Structure, facts: Any, *, connected: bool) -> Iterator[str]:
    """Fill in the recorded time and the macro step."""
    start = structure.start_time or 0.0
    record, execution = _table(tables, "record"), _table(tables, "execution")
    if "recorded_time" not in record:
        if structure.stop_time is None:
            hint = "Say how long it runs: --set record.recorded_time=10."
            raise RefusalError(
                f"{SSD_FILE}: DefaultExperiment: stopTime", "the end of the run, s", "none", hint
            )
        if start and not structure.stop_time > start:
            got = f"{structure.stop_time:g} beside the start {start:g}"
            raise RefusalError(f"{SSD_FILE}: DefaultExperiment: stopTime", "an end after the start", got)
        record["recorded_time"] = structure.stop_time - start
    if start:
        record["start_time"] = start
    if "macro_step" in execution or not connected:
        return
    own = [one.step for one in facts if one.step is not None]
    step = structure.step if structure.step is not None else min(own, default=None)
    if step is not None:
        execution["macro_step"] = step
        if structure.step is None:
            yield f"execution.macro_step = {step:g} s, the smallest step that an FMU proposes"


def _record(
    tables: dict[str, Any], flat: FlatSystem, names: Mapping[Path, str], facts: Mapping[Path, ComponentFacts]
) -> Iterator[str]:
    """Record all outputs that the system names, unless the scene selects its variables."""
    record = tables["record"]
    duration = record.get("recorded_time")
    if (
        record.keys() - {"recorded_time", "start_time"}
        or not isinstance(duration, int | float)
        or duration <= 0.0
    ):
        return
    outputs = [
        f"{names[path]}.{name}"
        for path, component in flat.components.items()
        for name, connector in component.connectors.items()
        if connector.kind == "output" and _is_number(facts[path], name)
    ]
    if outputs:
        rate, often = _sampling(tables, duration)
        record |= {"variables": outputs[:MOST_RECORDED], "rate": rate}
        count = len(outputs[:MOST_RECORDED])
        yield f"record.variables are the {count} outputs that the system names, {often}"


def _sampling(tables: Mapping[str, Any], duration: float) -> tuple[float, str]:
    """Return the default rate of samples, and its description: at ends of steps, since a sample cuts a step."""
    step = tables["execution"].get("macro_step")
    if not isinstance(step, int | float) or not 0.0 < step <= duration:
        return SAMPLES / duration, f"{SAMPLES} samples of each"
    steps = max(1, math.ceil(duration / step / SAMPLES * (1.0 - _ROUNDED)))
    each = "each step" if steps == 1 else f"each {steps} steps"
    return 1.0 / (steps * step), f"at the end of {each}"


def _is_number(facts: ComponentFacts, name: str) -> bool:
    variable = facts.variables.get(name)
    return variable is not None and variable.scalar and variable.kind in NUMERIC_KINDS


def _table(tables: dict[str, Any], name: str) -> dict[str, Any]:
    table = tables.setdefault(name, {})
    if not isinstance(table, dict):
        raise RefusalError(f"{SSD_FILE}: annotation: {name}", "a table", quoted(table))
    return table
