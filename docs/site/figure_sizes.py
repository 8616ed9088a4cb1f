"""Figures made for paper keep their size on the site, so that their letters are as large as those of the text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from PIL import Image

PIXELS_PER_INCH = 150
"""CSS pixels for an inch of paper: a figure of one column, 85 mm, is 500 px wide; letters of 7 points have 15 px."""


def setup(sphinx: Any) -> dict[str, bool]:
    """Set the width of figures once a page is read."""
    sphinx.connect("doctree-read", _size)
    return {"parallel_read_safe": True}


def width_of(path: Path) -> int | None:
    """Return the width of a picture, CSS pixels; None if it has no resolution, or a coarse one."""
    with Image.open(path) as picture:
        resolution = float(picture.info.get("dpi", (0.0, 0.0))[0])
        return round(picture.width * PIXELS_PER_INCH / resolution) if resolution > PIXELS_PER_INCH else None


def _size(sphinx: Any, doctree: Any) -> None:
    from docutils import nodes

    for image in doctree.findall(nodes.image):
        path = Path(sphinx.srcdir, image["uri"])
        if path.suffix == ".png" and "width" not in image and path.is_file():
            width = width_of(path)
            if width is not None:
                image["width"] = f"{width}px"
