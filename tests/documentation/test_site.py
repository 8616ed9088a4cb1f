"""The site: blocks that wrap, and sections that have a sidebar; the build itself is `make docs`."""

from __future__ import annotations

import ast
import re

import pytest
from command_blocks import CLASS, PRINTED, is_commands, is_sentences
from support.places import ROOT

DOCS, SITE = ROOT / "docs", ROOT / "docs" / "site"

TREE = re.compile(r"```\{toctree\}\n(?P<lines>.*?)```", re.S)


def pages_of(name: str) -> list[str]:
    """Return the pages below a page, by the trees of contents in its text."""
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    lines = [line for tree in TREE.finditer(text) for line in tree["lines"].splitlines()]
    return [line.strip() for line in lines if line.strip() and not line.startswith(":")]


def setting(name: str) -> object:
    """Return a setting of the site with a literal value."""
    for statement in ast.parse((SITE / "conf.py").read_text(encoding="utf-8")).body:
        if isinstance(statement, ast.Assign) and ast.unparse(statement.targets[0]) == name:
            return ast.literal_eval(statement.value)
    raise AssertionError(f"conf.py has no {name}")


def test_exactly_sections_without_pages_have_no_sidebar() -> None:
    alone = {f"docs/{name}" for name in pages_of("index") if not pages_of(name)}
    assert setting("html_sidebars") == {name: [] for name in {"docs/index", *alone}}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("vibroimpact run a.toml -o a.nc\nvibroimpact plot a.nc -o a.png\n", True),
        ("# twice as fast\nvibroimpact run a.toml\n", True),
        ("vibroimpact run a.toml \\\n--set body.mass=2\n", True),
        ("vibroimpact run a.toml\n1 run in 0.1 s\n", False),
        ("P(1,1)   unstable   0.93\nP(1,2)   stable     0.93\n", False),
        ("  r    estimate\n", False),
        ("", False),
    ],
)
def test_blocks_of_commands_alone_wrap(text: str, expected: bool) -> None:
    assert is_commands(text) is expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("beam.toml: stop[1].restitution: expected 0 <= r <= 1, got 1.2. Use 1 for an elastic stop.\n", True),
        ("1 run in 0.1 s\n\nDataset written to a.nc.\n", True),
        ("  r    estimate\n", False),
        ("P(1,1)   unstable   0.93\n", False),
        ("───────\n", False),
        ("\n", False),
    ],
)
def test_sentences_wrap_and_columns_do_not(text: str, expected: bool) -> None:
    assert is_sentences(text) is expected


def test_tables_of_the_pages_of_orbits_keep_their_lines() -> None:
    blocks = re.findall(r"```\n(.*?)```", (DOCS / "orbits.md").read_text(encoding="utf-8"), re.S)
    printed = [block for block in blocks if not is_commands(block)]
    assert any(re.search(r"\S {2,}\S.* {2,}\S", block) for block in printed)
    assert any(is_commands(block) for block in blocks)
    style = (SITE / "static" / "site.css").read_text(encoding="utf-8")
    rules = {
        selector.strip(): body
        for selectors, body in re.findall(r"([^{}]*)\{([^}]*)\}", re.sub(r"/\*.*?\*/", "", style, flags=re.S))
        for selector in selectors.split(",")
    }
    assert "white-space: pre;" in rules[".bd-article pre"]
    assert "white-space: pre-wrap;" in rules[f".bd-article .{CLASS} pre"]
    assert "font-size" in rules[f".bd-article .{PRINTED} pre"]
