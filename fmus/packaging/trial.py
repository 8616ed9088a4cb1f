"""Trial of an export before it is written: it finds start values that the library refuses, and keeps the run.

The run is the export's reference result, in the layered standard FMI-LS-REF (1.0.0-alpha.1): a file with the role
`result`, named in the manifest.
"""

from __future__ import annotations

import csv
import hashlib
import io
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from vibroimpact.fmus.errors import ComponentError, UsageError
from vibroimpact.fmus.packaging.description import ComponentDescription, Experiment, literal
from vibroimpact.fmus.packaging.platform_names import library_suffix
from vibroimpact.fmus.packaging.trial_run import INSTANCE
from vibroimpact.fmus.processes.call import call
from vibroimpact.fmus.processes.python_child import ending

#: Folder of the layered standard's files.
FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
MANIFEST, RESULT = "fmi-ls-manifest.xml", "result.csv"
NAMESPACE = "http://fmi-standard.org/fmi-ls-manifest"
#: Steps of a reference result, at most and at least; largest count of its numbers, which reduces the steps.
MOST_INTERVALS, LEAST_INTERVALS, MOST_NUMBERS = 200, 20, 6000
#: Longest time for a run, s.
LIMIT = 120.0


@dataclass(frozen=True, slots=True)
class Trial:
    """A run of an export's library."""

    names: tuple[str, ...]
    """Names of the real outputs."""
    rows: Sequence[Sequence[float]]
    """Time, s, and values of the outputs at each communication point."""
    ended: str
    """Reason for an early end; empty if the run is complete."""
    warnings: tuple[str, ...]
    """Warnings of the library at the start."""


def tried(
    component: ComponentDescription,
    library: bytes,
    resources: Mapping[str, bytes],
    experiment: Experiment,
) -> Trial:
    """Run a component as it is described, by this machine's library, with only its resources to set values.

    Raise UsageError, with the library's own words, if it refuses the start values. Raise ComponentError if the process
    ends without an answer.
    """
    chosen = [v for v in component.variables_of(3) if v.causality == "output" and v.type == "Float64"]
    chosen = [v for v in chosen if v.variability == "continuous" and not v.dimensions]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = folder / f"library{library_suffix()}"
        path.write_bytes(library)
        for member, content in resources.items():
            (folder / member).parent.mkdir(parents=True, exist_ok=True)
            (folder / member).write_bytes(content)
        facts = {
            "library": str(path),
            "token": component.token,
            "resources": str(folder / "resources"),
            # event mode is needed only for contact laws of other FMUs, which nobody answers here
            "event_mode": component.event_mode and "contact" in component.repeats,
            "start": experiment.start_time,
            "stop": experiment.stop_time,
            "intervals": min(MOST_INTERVALS, max(LEAST_INTERVALS, MOST_NUMBERS // (len(chosen) or 1))),
            "references": [v.value_reference for v in chosen],
        }
        answer = _answer(component.name, facts)
    if answer["refusal"]:
        raise UsageError(f"{component.name}: {_text_of(answer['refusal'])}. Nothing was written.")
    names = tuple(v.name for v in chosen)
    return Trial(names, answer["rows"], _text_of(answer["ended"]), tuple(map(_text_of, answer["warnings"])))


def _text_of(message: str) -> str:
    """Return a library's log message without the names of instance and function."""
    return message.split(": ", 2)[-1] if message.startswith(f"{INSTANCE}: ") else message


def _answer(name: str, facts: Mapping[str, object]) -> dict[str, Any]:
    done = call("vibroimpact.fmus.packaging.trial_run:trial", facts, seconds=LIMIT)
    if done.is_late:
        raise ComponentError(f"{name}: expected a run within {LIMIT:g} s, got no answer.")
    if done.answer is None or done.code != 0:
        raise ComponentError(
            f"{name}: expected a run of its library, which {ending(done.code)}: {done.last_line or 'no message'}"
        )
    answer: dict[str, Any] = done.answer
    return answer


def reference_members(trial: Trial) -> dict[str, bytes]:
    """Return the members of an FMU that hold a run as its reference result."""
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(["time", *trial.names])
    writer.writerows([repr(value) for value in row] for row in trial.rows)
    content = table.getvalue().encode("utf-8")
    first, last = trial.rows[0][0], trial.rows[-1][0]
    summary = f"Outputs from {literal(first)} s to {literal(last)} s at {len(trial.rows)} points, nothing set"
    root = ElementTree.Element(
        "fmiReferences",
        {
            f"{{{NAMESPACE}}}fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            f"{{{NAMESPACE}}}fmi-ls-version": "1.0.0-alpha.1",
            f"{{{NAMESPACE}}}fmi-ls-description": "Layered Standard providing information on related files included in"
            " an FMU.",
        },
    )
    ElementTree.SubElement(
        root,
        "Related",
        type="text/csv",
        source=RESULT,
        role="result",
        description=summary + (f"; ended there: {trial.ended}" if trial.ended else ""),
        checksum=hashlib.sha3_256(content).hexdigest().upper(),
    )
    ElementTree.register_namespace("fmi-ls", NAMESPACE)
    ElementTree.indent(root)
    text = '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
    return {f"{FOLDER}/{MANIFEST}": text.encode("utf-8"), f"{FOLDER}/{RESULT}": content}
