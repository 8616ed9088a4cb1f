"""Links of pages and their lines: no link leads nowhere, every page is linked, and no line is too long."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from support.places import ROOT

PAGES = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]
PACKAGES = ("fmus", "analysis", "orchestrator", "hardware")
FOLDERS = sorted(page for package in PACKAGES for page in (ROOT / package).rglob("README.md"))
ROOMS = (*PACKAGES, "service", "door", "examples", "tests")
READMES = sorted(page for room in ROOMS for page in (ROOT / room).rglob("*.md") if "built" not in page.parts)
SECTION = re.compile(r"^##+ (\d+(?:\.\d+)?)\b", re.MULTILINE)
CITED = re.compile(r"equations\.md ((?:\d+(?:\.\d+)?(?:, | and | to )?)+)")
FILE = re.compile(
    r"(?<![\w/.])(?:fmus|analysis|orchestrator|hardware|door|tests)/[\w/]+\.(?:py|c|h|toml|md)\b"
)
LINK = re.compile(r"\]\(([^)\s#]+)(?:#[^)]*)?\)")
FENCED = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
ENTRY = re.compile(r"^- .*\n(?:  .*\n)*", re.MULTILINE)


def links(page: Path) -> list[str]:
    found = LINK.findall(page.read_text(encoding="utf-8"))
    return [link for link in found if not link.startswith(("http://", "https://", "mailto:"))]


@pytest.mark.parametrize("page", [*PAGES, *FOLDERS], ids=lambda page: str(page.relative_to(ROOT)))
def test_no_link_of_a_page_leads_into_nowhere(page: Path) -> None:
    assert [link for link in links(page) if not (page.parent / link).exists()] == []


@pytest.mark.parametrize("page", [*PAGES, *FOLDERS], ids=lambda page: str(page.relative_to(ROOT)))
def test_the_files_of_the_project_that_a_page_names_are_there(page: Path) -> None:
    named = FILE.findall(page.read_text(encoding="utf-8"))
    assert [name for name in named if not (ROOT / name).exists()] == []


def test_every_page_is_found_from_the_readme() -> None:
    found, waiting = set[Path](), [ROOT / "README.md"]
    while waiting:
        page = waiting.pop()
        if page in found:
            continue
        found.add(page)
        waiting += [path for link in links(page) if (path := (page.parent / link).resolve()).suffix == ".md"]
    assert [str(page.relative_to(ROOT)) for page in PAGES if page.resolve() not in found] == []


def test_every_section_of_the_equations_that_code_cites_is_there() -> None:
    sections = set(SECTION.findall((ROOT / "docs" / "equations.md").read_text(encoding="utf-8")))
    cited = {
        (str(path.relative_to(ROOT)), number)
        for package in (*PACKAGES, "tests", "docs")
        for path in sorted((ROOT / package).rglob("*"))
        if path.suffix in (".py", ".c", ".h", ".toml", ".md") and "built" not in path.parts
        for found in CITED.findall(" ".join(path.read_text(encoding="utf-8").split()))
        for number in re.findall(r"\d+(?:\.\d+)?", found)
    }
    assert len(cited) > 50
    assert sorted((path, number) for path, number in cited if number not in sections) == []


def test_no_line_has_160_characters_but_in_blocks_tables_and_pictures() -> None:
    long = [
        f"{page.relative_to(ROOT)}: {line}"
        for page in (*PAGES, *READMES)
        for line in FENCED.sub("", page.read_text(encoding="utf-8")).splitlines()
        if len(line) >= 160 and not line.lstrip().startswith(("|", "!["))
    ]
    assert long == []


def test_the_changelog_has_two_lines_an_entry_at_most() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    entries = ENTRY.findall(text)
    assert len(entries) == sum(line.startswith("- ") for line in text.splitlines())
    assert [entry for entry in entries if entry.count("\n") > 2] == []


def test_the_version_is_told_alike_by_the_changelog_the_citation_and_the_form_for_faults() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    places = {
        "CHANGELOG.md": r"^## (\S+)",
        "CITATION.cff": r"^version: (\S+)",
        ".github/ISSUE_TEMPLATE/bug.yml": r"vibroimpact (\d[^\s,]*)",
    }
    stated = {
        name: re.findall(pattern, (ROOT / name).read_text(encoding="utf-8"), re.MULTILINE)[0]
        for name, pattern in places.items()
    }
    assert stated == dict.fromkeys(places, project["version"])
