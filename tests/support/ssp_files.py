"""SSP archives written by hand, in the style of other tools."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

HEAD = (
    '<ssd:SystemStructureDescription xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription" '
    'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" '
    'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
    'xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
    'xmlns:osp="http://opensimulationplatform.com/SSP/OSPAnnotations" name="by hand" version="{version}">'
)
STEP = (
    '<ssd:Annotations><ssc:Annotation type="com.opensimulationplatform"><osp:Algorithm>'
    '<osp:FixedStepAlgorithm baseStepSize="{step}"/></osp:Algorithm></ssc:Annotation></ssd:Annotations>'
)


def ssd(
    elements: str,
    connections: str = "",
    *,
    connectors: str = "",
    bindings: str = "",
    units: str = "",
    times: str = 'stopTime="2.0"',
    step: float | None = 0.125,
    version: str = "1.0",
    more: str = "",
) -> str:
    """Return the description of a system with these parts, each as XML."""
    note = "" if step is None else STEP.format(step=step)
    return (
        HEAD.format(version=version)
        + system("system", elements, connections, connectors=connectors, bindings=bindings)
        + (f"<ssd:Units>{units}</ssd:Units>" if units else "")
        + f"<ssd:DefaultExperiment {times}>{note}</ssd:DefaultExperiment>{more}</ssd:SystemStructureDescription>"
    )


def system(
    name: str, elements: str, connections: str = "", *, connectors: str = "", bindings: str = ""
) -> str:
    """Return a system."""
    return (
        f'<ssd:System name="{name}">'
        + (f"<ssd:Connectors>{connectors}</ssd:Connectors>" if connectors else "")
        + (f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else "")
        + f"<ssd:Elements>{elements}</ssd:Elements>"
        + (f"<ssd:Connections>{connections}</ssd:Connections>" if connections else "")
        + "</ssd:System>"
    )


def component(name: str, source: str, connectors: str = "", bindings: str = "", more: str = "") -> str:
    """Return a component."""
    return (
        f'<ssd:Component name="{name}" source="{source}" {more}>'
        + (f"<ssd:Connectors>{connectors}</ssd:Connectors>" if connectors else "")
        + (f"<ssd:ParameterBindings>{bindings}</ssd:ParameterBindings>" if bindings else "")
        + "</ssd:Component>"
    )


def connector(name: str, kind: str, unit: str = "") -> str:
    """Return a connector of a real number."""
    known = f' unit="{unit}"' if unit else ""
    return f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{known}/></ssd:Connector>'


def connection(start: str, end: str, inner: str = "", more: str = "") -> str:
    """Return a connection of `element.connector`, or `connector` of the system itself."""
    ends = ""
    for side, place in (("start", start), ("end", end)):
        element, _, name = place.rpartition(".")
        ends += (f'{side}Element="{element}" ' if element else "") + f'{side}Connector="{name}" '
    return f"<ssd:Connection {ends}{more}>{inner}</ssd:Connection>"


def factor(value: float, offset: float = 0.0) -> str:
    """Return a linear transformation."""
    return f'<ssc:LinearTransformation factor="{value}" offset="{offset}"/>'


def values(parameters: Mapping[str, str], prefix: str = "", mapping: str = "", units: str = "") -> str:
    """Return an inline binding of parameters, each with its XML."""
    known = f"<ssv:Units>{units}</ssv:Units>" if units else ""
    mapped = f"<ssd:ParameterMapping>{mapping}</ssd:ParameterMapping>" if mapping else ""
    start = f'<ssd:ParameterBinding prefix="{prefix}">' if prefix else "<ssd:ParameterBinding>"
    return f"{start}<ssd:ParameterValues>{ssv(parameters, known)}</ssd:ParameterValues>{mapped}</ssd:ParameterBinding>"


def ssv(parameters: Mapping[str, str], more: str = "") -> str:
    """Return a parameter set with its namespaces."""
    inner = "".join(
        f'<ssv:Parameter name="{name}">{value}</ssv:Parameter>' for name, value in parameters.items()
    )
    spaces = (
        'xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"'
    )
    head = f'<ssv:ParameterSet {spaces} version="1.0" name="p">'
    return f"{head}<ssv:Parameters>{inner}</ssv:Parameters>{more}</ssv:ParameterSet>"


def real(value: float, unit: str = "") -> str:
    """Return the value of a parameter."""
    return f'<ssv:Real value="{value}"' + (f' unit="{unit}"/>' if unit else "/>")


def mapping(*entries: str) -> str:
    """Return a parameter mapping."""
    return f'<ssm:ParameterMapping version="1.0">{"".join(entries)}</ssm:ParameterMapping>'


def entry(source: str, target: str, inner: str = "") -> str:
    """Return an entry of a mapping."""
    return f'<ssm:MappingEntry source="{source}" target="{target}">{inner}</ssm:MappingEntry>'


def archive(path: Path, description: str, members: Mapping[str, bytes | Path] = {}) -> Path:
    """Write an archive."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("SystemStructure.ssd", description)
        for name, content in members.items():
            file.writestr(name, content.read_bytes() if isinstance(content, Path) else content)
    return path


def changed(path: Path, target: Path, member: str, content: bytes | None) -> Path:
    """Write a copy of an archive with other content of one member, or without it."""
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as file:
        for name in source.namelist():
            if name != member:
                file.writestr(name, source.read(name))
        if content is not None:
            file.writestr(member, content)
    return target
