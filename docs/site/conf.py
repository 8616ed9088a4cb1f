"""Settings of the documentation site. `make docs` builds it from the same pages that a forge shows."""

from __future__ import annotations

import os
import sys
from importlib import metadata
from pathlib import Path

from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parent))
# Cells of tutorials start `vibroimpact`, the program of this environment.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])

# Tutorials run in folders of their own. This start-up file of IPython puts the examples of a clone there.
ROOT = Path(__file__).resolve().parents[2]
START = ROOT / "build" / "docs" / "ipython" / "profile_default" / "startup" / "examples.py"
START.parent.mkdir(parents=True, exist_ok=True)
LINES = (
    "from pathlib import Path",
    "if not Path('examples').exists():",
    f"    Path('examples').symlink_to({str(ROOT / 'examples')!r})",
)
START.write_text("\n".join((*LINES, "")), encoding="utf-8")
os.environ["IPYTHONDIR"] = str(START.parents[2])

project = "vibroimpact"
author = "vibroimpact developers"
copyright = author
release = version = metadata.version("vibroimpact")

# The source folder is the root of the project: a link to a README or a scene works on the site and on a forge.
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "docs/**/*.md", "*/README.md", "*/**/README.md"]
exclude_patterns = [".*", "build", "fmus/built", "tests"]

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx_design",
    "command_blocks",
    "command_reference",
    "figure_sizes",
    "gallery_page",
    "table_cells",
]

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True

autodoc_typehints = "none"
autodoc_default_options = {"exclude-members": "model_config"}
toc_object_entries_show_parents = "hide"
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
default_role = "code"
# two hyphens are an option of a command, not a dash
smartquotes = False
highlight_language = "none"

html_theme = "pydata_sphinx_theme"
html_title = "vibroimpact"
html_static_path = ["static"]
html_css_files = ["site.css"]
# The front page is docs/index.html; this page, at the top, redirects there.
html_additional_pages = {"index": "to_front_page.html"}
templates_path = ["templates"]
# These pages belong to no section, whose pages the sidebar of the theme lists.
html_sidebars = {name: ["sections.html"] for name in ("docs/index", "search", "genindex", "py-modindex")}
html_copy_source = False
html_show_copyright = False
html_theme_options = {
    # pages whose pictures need the whole width have no list of headings
    "secondary_sidebar_items": {"**": ["page-toc"], "docs/index": [], "docs/gallery": []},
    "navbar_align": "left",
    "show_prev_next": True,
    "footer_start": [],
    "footer_end": ["sphinx-version"],
}


def _without_heading(
    sphinx: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]
) -> None:
    """Remove the heading from a room's example: several rooms share one page, and their headings differ."""
    if what == "module" and "Examples" in lines:
        place = lines.index("Examples")
        lines[place : place + 2] = []


def setup(sphinx: Sphinx) -> None:
    """Connect the hook that Sphinx calls before numpydoc reads a docstring."""
    sphinx.connect("autodoc-process-docstring", _without_heading, priority=100)
