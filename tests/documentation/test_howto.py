"""Each recipe of the how-to page runs as it stands, in the order of the page, in one folder."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from support.cluster import free_port
from support.command_line import in_this_process
from support.places import EXAMPLES, ROOT

import vibroimpact as vi

TEXT = (ROOT / "docs" / "howto.md").read_text(encoding="utf-8")
RECIPES = re.findall(r"^##+ ([^\n]+)\n(.*?)(?=^##+ |\Z)", TEXT, re.MULTILINE | re.DOTALL)
#: Packages of an extra that a recipe needs; their libraries are loaded in a process of their own.
NEEDED = {"Run it in libcosim": "libcosimpy", "Run it in Ecos": "ecospy"}
PORT = "8786"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    there = tmp_path_factory.mktemp("howto")
    (there / "examples").mkdir()
    for path in EXAMPLES.iterdir():
        (there / "examples" / path.name).symlink_to(path)
    return there


def blocks_of(recipe: str) -> list[tuple[str, str]]:
    return re.findall(r"^```(\w*)\n(.*?)^```", recipe, re.MULTILINE | re.DOTALL)


def test_the_first_commands_of_the_page_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    language, block = blocks_of(TEXT)[0]
    assert language == ""
    run_commands(block)


@pytest.mark.parametrize(("name", "recipe"), RECIPES, ids=[name for name, _ in RECIPES])
def test_a_recipe_runs_as_it_stands(
    name: str, recipe: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if name in NEEDED and find_spec(NEEDED[name]) is None:
        pytest.skip(f"needs {NEEDED[name]}, an extra")
    monkeypatch.chdir(folder)
    for language, block in blocks_of(recipe):
        if name in NEEDED:
            run_elsewhere(block)
        elif language == "python":
            names: dict[str, Any] = {"vi": vi}
            exec(compile(block, f"docs/howto.md: {name}", "exec"), names)
        elif language == "bash":
            run_script(block.replace(PORT, str(free_port())))
        elif not language:
            run_commands(block)


def run_commands(block: str) -> None:
    """Run commands in this process, and find the file that each writes."""
    for line in block.splitlines():
        words = shlex.split(line, comments=True)
        assert words[0] == "vibroimpact"
        done = in_this_process(*words[1:])
        assert done.returncode == 0, done.stderr
        if "-o" in words:
            assert Path(words[words.index("-o") + 1]).exists()


def run_elsewhere(block: str) -> None:
    """Run Python in a process of its own: a library of another tool stays out of this one."""
    done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def run_script(block: str) -> None:
    """Run a script as a person's shell does, with the commands of this environment."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(
        ["bash", "-mec", block], env=os.environ | {"PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "802 points computed" in done.stdout
