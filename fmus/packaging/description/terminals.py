"""terminalsAndIcons.xml of FMI 3.0: the icon, and the variables that a tool connects at once, as one plug.

A body has a terminal for its observed point, and one for each contact, sensor and mass; a Replay has one for each
channel. The terminal of an ImpactStop has the members of a body's contact: displacement and velocity in, applied
force and slopes out.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.model import ComponentDescription, Variable

MEMBER = "terminalsAndIcons/terminalsAndIcons.xml"
#: Corners of the icon, in mm for tools that follow the suggestion.
ICON = {"x1": "-10", "y1": "-10", "x2": "10", "y2": "10"}
#: Name of the terminal of a component whose inputs and outputs belong to no block.
WHOLE = "point"


def terminals(component: ComponentDescription, *, icon: bool = False) -> str:
    """Return the text of `MEMBER`, with the place of the icon on request; the same component gives the same bytes."""
    plugs: dict[str, dict[str, Variable]] = {}
    for variable in component.variables_of(3):
        if variable.causality in {"input", "output"} and variable.variability == "continuous":
            terminal, member = _place(variable)
            if terminal:
                plugs.setdefault(terminal, {})[member] = variable
    root = Element("fmiTerminalsAndIcons", fmiVersion="3.0")
    if icon:
        drawing = SubElement(root, "GraphicalRepresentation")
        SubElement(drawing, "CoordinateSystem", {**ICON, "suggestedScalingFactorTo_mm": "1"})
        SubElement(drawing, "Icon", ICON)
    parent = SubElement(root, "Terminals")
    for name, members in plugs.items():
        plug = SubElement(parent, "Terminal", name=name, matchingRule="plug")
        for member, variable in members.items():
            SubElement(
                plug,
                "TerminalMemberVariable",
                variableName=variable.name,
                memberName=member,
                variableKind="signal",
            )
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _place(variable: Variable) -> tuple[str, str]:
    """Return a variable's terminal and its name there; both are empty for modes, energies and records."""
    if variable.repeat == "mode" or variable.name.startswith(("energy.", "record.")):
        return "", ""
    if not variable.repeat:
        return WHOLE, variable.name
    if variable.repeat == "channel":
        # a channel of a recording has its own name
        member = variable.shown_name.removeprefix("channel[k].")
        return variable.name.removesuffix(f"_{member}"), member
    terminal = f"{variable.repeat}[{variable.repeat_index}]"
    # examples: contact[1].force; force[1] of mass 1
    return terminal, variable.name.replace(f"[{variable.repeat_index}]", "").removeprefix(
        f"{variable.repeat}."
    )
