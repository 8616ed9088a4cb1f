"""The site: the front page, navigation, tables and blocks, faults of a page; the build itself is `make docs`."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import table_cells
from command_blocks import CLASS, PRINTED, is_commands, is_sentences
from look import FRONT, LAPTOP, MEASURE, PHONE, Facts, faults, main, pages_of
from support.browser import need_browser
from support.places import ROOT

DOCS, SITE = ROOT / "docs", ROOT / "docs" / "site"

TREE = re.compile(r"```\{toctree\}\n(?P<lines>.*?)```", re.S)


def pages_of_section(name: str) -> list[str]:
    """Return the pages below one, by the trees of its text."""
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    lines = [line for tree in TREE.finditer(text) for line in tree["lines"].splitlines()]
    return [line.strip() for line in lines if line.strip() and not line.startswith(":")]


def style() -> dict[str, str]:
    """Return the rules of the style sheet by their selectors; those of a width of the screen come last."""
    text = re.sub(r"/\*.*?\*/", "", (SITE / "static" / "site.css").read_text(encoding="utf-8"), flags=re.S)
    return {
        selector.strip(): body
        for selectors, body in re.findall(r"([^{}]*)\{([^{}]*)\}", text.split("@media (max-width")[0])
        for selector in selectors.split(",")
    }


def test_every_section_has_pages_for_its_navigation() -> None:
    assert [name for name in pages_of_section("index") if not pages_of_section(name)] == []


def test_the_front_page_has_the_python_and_the_output_of_the_readme() -> None:
    readme, front = ((ROOT / name).read_text(encoding="utf-8") for name in ("README.md", "docs/index.md"))
    block = re.search(r"```python\n.*?```\n```\n.*?```\n", readme, re.S)
    assert block
    assert block[0] in front
    assert len(block[0].split("```")[1].splitlines()[1:]) == 8
    assert readme.splitlines()[:3] == front.splitlines()[:3]


GOOD = Facts(
    width=390.0,
    scroll_width=390.0,
    links=3,
    outside=[],
    wrapped=[],
    first_screen={"installation": 200.0, "code": 400.0, "figure": 700.0},
    thumbnails=[],
)


@pytest.mark.parametrize(
    ("changes", "page", "screen", "expected"),
    [
        ({}, FRONT, PHONE, ""),
        ({"scroll_width": 391.0}, "docs/rig.html", PHONE, "391 px: it scrolls sideways"),
        ({"outside": ['table "key"']}, "docs/rig.html", PHONE, 'wider than its column: table "key"'),
        ({"wrapped": ['pre "run"']}, "docs/rig.html", PHONE, 'got lines that do: pre "run"'),
        ({"links": 0}, "docs/rig.html", LAPTOP, "expected pages in the navigation"),
        ({"links": 0}, "docs/rig.html", PHONE, ""),
        (
            {"first_screen": {"figure": 721.0}},
            FRONT,
            LAPTOP,
            "figure within the first 720 px, got its end at 721",
        ),
        ({"first_screen": {"figure": 721.0}}, FRONT, PHONE, ""),
        (
            {"first_screen": {"code": math.inf}},
            FRONT,
            PHONE,
            "code within the first 844 px, got its end at inf",
        ),
        ({"first_screen": {"code": math.inf}}, "docs/rig.html", PHONE, ""),
        ({}, "docs/gallery.html", LAPTOP, "expected thumbnails, got none"),
        ({"thumbnails": [300.0, 300.0]}, "docs/gallery.html", LAPTOP, ""),
        ({"thumbnails": [300.0, 434.0]}, "docs/gallery.html", LAPTOP, "thumbnails of 300 px, got 434 px"),
    ],
)
def test_each_fault_of_a_page_is_a_line(
    changes: dict[str, Any], page: str, screen: tuple[int, int], expected: str
) -> None:
    found = list(faults(page, screen, replace(GOOD, **changes)))
    assert len(found) == bool(expected)
    assert expected in "".join(found)


def test_facts_of_a_page_are_those_that_the_script_returns() -> None:
    returned = MEASURE[MEASURE.rindex("return {") :]
    names = re.findall(r"^    (\w+): ", returned, re.M)
    assert names == list(Facts.__dataclass_fields__)


def test_pages_that_lead_elsewhere_are_not_looked_at(tmp_path: Path) -> None:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.html").write_text("<html></html>", encoding="utf-8")
    (tmp_path / "index.html").write_text(
        (SITE / "templates" / "to_front_page.html").read_text(encoding="utf-8"), encoding="utf-8"
    )
    assert pages_of(tmp_path) == [FRONT]


def test_without_a_browser_one_line_says_so_and_only_a_demand_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("look.CHROMIUM", None)
    monkeypatch.setattr("look.find_spec", lambda name: name)
    monkeypatch.delenv("VIBROIMPACT_BROWSER", raising=False)
    main(tmp_path, tmp_path / "pictures")
    assert capsys.readouterr().out == (
        "look: nothing looked at the pages: no Chromium on PATH. On Debian: apt-get install chromium\n"
    )
    monkeypatch.setenv("VIBROIMPACT_BROWSER", "1")
    with pytest.raises(SystemExit, match="no Chromium on PATH"):
        main(tmp_path, tmp_path / "pictures")


FRONT_PAGE = """<body style="margin: 0; width: {width}"><div class="bd-sidebar-primary"><nav class="bd-docs-nav">
<a href="x">x</a></nav></div><article class="bd-article"><div class="first-screen"><pre>pip install .</pre>
<div class="highlight-python"><pre>import</pre></div><img style="height: {height}" src=""></div>{more}</article>"""
WIDE_TABLE = '<div style="overflow-x: {overflow}"><table style="width: 3000px"><td class="long">cell</td></table></div>'


def test_chromium_finds_the_faults_of_a_page_and_leaves_its_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    need_browser()
    good = FRONT_PAGE.format(width="100%", height="100px", more=WIDE_TABLE.format(overflow="auto"))
    bad = FRONT_PAGE.format(width="1300px", height="900px", more=WIDE_TABLE.format(overflow="hidden"))
    page = tmp_path / FRONT
    page.parent.mkdir()
    page.write_text(good, encoding="utf-8")
    main(tmp_path, tmp_path / "pictures")
    assert "1 pages at 390 and 1280 px, 0 faults" in capsys.readouterr().out
    assert [path.name for path in sorted((tmp_path / "pictures").iterdir())] == [
        "index_1280.png",
        "index_390.png",
    ]
    page.write_text(bad, encoding="utf-8")
    with pytest.raises(SystemExit):
        main(tmp_path, tmp_path / "pictures")
    lines = capsys.readouterr().out.splitlines()
    for width in (PHONE[0], LAPTOP[0]):
        found = " ".join(line for line in lines if f", {width} px: " in line)
        assert "it scrolls sideways" in found
        assert 'wider than its column: table "cell"' in found
        assert "the figure within the first" in found
        assert "installation" not in found
    assert "6 faults" in lines[-1]


def test_short_cells_keep_one_line_and_long_ones_wrap() -> None:
    assert not table_cells.is_long("restitution at 1 m/s")
    assert table_cells.is_long("an array of whole numbers, each of which is at least 1")
    assert "white-space: nowrap;" in style()[".bd-article td"]
    assert "white-space: normal;" in style()[f".bd-article td.{table_cells.LONG}"]


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
    rules = style()
    assert "white-space: pre;" in rules[".bd-article pre"]
    assert "white-space: pre-wrap;" in rules[f".bd-article .{CLASS} pre"]
    assert "font-size" in rules[f".bd-article .{PRINTED} pre"]
