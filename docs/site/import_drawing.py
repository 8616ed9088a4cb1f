"""Draw the imports between rooms: `python docs/site/import_drawing.py` writes docs/imports.svg.

docs/architecture.md shows the drawing. The floors come from the import-linter contracts in pyproject.toml, the arrows
from the imports in the files. A test compares the drawing in docs with a new one.
"""

from __future__ import annotations

import ast
import tomllib
from collections import Counter
from collections.abc import Iterator
from functools import cache
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DRAWING = ROOT / "docs" / "imports.svg"
LAYERS = ("hardware", "orchestrator", "analysis", "fmus")
PREFIX = "vibroimpact."
#: Numbers of imports from which an arrow is thicker: finer steps would change the drawing with every import.
THICKER = (4, 13)
#: Height of a row, width of a box, width of a gutter, top and margin, px.
ROW, BOX, GUTTER, TOP, MARGIN = 27, 116, 112, 64, 16
BULGE = 11
COLOURS = ("#7b3294", "#2166ac", "#1b7837", "#b2622a")


def modules() -> dict[str, Path]:
    """Return the file of every module of the layers, by its dotted name without `vibroimpact`."""
    found = {}
    for layer in LAYERS:
        for path in sorted((ROOT / layer).rglob("*.py")):
            name = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            found[name.removesuffix(".__init__")] = path
    return found


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements within a node, at any depth, without expressions, which are most of a tree."""
    for block in ("body", "handlers", "orelse", "finalbody", "cases"):
        for statement in getattr(node, block, ()):
            yield statement
            yield from statements(statement)


def imported_names(path: Path) -> set[str]:
    """Return the package's own modules that a file imports, and possible modules, without `vibroimpact`."""
    found = set()
    for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {name.removeprefix(PREFIX) for name in found if name.startswith(PREFIX)}


@cache
def imports() -> dict[str, set[str]]:
    """Return the imported modules of every module; all files are read once in a process."""
    known = modules()
    return {name: imported_names(path) & set(known) - {name} for name, path in known.items()}


def floors(layer: str) -> list[list[str]]:
    """Return the rooms of each floor of a layer, the highest first, in the order of the layer's contract."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    for contract in settings["tool"]["importlinter"]["contracts"]:
        if contract.get("containers") == [PREFIX + layer]:
            return [floor.split(" | ") for floor in contract["layers"]]
    raise LookupError(f"pyproject.toml: expected a contract for {PREFIX + layer}, got none")


def arrows() -> Counter[tuple[str, str]]:
    """Return the number of imports from each room to another, rooms as `layer.room`."""
    count: Counter[tuple[str, str]] = Counter()
    for name, found in imports().items():
        room = ".".join(name.split(".")[:2])
        for other in found:
            target = ".".join(other.split(".")[:2])
            if target != room and "." in target and "." in room:
                count[room, target] += 1
    return count


def drawing() -> str:
    """Return the drawing as SVG: a column for each layer, which imports only from the columns to its right."""
    count = arrows()
    columns = [_column(place, layer, count) for place, layer in enumerate(LAYERS)]
    rows = max(sum(map(len, floors(layer))) for layer in LAYERS)
    width = MARGIN + len(LAYERS) * (BOX + GUTTER)
    height = TOP + rows * ROW + MARGIN
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="sans-serif" '
            'font-size="12">',
            "<title>Imports between the rooms; an arrow that led up would be red</title>",
            '<rect width="100%" height="100%" fill="white"/>',
            *(line for column in columns for line in column),
            "</svg>\n",
        )
    )


def _column(place: int, layer: str, count: Counter[tuple[str, str]]) -> list[str]:
    left, colour = MARGIN + place * (BOX + GUTTER), COLOURS[place]
    rooms = [(number, room) for number, floor in enumerate(floors(layer)) for room in floor]
    row_of = {f"{layer}.{room}": row for row, (_, room) in enumerate(rooms)}
    floor_of = {f"{layer}.{room}": number for number, room in rooms}
    below = {_layer(target) for importer, target in count if _layer(importer) == layer} - {layer}
    elsewhere = "→ " + ", ".join(other for other in LAYERS if other in below) if below else ""
    lines = [
        f'<text x="{left}" y="24" font-weight="bold" fill="{colour}">{layer}</text>',
        f'<text x="{left}" y="42" font-size="10" fill="#555">{elsewhere}</text>',
    ]
    for row, (number, room) in enumerate(rooms):
        shade = "0.16" if number % 2 else "0.07"
        top = TOP + row * ROW
        lines += [
            f'<rect x="{left}" y="{top}" width="{BOX}" height="{ROW}" fill="{colour}" fill-opacity="{shade}"/>',
            f'<text x="{left + 8}" y="{top + 18}">{escape(room)}</text>',
        ]
    for (importer, target), number in sorted(count.items()):
        if importer in row_of and target in row_of:
            leads_down = floor_of[importer] < floor_of[target]
            lines.append(
                _arc(left + BOX, row_of[importer], row_of[target], number, colour if leads_down else "red")
            )
    return lines


def _layer(room: str) -> str:
    return room.split(".")[0]


def _arc(x: int, start: int, end: int, count: int, colour: str) -> str:
    """Return an arrow between two rows: it leaves at the lower part of a box and arrives at the upper part."""
    first, last = TOP + start * ROW + 0.72 * ROW, TOP + end * ROW + 0.28 * ROW
    out = x + min(GUTTER - 10, 8 + BULGE * abs(end - start))
    width = 0.8 + 1.1 * sum(count >= more for more in THICKER)
    return (
        f'<path d="M{x} {first:.1f} C{out} {first:.1f} {out} {last:.1f} {x + 5} {last:.1f}" fill="none" '
        f'stroke="{colour}" stroke-opacity="0.6" stroke-width="{width:.1f}"/>'
        f'<path d="M{x} {last:.1f} l7 -3.5 v7 z" fill="{colour}"/>'
    )


if __name__ == "__main__":
    DRAWING.write_text(drawing(), encoding="utf-8")
