"""terminalsAndIcons.xml of FMI 3.0: which variables belong to one plug, so that a tool connects them at once; the icon.

A body has a terminal for its observed point, and one for each contact, sensor and mass; a Replay one for each channel.
The terminal of an ImpactStop has the members of a body's contact: displacement and velocity in, applied force and
slopes out.
"""

from __future__ import annotations

from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from vibroimpact.fmus.packaging.description.model import ComponentDescription, Variable

MEMBER = "terminalsAndIcons/terminalsAndIcons.xml"
#: Corners of the icon, mm where a tool takes the suggestion.
ICON = {"x1": "-10", "y1": "-10", "x2": "10", "y2": "10"}
#: What the terminal of a component is called whose inputs and outputs have no block.
WHOLE = "point"


def terminals(component: ComponentDescription, *, icon: bool = False) -> str:
    """Return the text of `MEMBER`, with the place of the icon beside it; the same component gives the same bytes."""
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
    """Return a variable's terminal and its name there; of modes and of sums of energy none."""
    if variable.repeat == "mode" or variable.name.startswith(("energy.", "record.")):
        return "", ""
    if not variable.repeat:
        return WHOLE, variable.name
    if variable.repeat == "channel":
        # a channel of a recording is called by its own name
        member = variable.shown_name.removeprefix("channel[k].")
        return variable.name.removesuffix(f"_{member}"), member
    terminal = f"{variable.repeat}[{variable.repeat_index}]"
    # contact[1].force, and force[1] of mass 1
    return terminal, variable.name.replace(f"[{variable.repeat_index}]", "").removeprefix(
        f"{variable.repeat}."
    )
