"""The page of an FMU's documentation, `documentation/index.html`: one file, without scripts or outside content.

The page holds the component's README and equations, with the variables of the FMU itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from html import escape

from vibroimpact.fmus.packaging.description import ComponentDescription, Edition, Variable, literal

MEMBER = "documentation/index.html"
#: Heading of the last section of a README, its table of variables; the FMU's own table replaces it.
VARIABLES = "\n## Variables\n"
#: Beginnings of README paragraphs for readers who have the package's sources.
FOR_DEVELOPERS = ("Files:", "Test it alone", "Make one:")
STYLE = """\
body { font: 16px/1.5 system-ui, sans-serif; color: #222; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; }
h1 img { height: 3.2rem; vertical-align: middle; margin-right: .6rem; }
code { font: .92em ui-monospace, monospace; background: #f3f3f3; padding: 0 .2em; }
pre { background: #f3f3f3; padding: .7rem 1rem; overflow-x: auto; }
pre code { padding: 0; }
table { border-collapse: collapse; font-size: .9em; display: block; overflow-x: auto; }
th, td { text-align: left; vertical-align: top; padding: .2rem .7rem .2rem 0; border-bottom: 1px solid #ddd; }
math { font-size: 1.15em; margin: .8rem 0; }
"""


def page(
    component: ComponentDescription,
    readme: str,
    equations: str,
    edition: Edition,
    icon: str,
    further: Sequence[tuple[str, str]],
) -> str:
    """Return the text of the page of a component as it is described.

    Equations are HTML and MathML. The page refers to the icon (empty: none), and to further files with their captions.
    """
    title = escape(component.name)
    picture = f'<img src="{escape(icon)}" alt="">' if icon else ""
    body = _rendered(readme).replace("<h1>", f"<h1>{picture}", 1)
    files = "".join(f'<li><a href="{escape(place)}">{escape(text)}</a></li>\n' for place, text in further)
    experiment = edition.experiment
    span = f"from {literal(experiment.start_time)} s to {literal(experiment.stop_time)} s"
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        f"<style>\n{STYLE}</style>\n</head>\n<body>\n{body}"
        f"<h2>Equations</h2>\n{equations}<h2>Variables of this FMU</h2>\n{_table(component)}\n"
        f"<h2>This FMU</h2>\n<p>Made by vibroimpact {escape(edition.version)}, whose documentation says more. "
        f"A default run goes {span} in steps of {literal(experiment.step_size)} s.</p>\n"
        f"<ul>\n{files}</ul>\n</body>\n</html>\n"
    )


def _rendered(readme: str) -> str:
    """Return a README as HTML, without the parts that need the sources."""
    from markdown_it import MarkdownIt  # absent while the package is being built

    text = readme.partition(VARIABLES)[0]
    paragraphs = re.split(r"\n\n+", text)
    kept = (_without_lines_for_developers(p) for p in paragraphs)
    markdown = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = markdown.parse("\n\n".join(p for p in kept if p))
    for token in tokens:
        if token.children:
            # targets of links are not in the FMU
            token.children = [t for t in token.children if t.type not in {"link_open", "link_close", "image"}]
    html: str = markdown.renderer.render(tokens, markdown.options, {})
    return html


def _without_lines_for_developers(paragraph: str) -> str:
    lines = paragraph.split("\n")
    first = next((k for k, line in enumerate(lines) if line.startswith(FOR_DEVELOPERS)), len(lines))
    return "\n".join(lines[:first])


def _table(component: ComponentDescription) -> str:
    head = ("name", "causality", "unit", "start", "range", "meaning")
    rows = (*_rows("th", [head]), *_rows("td", map(_cells, component.variables)))
    return f"<table>\n{''.join(rows)}</table>"


def _rows(tag: str, rows: Iterable[Sequence[str]]) -> Iterator[str]:
    for row in rows:
        first, *rest = map(escape, row)
        cells = [first if tag == "th" else f"<code>{first}</code>", *rest]
        yield f"<tr>{''.join(f'<{tag}>{cell}</{tag}>' for cell in cells)}</tr>\n"


def _cells(variable: Variable) -> tuple[str, ...]:
    start = "" if variable.start is None else literal(variable.start)
    kind = f"{variable.causality}, {variable.variability}"
    return (variable.name, kind, variable.unit, start, _range(variable), variable.description)


def _range(variable: Variable) -> str:
    lowest, highest = (
        "" if bound is None else f"{bound:g}" for bound in (variable.minimum, variable.maximum)
    )
    if lowest and highest:
        return f"{lowest} to {highest}"
    return f">= {lowest}" if lowest else f"<= {highest}" if highest else ""
