"""Implementation of `vibroimpact fmu`: list, build, check and export components."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from vibroimpact.fmus.errors import ComponentFileError, UsageError
from vibroimpact.fmus.operations.fmu_build import BuildFmus
from vibroimpact.fmus.operations.fmu_check import CheckFmus
from vibroimpact.fmus.operations.fmu_list import ListFmus
from vibroimpact.fmus.packaging.archive import platforms, unpack
from vibroimpact.fmus.packaging.build import BUILT, build, read_components, update_readmes
from vibroimpact.fmus.packaging.export import export_fmu
from vibroimpact.fmus.packaging.python_fmus import build_user_contact_law
from vibroimpact.fmus.printing import table
from vibroimpact.fmus.shipped import FOLDERS, component_name, components, fmu_path
from vibroimpact.fmus.terminal import note, say, wide_terminal


def print_components(_: ListFmus) -> None:
    """Show every component, its FMUs and their platforms."""
    rows = table("Components", "<component", "<FMI", ">variables", "<platforms", "<file")
    for component in read_components():
        for version in FOLDERS:
            count = len(component.variables_of(int(version[0])))
            rows.add_row(component.name, version, str(count), *_binaries(component.name, version))
    wide_terminal().print(rows)


def _binaries(name: str, version: str) -> tuple[str, str]:
    try:
        path = fmu_path(name, version)
    except ComponentFileError:
        return "-", "not built: vibroimpact fmu build"
    return ", ".join(platforms(unpack(path))), str(path)


def build_into(options: BuildFmus) -> None:
    """Compile all components for this machine, into a folder or into the package."""
    output = options.output or BUILT
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as problem:
        reason = problem.strerror or problem
        raise UsageError(
            f"--output: expected a folder to fill, got {str(output)[:200]!r}: {reason}."
        ) from problem
    for path in (*update_readmes(), *build(output)):
        say(str(path))


def check_all(options: CheckFmus) -> None:
    """Check FMUs, by default all of the package: raise refusals, print doubts and remarks.

    Raise ComponentFileError for an FMU that will not run; with `strict`, also for one that may run wrong.
    """
    # loads fmpy, which an export does not need
    from vibroimpact.fmus.packaging.check import check_fmu, kinds_of
    from vibroimpact.fmus.packaging.model_description import Grade

    paths = options.files or [fmu_path(name, version) for name in components() for version in FOLDERS]
    found = [(path, finding) for path in paths for finding in check_fmu(path)]
    refusing = (Grade.refused, Grade.doubt) if options.strict else (Grade.refused,)
    for path, finding in found:
        if finding.grade not in refusing:
            say(f"{path}: {finding.line()}")
    refused = [f"{path}: {finding.line()}" for path, finding in found if finding.grade in refusing]
    if refused:
        raise ComponentFileError("\n".join(refused))
    for path in options.files or ():
        say(f"{path}: {kinds_of(path)}")
    counts = Counter(finding.grade for _, finding in found)
    doubts, remarks = counts[Grade.doubt], counts[Grade.remark]
    what = [_counted(doubts, "doubt")] * bool(doubts) + [_counted(remarks, "remark")] * bool(remarks)
    say(f"{_counted(len(paths), 'FMU')} checked: {', '.join(what) or 'no problems'}.")


def _counted(number: int, noun: str) -> str:
    """Return a number with its noun, in the plural where needed."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def export_user_law(law: Path | None, output: Path | None, given: Sequence[str]) -> Path:
    """Write the FMU of a user's contact law; raise UsageError for `given`, options that a law does not have."""
    if law is None:
        raise UsageError("--law: expected the Python file of your law, got nothing. Add --law my_law.py.")
    if given:
        raise UsageError(f"{given[0]}: a contact law has none of its own; leave the option out.")
    return build_user_contact_law(law, output or law.with_suffix(".fmu"))


def export_component(
    component: str,
    output: Path | None,
    counts: Mapping[str, Any],
    changes: Sequence[str] | None,
    fmi: str,
    platform: str | None,
    **kinds: Any,
) -> Path:
    """Write the FMU of a component with the start values of `NAME=VALUE`."""
    path = output or Path(f"{component_name(component)}.fmu")
    starts = None if changes is None else dict(map(_start, changes))
    return export_fmu(
        component, path, **counts, **kinds, starts=starts, fmi=fmi, platform=platform, note=note
    )


def _start(change: str) -> tuple[str, str]:
    name, equals, value = change.partition("=")
    if not equals or not name.strip():
        raise UsageError(f"--set: expected NAME=VALUE, got {change[:200]!r}. For example: --set mass=2")
    return name.strip(), value.strip()
