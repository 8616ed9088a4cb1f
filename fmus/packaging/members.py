"""What an FMU that is written for others holds: libraries, sources, description, documentation, resources, a run."""

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

#: The member that says how many of each repeated block the description has: lines such as `modes 8`.
SIZES_MEMBER = "resources/sizes.txt"
#: The member with the value references that a description's, which count from 1 on, stand for; as resources.h has it.
REFERENCES_MEMBER = "resources/references.txt"
#: Where the icon is, by the version of FMI.
ICONS = {"2.0": "model.png", "3.0": "terminalsAndIcons/icon.png"}
#: The last second that has a year of four digits.
YEAR_9999 = 253_402_300_799
#: Digits at a token's end that are an export's own, as instance.h has them.
OWN_DIGITS = 12


@dataclass(frozen=True, slots=True)
class Contents:
    """What an FMU is made of."""

    original: ComponentDescription
    """As it is compiled in; `component` is as it is described."""
    component: ComponentDescription
    fmi: str
    """`3.0` or `2.0`."""
    edition: Edition | None
    """None: a full description, for this package's own importer."""
    experiment: Experiment
    """The run that is tried, and kept as a reference result."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """How many of each repeated block are described, where that is not all."""
    resources: Mapping[str, bytes] = field(default_factory=dict)
    """Further members, all below `resources/`."""
    platform: str | None = None
    """As in `export_fmu`."""
    note: Note = lambda _: None
    """Told what is compiled for another machine, and what the library warns of."""


def component_of(name: str) -> ComponentDescription:
    """Return a component as it is compiled in, by its name; an unknown name raises ComponentFileError."""
    return read_component(component_folder(name) / "variables.toml")


def edition_of(experiment: Experiment, *, dated: bool = True) -> Edition:
    """Return this version of the package; the date is now, or that of `SOURCE_DATE_EPOCH`."""
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "")
    moment = time.gmtime(min(int(seconds), YEAR_9999) if seconds.isdecimal() else None)
    date = time.strftime("%Y-%m-%dT%H:%M:%SZ", moment) if dated else ""
    return Edition(metadata.version("vibroimpact"), date, experiment)


def members_of(contents: Contents) -> dict[str, bytes]:
    """Return the members of an FMU.

    ComponentFileError: the component was not built. ComponentError: there is no library for a platform, and nothing to
    compile it with; or a trial of it ended without an answer. UsageError: the library refuses the start values.
    """
    original, fmi = contents.original, contents.fmi
    with zipfile.ZipFile(fmu_path(original.name, fmi)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    own = next(content for member, content in members.items() if member.startswith("binaries/"))
    resources = dict(contents.resources)
    if contents.counts:
        lines = (f"{plural(block)} {count}\n" for block, count in contents.counts.items())
        resources[SIZES_MEMBER] = "".join((*lines, *_hidden_laws(contents))).encode("ascii")
    component = contents.component
    if fmi == "3.0" and (contents.edition is not None or resources):
        resources[REFERENCES_MEMBER], component = _numbered(component)
    # a trial runs by FMI 3.0, where the token of an export says that it has a list of references
    trial_token = original.token if fmi == "2.0" else _own_token(original.token, resources)
    trial = tried(replace(component, token=trial_token), own, resources, contents.experiment)
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


def _hidden_laws(contents: Contents) -> Iterator[str]:
    """Yield the line that lets messages name only the laws that the description has."""
    ports = {v.ports for v in contents.component.variables if v.repeat == "contact"}
    if "external" in {v.ports for v in contents.original.variables} - ports:
        yield "external_laws 0\n"


def _for_people(
    component: ComponentDescription, fmi: str, edition: Edition, trial: Trial
) -> dict[str, bytes]:
    """Return the members that a person looks at in a tool: icon, terminals, page, reference result."""
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
    """Return the list of value references, and the component whose are the places of its variables, from 1 on.

    OMSimulator takes the references in FMI 3.0's dependencies for places, and refuses those beyond the last.
    """
    variables = component.variables_of(3)
    lines = (f"{variable.value_reference}\n" for variable in variables)
    placed = tuple(replace(variable, value_reference=place) for place, variable in enumerate(variables, 1))
    return "".join(lines).encode("ascii"), replace(component, variables=placed)


def _own_token(token: str, resources: Mapping[str, bytes]) -> str:
    """Return a token of which the last digits follow from the resources.

    libcosim takes two FMUs of one token for one, and gives both the resources of the first.
    """
    if not resources:
        return token
    digest = hashlib.sha256()
    for name in sorted(resources):
        digest.update(name.encode() + b"\0" + hashlib.sha256(resources[name]).digest())
    return f"{token[: -OWN_DIGITS - 1]}{digest.hexdigest()[:OWN_DIGITS]}}}"


def _for_platforms(members: Mapping[str, bytes], contents: Contents) -> dict[str, bytes]:
    """Return the members with libraries for other machines in place of that of this one, or beside it."""
    here, component = this_platform(), contents.original
    platforms = chosen_platforms(contents.platform or "all")
    own = {name: content for name, content in members.items() if name.startswith("binaries/")}
    rest = {name: content for name, content in members.items() if name not in own}
    binaries = members_for(
        lambda p: library_for(component, p, contents.note), component.name, platforms, contents.fmi
    )
    # what a release leaves out is this machine's own, if it is none of those
    return rest | (own if contents.platform is None and here.name not in TARGETS else {}) | binaries
