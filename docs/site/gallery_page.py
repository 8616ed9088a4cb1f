"""The directives `gallery-kinds` and `gallery-scenes`: pictures with the commands that make them."""

from __future__ import annotations

import re
from collections.abc import Iterable

from docutils import nodes
from gallery import PICTURES, ROOT, Picture, kinds, scenes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

#: Width of a picture on the page, CSS pixels. A click shows the picture in its own size.
THUMBNAIL = 300


def setup(sphinx: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    sphinx.add_directive("gallery-kinds", Kinds)
    sphinx.add_directive("gallery-scenes", Scenes)
    return {"parallel_read_safe": True}


class Kinds(SphinxDirective):
    """A picture of every kind of figure."""

    def run(self) -> list[nodes.Node]:
        """Return the grid of the pictures."""
        return self.parse_text_to_nodes(_grid(kinds().values()))


class Scenes(SphinxDirective):
    """A picture of every scene of the index of examples."""

    def run(self) -> list[nodes.Node]:
        """Return the grid of the pictures."""
        return self.parse_text_to_nodes(_grid(scenes()))


def _grid(pictures: Iterable[Picture]) -> str:
    return "\n".join([":::::{grid}", ":class-container: thumbnails", *map(_card, pictures), ":::::"])


def folded(command: str) -> str:
    """Return a command with a line for each option, as a shell reads it.

    Examples
    --------
    >>> print(folded("vibroimpact plot a.nc --kind run -o a.png"))
    vibroimpact plot a.nc \\
      --kind run \\
      -o a.png
    """
    return re.sub(r" (?=--?[a-z])", " \\\\\n  ", command)


def _card(picture: Picture) -> str:
    """Return the card of one picture, in MyST."""
    path = PICTURES / picture.file
    if not path.is_file():
        raise ExtensionError(f"gallery: expected {path}, got no file. `make docs` makes it.")
    lines = [
        "::::{grid-item-card}",
        # an image with a width links to the whole picture
        f":::{{image}} /{path.relative_to(ROOT).as_posix()}",
        f":alt: {picture.shows.replace('`', '')}",
        f":width: {THUMBNAIL}px",
        ":class: thumbnail",
        ":::",
        "",
        picture.shows,
        "",
        ":::{dropdown} Commands",
        "```",
        *map(folded, picture.commands),
        "```",
        ":::",
        "::::",
    ]
    return "\n".join(lines)
