"""The rules of prose hold on every page and in every comment; what counts them counts as CONTRIBUTING says."""

from __future__ import annotations

import sys
from pathlib import Path
from types import ModuleType

import pytest
from support.places import ROOT

PAGE = Path("page.md")
LONG = "word " * 26 + "end."


@pytest.fixture(scope="module")
def prose() -> ModuleType:
    sys.path.insert(0, str(ROOT / "docs" / "site"))
    try:
        import prose  # type: ignore[import-not-found, unused-ignore]
    finally:
        sys.path.pop(0)
    return prose  # type: ignore[no-any-return, unused-ignore]


def test_no_page_and_no_comment_breaks_a_rule(prose: ModuleType) -> None:
    paths = prose.files()
    assert len(paths) > 1500
    broken = [
        f"{path.relative_to(ROOT)}:{each.line}: {fault}"
        for path in paths
        for each in prose.paragraphs_of(path)
        for fault in each.faults()
    ]
    assert broken == []
    assert prose.mean_words(path for path in paths if path.suffix == ".md") <= prose.MOST_WORDS_ON_AVERAGE


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("A [link of five long words](a/b.md) counts.", [7]),
        ("A span `of several words in code` is one word.", [6]),
        ("- An item\n- Another item. It has two sentences.", [2, 2, 4]),
        ("## A heading\nA sentence, e.g. this one.", [5]),
        ("| a | table |\n|---|---|\n| has | words |", []),
        ("```\na block of code\n```\nAfter it.", [2]),
        ("> A quotation\n\nA formula $a = b + c$ is a word.", [6]),
    ],
)
def test_words_of_a_page_are_counted_by_sentence(prose: ModuleType, text: str, words: list[int]) -> None:
    sentences = [one for each in prose.paragraphs_of_page(PAGE, text) for one in each.sentences]
    assert [prose.words_in(sentence) for sentence in sentences] == words


@pytest.mark.parametrize(
    ("text", "broken"),
    [
        (f'"""{LONG}"""\n', ["27 words"]),
        (f"x = 1\n# {LONG}\n", ["27 words"]),
        (f'x = "# {LONG}"\n', []),
        ("# What holds the rows.\n", ["noun hidden"]),
        ('def f():\n    """Return what holds."""\n', ["noun hidden"]),
        ('class A:\n    x: int\n    """Of its channels, Hz."""\n', ["noun hidden"]),
        ('"""A first sentence.\n\nWhat follows may begin so.\n"""\n', []),
        ("x = 1  # type: ignore[what, of, it]\n", []),
        ('def f():\n    """Return a sum.\n\n    >>> f() ' + "+ 1 " * 30 + '\n    31\n    """\n', []),
        ("".join(f"# Line {line} has words.\n" for line in range(30)), ["characters in a paragraph"]),
    ],
)
def test_comments_of_python_are_read(prose: ModuleType, text: str, broken: list[str]) -> None:
    found = [fault for each in prose.paragraphs_of_python(Path("a.py"), text) for fault in each.faults()]
    assert len(found) == len(broken)
    assert all(words in fault for fault, words in zip(found, broken, strict=True))


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (f"# {LONG}\n[body]\n", 1),
        (f"mass = 1.0 # {LONG}\n", 1),
        (f'name = "# {LONG}"\n', 0),
        (f"text = '''\n# {LONG}\n'''\n", 0),
        ("# What is drawn\n", 1),
        ("# A comment of one line.\n# What follows may begin so.\n", 0),
    ],
)
def test_comments_of_toml_are_read(prose: ModuleType, text: str, count: int) -> None:
    assert sum(1 for each in prose.paragraphs_of_toml(Path("a.toml"), text) for _ in each.faults()) == count


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (f"/* {LONG} */\n", 1),
        (f"int x;  // {LONG}\n", 1),
        (f'char *s = "/* {LONG} */";\n', 0),
        ("/* Which of them. */\n", 1),
        ("// A comment.\n// Which goes on.\n", 0),
    ],
)
def test_comments_of_c_are_read(prose: ModuleType, text: str, count: int) -> None:
    assert sum(1 for each in prose.paragraphs_of_c(Path("a.c"), text) for _ in each.faults()) == count
