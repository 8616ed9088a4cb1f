"""Introductory pages are true: commands are accepted, code runs, lists are complete."""

from __future__ import annotations

import importlib
import importlib.util
import re
import shlex
import sys
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import typer
from support.places import ROOT

from vibroimpact.analysis.figures import KINDS
from vibroimpact.orchestrator.commands.cli import app, load_commands

EXAMPLES = ROOT / "examples"
SCENES = sorted(
    path for folder in (".", "thesis", "recordings") for path in (EXAMPLES / folder).glob("*.toml")
)
INDEX = (EXAMPLES / "README.md").read_text(encoding="utf-8")
#: Scenes that need a foreign FMU, which is not shipped.
NOT_RUN = {"bouncing_ball"}
PAGES = [*(ROOT / "docs" / f"{name}.md" for name in ("index", "tutorial", "howto")), EXAMPLES / "README.md"]


def module(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = loaded
    spec.loader.exec_module(loaded)
    return loaded


@pytest.fixture(scope="module")
def gallery() -> ModuleType:
    return module(ROOT / "docs" / "site" / "gallery.py")


def commands_of(text: str) -> list[str]:
    """Return the commands in the blocks of a page, and in the rows of its tables."""
    fences = re.findall(r"^```(.*?)\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    blocks = [block for language, block in fences if not language]
    rows = [re.findall(r"`([^`]*)`", line) for line in text.splitlines() if line.startswith("|")]
    lines = [*"\n".join(blocks).splitlines(), *(code for row in rows for code in row)]
    return [line for line in lines if line.startswith("vibroimpact ")]


@cache
def command_line() -> Any:
    """Return all commands, made of their functions once: that takes a tenth of a second."""
    load_commands()
    return typer.main.get_command(app)


def understood(command: str) -> None:
    """Parse a command without running it."""
    chosen = command_line()
    words = shlex.split(command)
    context = chosen.context_class(chosen, info_name=words.pop(0))
    while hasattr(chosen, "get_command"):
        chosen = chosen.get_command(context, words.pop(0))
    chosen.make_context(command, words)


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_commands_of_a_page_are_understood_and_the_files_of_the_project_are_there(page: Path) -> None:
    commands = commands_of(page.read_text(encoding="utf-8"))
    assert commands
    for command in commands:
        understood(command)
        for name in re.findall(r"examples/\S+\.(?:toml|py)\b", command):
            assert (ROOT / name).is_file(), command


def test_a_command_with_an_unknown_option_is_not_understood() -> None:
    with pytest.raises(Exception, match="--colour"):
        understood("vibroimpact plot a.nc -o a.png --colour red")


@pytest.mark.parametrize("scene", SCENES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_the_index_of_examples_has_every_scene_and_its_command(scene: Path) -> None:
    name = scene.relative_to(EXAMPLES).as_posix()
    assert INDEX.count(f"]({name})") == 1
    assert any(f" examples/{name} " in f"{command} " for command in commands_of(INDEX))


def test_the_gallery_shows_every_scene_that_needs_nothing_from_elsewhere(gallery: ModuleType) -> None:
    shown = {
        Path(word).stem for picture in gallery.scenes() for word in shlex.split(" ".join(picture.commands))
    }
    needed = {scene.stem for scene in SCENES if scene.parent.name != "recordings"}
    assert needed - shown == NOT_RUN


def test_the_gallery_shows_every_kind_of_figure_by_commands_that_are_understood(gallery: ModuleType) -> None:
    assert sorted(gallery.kinds()) == sorted(KINDS)
    for kind, picture in gallery.kinds().items():
        assert f"--kind {kind} -o {picture.file}" in picture.commands[-1]
        for command in picture.commands:
            understood(command)


def test_every_page_of_the_site_is_in_a_table_of_contents() -> None:
    """Sphinx reports it too, after minutes; the usual case is a room with a new README."""
    entries: set[Path] = {ROOT / "docs" / "index.md"}
    for page in ROOT.glob("docs/**/*.md"):
        for block in re.findall(r"^```\{toctree\}\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            names = [line for line in block.splitlines() if line and not line.startswith(":")]
            for name in names:
                entry = re.sub(r".*<(.*)>$", r"\1", name)
                base, pattern = page.parent, entry
                while pattern.startswith("../"):
                    base, pattern = base.parent, pattern[3:]
                entries |= set(base.glob(f"{pattern.removesuffix('.md')}.md"))
    folders = ("docs", "fmus", "analysis", "orchestrator", "hardware", "door", "examples")
    pages = {
        path for folder in folders for path in (ROOT / folder).rglob("*.md") if "built" not in path.parts
    }
    assert sorted(str(path.relative_to(ROOT)) for path in pages - entries) == []


def test_the_reference_of_python_names_what_is_there() -> None:
    text = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    functions = re.findall(r"^\.\. autofunction:: (.+)\.(\w+)$", text, re.M)
    modules = re.findall(r"^\.\. automodule:: (\S+)\n(?:   :.*\n)*?   :members: (.+)$", text, re.M)
    named = functions + [(module, name.strip()) for module, names in modules for name in names.split(",")]
    assert ("vibroimpact.orchestrator.run", "PointRunner") in named
    assert [(m, n) for m, n in named if not hasattr(importlib.import_module(m), n)] == []
