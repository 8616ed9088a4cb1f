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
BEGINNING = TEXT.partition("\n## ")[0]
RECIPES = re.findall(r"^##+ ([^\n]+)\n(.*?)(?=^##+ |\Z)", TEXT, re.MULTILINE | re.DOTALL)
#: Packages of an extra that a recipe needs; their libraries are loaded in a process of their own.
NEEDED = {"Run it in libcosim": "libcosimpy", "Run it in Ecos": "ecospy"}
PORT = "8786"


def blocks_of(recipe: str) -> list[tuple[str, str]]:
    return re.findall(r"^```(\w*)\n(.*?)^```", recipe, re.MULTILINE | re.DOTALL)


def test_each_recipe_runs_as_it_stands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One test: a recipe may use the files of those above it."""
    assert set(NEEDED) <= {name for name, _ in RECIPES}
    (tmp_path / "examples").mkdir()
    for path in EXAMPLES.iterdir():
        (tmp_path / "examples" / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    run_commands("the first commands", blocks_of(BEGINNING)[0][1])
    for name, recipe in RECIPES:
        for language, block in blocks_of(recipe):
            if name in NEEDED:
                if find_spec(NEEDED[name]) is not None:
                    run_elsewhere(name, block)
            elif language == "python":
                names: dict[str, Any] = {"vi": vi}
                exec(compile(block, f"docs/howto.md: {name}", "exec"), names)
            elif language == "bash":
                run_script(name, block.replace(PORT, str(free_port())))
            elif not language:
                run_commands(name, block)


def run_commands(name: str, block: str) -> None:
    """Run commands in this process, and find the file that each writes."""
    for line in block.splitlines():
        words = shlex.split(line, comments=True)
        assert words[0] == "vibroimpact", name
        done = in_this_process(*words[1:])
        assert done.returncode == 0, f"{name}: {done.stderr}"
        if "-o" in words:
            assert Path(words[words.index("-o") + 1]).exists(), name


def run_elsewhere(name: str, block: str) -> None:
    """Run Python in a process of its own: a library of another tool stays out of this one."""
    done = subprocess.run([sys.executable, "-c", block], capture_output=True, text=True)
    assert done.returncode == 0, f"{name}: {done.stderr}"
    assert done.stdout, name


def run_script(name: str, block: str) -> None:
    """Run a script as a person's shell does, with the commands of this environment."""
    path = os.pathsep.join((str(Path(sys.executable).parent), os.environ["PATH"]))
    done = subprocess.run(
        ["bash", "-mec", block], env=os.environ | {"PATH": path}, capture_output=True, text=True
    )
    assert done.returncode == 0, f"{name}: {done.stderr}"
    assert "802 points computed" in done.stdout
