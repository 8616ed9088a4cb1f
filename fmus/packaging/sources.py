"""A component's C sources as members of an FMU, so that any tool can compile it for another platform.

The folders of the core and all other sources lie below `sources/`, the only folder of headers. The sizes are in a
header. FMI 2.0 cannot pass further folders or definitions to a tool.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.build import NATIVE, beside_core, is_part, sizes
from vibroimpact.fmus.packaging.description import ComponentDescription, c_header, header_name

BUILD_DESCRIPTION = "sources/buildDescription.xml"
SIZES_HEADER = "sizes.h"


def source_members(component: ComponentDescription, fmi: str, native: Path = NATIVE) -> dict[str, bytes]:
    """Return the members below `sources/` of an FMU, without the adapter of the other version of FMI.

    The component must be as compiled, not as edited for an export: value references are places in its table.
    """
    other = "fmi2" if fmi.startswith("3") else "fmi3"
    core = native / "core"
    files = {path.relative_to(core).as_posix(): path for path in core.rglob("*.[ch]")}
    files = {name: path for name, path in files.items() if is_part(component, Path(name))}
    for folder in beside_core(component, native):
        files |= {path.name: path for path in folder.glob("*.[ch]") if not path.name.startswith(other)}
    members = {name: path.read_bytes() for name, path in sorted(files.items())}
    members[header_name(component)] = c_header(component).encode("utf-8")
    members[SIZES_HEADER] = _sizes_header(component).encode("ascii") + members[SIZES_HEADER]
    members = {f"sources/{name}": content for name, content in members.items()}
    if fmi.startswith("3"):
        members[BUILD_DESCRIPTION] = _build_description(component, members).encode("utf-8")
    return members


def c_files(members: Mapping[str, bytes]) -> list[str]:
    """Return the names of the files to compile, relative to `sources`, as a description lists them."""
    folder = "sources/"
    return [name.removeprefix(folder) for name in members if name.startswith(folder) and name.endswith(".c")]


def _sizes_header(component: ComponentDescription) -> str:
    lines = (f"#define {name} {value}\n" for name, value in sizes(component).items())
    return "/* The largest bodies that this component is compiled for. */\n" + "".join(lines)


def _build_description(component: ComponentDescription, members: Mapping[str, bytes]) -> str:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = SubElement(root, "BuildConfiguration", modelIdentifier=component.name)
    files = SubElement(configuration, "SourceFileSet", language="C11")
    for name in c_files(members):
        SubElement(files, "SourceFile", name=name)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"
