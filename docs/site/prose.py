"""Measure the prose of pages, docstrings and comments: `python docs/site/prose.py [PATH ...]` lists what breaks a rule.

The rules stand in CONTRIBUTING.md. Sentences have at most 25 words, paragraphs at most 500 characters, and no comment
begins with a relative that hides its noun. The last line gives the mean length of a sentence on the pages.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MOST_WORDS = 25
MOST_CHARACTERS = 500
MOST_WORDS_ON_AVERAGE = 16
#: Words that hide their noun at the beginning of a comment or a docstring.
HIDDEN_NOUN = re.compile(
    r"(What|Whatever|Whoever|How|Where|When|Which|That|Those|Of|Beside|Else|Likewise|Nor)\b"
    r"|Return (what|how|those|that)\b"
)
ABBREVIATIONS = re.compile(
    r"\b(e\.g|i\.e|cf|vs|eqs?|[Ff]igs?|[Ss]ec|[Nn]o|pp?|[Vv]ol|al|approx|resp|Dr|Prof)\.$"
)
PYTHON = re.compile(
    r"""(\"{3}|'{3})(?:\\.|(?!\1).)*\1|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'|#[^\n]*""", re.DOTALL
)
"""Strings and comments of Python and TOML, so that a mark within a string begins no comment."""
C = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:\\.|[^"\\\n])*"', re.DOTALL)
#: A pragma is no prose.
PRAGMA = re.compile(r"(noqa|type:|ruff:|mypy:|pragma:|fmt:|clang-format|!)")


@dataclass(frozen=True)
class Paragraph:
    """A paragraph of a file: its first line, its text without marks, and whether it opens a comment."""

    path: Path
    line: int
    text: str
    opens: bool = False

    @property
    def sentences(self) -> list[str]:
        """Sentences of the text, in order."""
        found: list[str] = []
        pending = ""
        for piece in re.split(r"(?<=[.!?])[)\"'*_]*\s+", self.text):
            pending = f"{pending} {piece}".strip()
            if not ABBREVIATIONS.search(pending):
                found.append(pending)
                pending = ""
        return [sentence for sentence in (*found, pending) if words_in(sentence)]

    def faults(self) -> Iterator[str]:
        """Yield each rule that the paragraph breaks, with the words that break it."""
        for sentence in self.sentences:
            count = words_in(sentence)
            if count > MOST_WORDS:
                yield f"{count} words: {sentence[:90]}"
        if len(self.text) > MOST_CHARACTERS:
            yield f"{len(self.text)} characters in a paragraph: {self.text[:60]}"
        if self.opens and HIDDEN_NOUN.match(self.text):
            yield f"noun hidden: {self.text[:90]}"


def words_in(text: str) -> int:
    """Return the number of words of a text: only words with a letter or a digit count."""
    return sum(any(map(str.isalnum, word)) for word in text.split())


def plain(text: str) -> str:
    """Return a text without marks: a link becomes its text, a code span or a formula becomes one word."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"(`+)(.+?)\1", "code", text)
    text = re.sub(r"\$[^$]+\$", "formula", text)
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"\[([^\]]*)\](\([^)]*\)|\[[^\]]*\])", r"\1", text)
    text = re.sub(r"\{[a-z:]+\}(?=code)|<[^>\s]+>", "", text)
    return " ".join(text.replace("*", "").split())


def paragraphs_of_page(path: Path, text: str) -> Iterator[Paragraph]:
    """Yield the paragraphs and list items of a page, without headings, tables, blocks, formulas and quotations."""
    fence = ""
    pending: list[str] = []
    first = 0

    def taken() -> Iterator[Paragraph]:
        if words := plain("\n".join(pending)):
            yield Paragraph(path, first, words)
        pending.clear()

    text = re.sub(r"<!--.*?-->", lambda found: "\n" * found.group().count("\n"), text, flags=re.DOTALL)
    for number, line in enumerate(text.splitlines(), start=1):
        bare = line.strip()
        mark = re.match(r"(`{3,}|~{3,}|\$\$)", bare)
        if fence:
            if bare.endswith(fence):
                fence = ""
            continue
        if mark:
            yield from taken()
            fence = "" if mark.group() == "$$" and bare != "$$" and bare.endswith("$$") else mark.group()
            continue
        if not bare or re.match(r"(#|\||>|:::|<|\([\w-]+\)=$|[-=*]{3,}$)", bare):
            yield from taken()
            continue
        item = re.match(r"([-*+]|\d+[.)]) +", bare)
        if item:
            yield from taken()
            bare = bare[item.end() :]
        if not pending:
            first = number
        pending.append(bare)
    yield from taken()


def paragraphs_of_comment(path: Path, line: int, text: str) -> Iterator[Paragraph]:
    """Yield the paragraphs of a comment or a docstring, without examples, headings of sections and names of fields."""
    pending: list[str] = []
    first, depth, opens, in_example = line, 0, True, False
    lines = text.expandtabs().splitlines()

    def taken() -> Iterator[Paragraph]:
        nonlocal opens
        if words := plain("\n".join(pending)):
            yield Paragraph(path, first, words, opens)
            opens = False
        pending.clear()

    for number, each in enumerate(lines):
        bare, indent = each.strip(), len(each) - len(each.lstrip())
        after = lines[number + 1].strip() if number + 1 < len(lines) else ""
        item = re.match(r"([-*+]|\d+[.)]) +", bare)
        in_example = bool(bare) and (in_example or bare.startswith(">>>"))
        is_heading = bool(re.fullmatch(r"-{3,}|={3,}", bare) or re.fullmatch(r"-{3,}|={3,}", after))
        is_field = bool(re.match(r"[\w*`., ]+ : \S", bare)) and number > 0
        if not bare or in_example or is_heading or is_field or bare.startswith("|"):
            yield from taken()
            continue
        if item or (pending and indent != depth and number > 1):
            yield from taken()
        if item:
            bare = bare[item.end() :]
        if not pending:
            first, depth = line + number, indent
        pending.append(bare)
        if item:
            depth = indent + item.end()
    yield from taken()


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements within a node, at any depth."""
    for block in ("body", "handlers", "orelse", "finalbody", "cases"):
        for statement in getattr(node, block, ()):
            yield statement
            yield from statements(statement)


def paragraphs_of_python(path: Path, text: str) -> Iterator[Paragraph]:
    """Yield the paragraphs of docstrings, of texts below a field, and of comments."""
    for node in statements(ast.parse(text)):
        value = node.value if isinstance(node, ast.Expr) else None
        if isinstance(value, ast.Constant) and isinstance(value.value, str):
            yield from paragraphs_of_comment(path, value.lineno, value.value)
    yield from paragraphs_of_toml(path, text)


def paragraphs_of_toml(path: Path, text: str) -> Iterator[Paragraph]:
    """Yield the paragraphs of comments that begin with `#`."""
    found = ((each.start(), each.group()) for each in PYTHON.finditer(text))
    yield from _joined(path, _alone(text, ((at, said, "#:") for at, said in found if said[0] == "#")))


def _alone(text: str, comments: Iterable[tuple[int, str, str]]) -> Iterator[tuple[int, int, bool, str]]:
    """Yield line, column, whether it stands alone, and text of comments, given by place, text and mark."""
    line = last = 0
    for at, said, mark in comments:
        line += text.count("\n", last, at)
        last = at
        begins = text.rfind("\n", 0, at) + 1
        words = said.lstrip(mark)
        if not PRAGMA.match(words.strip()):
            yield line + 1, at - begins, not text[begins:at].strip(), words


def _joined(path: Path, lines: Iterable[tuple[int, int, bool, str]]) -> Iterator[Paragraph]:
    """Yield the paragraphs of comments; a comment is line, column, whether it stands alone, and text."""
    pending: list[str] = []
    start = last = place = 0
    for number, column, is_alone, said in lines:
        if pending and not (is_alone and number == last + 1 and column == place):
            yield from paragraphs_of_comment(path, start, "\n".join(pending))
            pending.clear()
        if not pending:
            start = number
        pending.append(said)
        last, place = number, column
    if pending:
        yield from paragraphs_of_comment(path, start, "\n".join(pending))


def paragraphs_of_c(path: Path, text: str) -> Iterator[Paragraph]:
    """Yield the paragraphs of the comments of a C file."""
    found = [(each.start(), each.group()) for each in C.finditer(text)]
    for at, said in found:
        if said.startswith("/*"):
            inner = re.sub(r"(?m)^[ \t]*\*(?!\*)( ?)", "", said[2:-2].lstrip("*!"))
            if not PRAGMA.match(inner.strip()):
                yield from paragraphs_of_comment(path, text.count("\n", 0, at) + 1, inner)
    lines = ((at, said, "/") for at, said in found if said.startswith("//"))
    yield from _joined(path, _alone(text, lines))


def paragraphs_of(path: Path) -> Iterator[Paragraph]:
    """Yield the paragraphs of a page, or of the comments of a file in Python, C or TOML."""
    text = path.read_text(encoding="utf-8")
    kinds = {
        ".md": paragraphs_of_page,
        ".py": paragraphs_of_python,
        ".c": paragraphs_of_c,
        ".h": paragraphs_of_c,
        ".toml": paragraphs_of_toml,
    }
    yield from kinds[path.suffix](path, text)


def files(paths: Iterable[Path] = ()) -> list[Path]:
    """Return the files with prose that git knows: all of them, or those below the paths."""
    named = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *map(str, paths)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    read = (".md", ".py", ".c", ".h", ".toml")
    return [ROOT / name for name in named if name.endswith(read) and (ROOT / name).exists()]


def mean_words(paths: Iterable[Path]) -> float:
    """Return the mean number of words of a sentence on pages."""
    counts = [
        words_in(sentence) for path in paths for each in paragraphs_of(path) for sentence in each.sentences
    ]
    return sum(counts) / max(len(counts), 1)


def main(names: list[str]) -> int:
    """Print each fault and the mean; return 1 if a rule is broken."""
    paths = files(Path(name).resolve() for name in names)
    faults = [(each, fault) for path in paths for each in paragraphs_of(path) for fault in each.faults()]
    for each, fault in faults:
        print(f"{each.path.relative_to(ROOT)}:{each.line}: {fault}")
    pages = [path for path in paths if path.suffix == ".md"]
    mean = mean_words(pages)
    print(f"{len(faults)} faults in {len(paths)} files; {mean:.1f} words a sentence on {len(pages)} pages.")
    return int(bool(faults) or mean > MOST_WORDS_ON_AVERAGE)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
