"""The style of all figures, independent of matplotlibrc; imported before every other use of matplotlib."""

from __future__ import annotations

import contextlib
import os
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

# matplotlib reads a matplotlibrc in the current folder during its import, and fails if it is no text.
with contextlib.chdir(Path(__file__).parent) if os.path.exists("matplotlibrc") else contextlib.nullcontext():
    import matplotlib.style

_STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7.5,
    "axes.linewidth": 0.6,
    "lines.linewidth": 0.7,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.top": True,
    "ytick.right": True,
    "svg.hashsalt": "vibroimpact",
}


def page_style() -> AbstractContextManager[None]:
    """Return the context in which figures are drawn and saved: matplotlib's defaults plus the style of this package."""
    return matplotlib.style.context(["default", _STYLE])
