"""Members of an FMU for other tools: libraries, sources, description, documentation, resources, a run."""

from __future__ import annotations

import hashlib
import os
import time
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from importlib import metadata

from vibroimpact.fmus.packaging.build import documentation
from vibroimpact.fmus.packaging.cross import SHIPPED, Note, chosen_platforms, library_for, members_for
from vibroimpact.fmus.packaging.description import (
    TERMINALS_MEMBER,
    ComponentDescription,
    Edition,
    Experiment,
    model_description,
    plural,
    read_component,
    terminals,
)
from vibroimpact.fmus.packaging.documentation_page import MEMBER as PAGE
from vibroimpact.fmus.packaging.documentation_page import page
from vibroimpact.fmus.packaging.platform_names import TARGETS, this_platform
from vibroimpact.fmus.packaging.sources import c_files, source_members
from vibroimpact.fmus.packaging.trial import FOLDER as REFERENCE
from vibroimpact.fmus.packaging.trial import MANIFEST, RESULT, Trial, reference_members, tried
from vibroimpact.fmus.shipped import component_folder, fmu_path

#: Member with the number of each repeated block in the description, in lines like `modes 8`.
SIZES_MEMBER = "resources/sizes.txt"
#: Line of that member by which the library knows that the description has the clock of the strobes.
STROBES_LINE = "strobes 1\n"
#: Member with the value reference behind each reference of the description, from 1 on; its format is in resources.h.
REFERENCES_MEMBER = "resources/references.txt"
#: Path of the icon for each version of FMI.
ICONS = {"2.0": "model.png", "3.0": "terminalsAndIcons/icon.png"}
#: Last second of the year 9999.
YEAR_9999 = 253_402_300_799
#: Number of digits at the end of a token that differ between exports; instance.h has the same number.
OWN_DIGITS = 12


@dataclass(frozen=True, slots=True)
class Contents:
    """Ingredients of an FMU."""

    original: ComponentDescription
    """The component as compiled; `component` is as described."""
    component: ComponentDescription
    fmi: str
    """Version of FMI, `3.0` or `2.0`."""
    edition: Edition | None
    """Edition of the export; None: a full description, for this package's own importer."""
    experiment: Experiment
    """Experiment of the trial run, which is kept as a reference result."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Number of each repeated block in the description, where it is below the compiled number."""
    resources: Mapping[str, bytes] = field(default_factory=dict)
    """Further members, all below `resources/`."""
    platform: str | None = None
    """See `export_fmu`."""
    note: Note = lambda _: None
    """Function that gets a line about each compilation for another machine, and each warning of the library."""


def component_of(name: str) -> ComponentDescription:
    """Return a component as compiled, by its name; raise ComponentFileError for an unknown name."""
    return read_component(component_folder(name) / "variables.toml")


def edition_of(experiment: Experiment, *, dated: bool = True) -> Edition:
    """Return the edition of this version of the package, dated now or by `SOURCE_DATE_EPOCH`."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = time.gmtime(min(int(seconds), YEAR_9999) if seconds.isdecimal() else None)
    date = time.strftime("%Y-%m-%dT%H:%M:%SZ", moment) if dated else ""
    return Edition(metadata.version("vibroimpact"), date, experiment)


def members_of(contents: Contents) -> dict[str, bytes]:
    """Return the members of an FMU.

    Raise ComponentFileError if the component was not built, and UsageError if the library refuses the start values.
    Raise ComponentError if a platform has no library and no compiler, or if the trial run ended without an answer.
    """
    original, fmi = contents.original, contents.fmi
    with zipfile.ZipFile(fmu_path(original.name, fmi)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    own = next(content for member, content in members.items() if member.startswith("binaries/"))
    resources = dict(contents.resources)
    sizes = "".join(_sizes(contents))
    strobes = STROBES_LINE if any(v.type == "Clock" for v in contents.component.variables_of(3)) else ""
    if sizes or strobes:
        resources[SIZES_MEMBER] = (sizes + strobes).encode("ascii")
    component = contents.component
    if fmi == "3.0" and (contents.edition is not None or resources):
        resources[REFERENCES_MEMBER], component = _numbered(component)
    # the trial runs by FMI 3.0, where the token of an export announces a list of references
    trial_token = original.token if fmi == "2.0" else _own_token(original.token, resources)
    # no step of the trial ends at a strobe
    plain = {**resources, SIZES_MEMBER: sizes.encode("ascii")} if strobes else resources
    trial = tried(replace(component, token=trial_token), own, plain, contents.experiment)
    component = replace(component, token=_own_token(original.token, resources))
    for warning in trial.warnings:
        contents.note(f"{component.name}: {warning}")
    if contents.platform is not None or SHIPPED.is_dir():
        members = _for_platforms(members, contents)
    if contents.edition is not None:
        members |= source_members(original, fmi)
    text = model_description(component, fmi, contents.edition, c_files(members))
    members |= {"modelDescription.xml": text.encode("utf-8"), **documentation(component)}
    if contents.edition is not None:
        members |= _for_people(component, fmi, contents.edition, trial)
    return members | resources


def _sizes(contents: Contents) -> Iterator[str]:
    """Yield the lines of the sizes; one limits the laws in messages to those of the description."""
    if not contents.counts:
        return
    yield from (f"{plural(block)} {count}\n" for block, count in contents.counts.items())
    ports = {v.ports for v in contents.component.variables if v.repeat == "contact"}
    if "external" in {v.ports for v in contents.original.variables} - ports:
        yield "external_laws 0\n"
    if any(v.causality == "structuralParameter" for v in contents.component.variables):
        yield "structural 1\n"


def _for_people(
    component: ComponentDescription, fmi: str, edition: Edition, trial: Trial
) -> dict[str, bytes]:
    """Return the members for a person with a tool: icon, terminals, page, reference result."""
    members = reference_members(trial) if trial.rows else {}
    icon = ICONS[fmi]
    members[icon] = component.source.with_name("icon.png").read_bytes()
    further = [
        ("README.md", "Read me: the same in plain text, with all variables that the component has"),
        ("licenses/license.txt", "Licence"),
    ]
    if fmi == "3.0":
        members[TERMINALS_MEMBER] = terminals(component, icon=True).encode("utf-8")
        further.append((f"../{TERMINALS_MEMBER}", "Terminals: which variables a tool may connect at once"))
    if trial.rows:
        further += [
            (
                f"../{REFERENCE}/{RESULT}",
                "Reference result: what the outputs are in a run where nothing is set",
            ),
            (f"../{REFERENCE}/{MANIFEST}", "What the reference result is, after FMI-LS-REF"),
        ]
    readme, equations = (
        component.source.with_name(name).read_text(encoding="utf-8")
        for name in ("README.md", "equations.html")
    )
    text = page(component, readme, equations, edition, f"../{icon}", further)
    members[PAGE] = text.encode("utf-8")
    return members


def _numbered(component: ComponentDescription) -> tuple[bytes, ComponentDescription]:
    """Return the list of value references, and the component with the places of its variables as references, from 1.

    OMSimulator takes the references in FMI 3.0's dependencies for places, and refuses larger ones.
    """
    variables = component.variables_of(3)
    lines = (f"{variable.value_reference}\n" for variable in variables)
    placed = tuple(replace(variable, value_reference=place) for place, variable in enumerate(variables, 1))
    return "".join(lines).encode("ascii"), replace(component, variables=placed)


def _own_token(token: str, resources: Mapping[str, bytes]) -> str:
    """Return a token whose last digits depend on the resources.

    libcosim takes two FMUs with the same token for one FMU, and gives both the resources of the first.
    """
    if not resources:
        return token
    digest = hashlib.sha256()
    for name in sorted(resources):
        digest.update(name.encode() + b"\0" + hashlib.sha256(resources[name]).digest())
    return f"{token[: -OWN_DIGITS - 1]}{digest.hexdigest()[:OWN_DIGITS]}}}"


def _for_platforms(members: Mapping[str, bytes], contents: Contents) -> dict[str, bytes]:
    """Return the members with libraries for other machines in addition to this machine's library, or instead of it."""
    here, component = this_platform(), contents.original
    platforms = chosen_platforms(contents.platform or "all")
    own = {name: content for name, content in members.items() if name.startswith("binaries/")}
    rest = {name: content for name, content in members.items() if name not in own}
    binaries = members_for(
        lambda p: library_for(component, p, contents.note), component.name, platforms, contents.fmi
    )
    # a release contains no library for this machine if the machine is no target: keep its own
    return rest | (own if contents.platform is None and here.name not in TARGETS else {}) | binaries
