"""The directives `gallery-kinds` and `gallery-scenes`: pictures with the commands that make them."""

from __future__ import annotations

from collections.abc import Iterable

from docutils import nodes
from gallery import PICTURES, ROOT, Picture, kinds, scenes
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective


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
    return "\n".join(["::::{grid} 1 1 2 2", ":gutter: 2", *map(_card, pictures), "::::"])


def _card(picture: Picture) -> str:
    """Return the card of one picture, in MyST."""
    path = PICTURES / picture.file
    if not path.is_file():
        raise ExtensionError(f"gallery: expected {path}, got no file. `make docs` makes it.")
    commands = "\n".join(picture.commands)
    image = f"![{picture.shows.replace('`', '')}](/{path.relative_to(ROOT).as_posix()})"
    return f":::{{grid-item-card}}\n{image}\n\n{picture.shows}\n\n```\n{commands}\n```\n:::"
