"""TOML of drawn spellings: documents and scenes are read equal, and their keys are found in place."""

from __future__ import annotations

import random
from pathlib import Path
from typing import Any

from soak import _drawn_files as files
from soak.cut_runs import body_tables
from soak.scenes import LINES, VALUES, wrong_message
from vibroimpact.fmus.errors import SceneError
from vibroimpact.fmus.safe_toml import parse_toml
from vibroimpact.orchestrator.campaign.manifest import flat_scene
from vibroimpact.orchestrator.scene import Scene, load_scene
from vibroimpact.service.places import Places
from vibroimpact.service.scenes import located

CASES, SAMPLE, SECONDS = files.CASES, files.SAMPLE, files.SECONDS

KEYS = ("a", "b_1", "mass", "k-2", "7", "with blank", "ä", "a.b", "x=y", "#no")
TEXTS = ("", "word", 'a "quoted" word', "it's", "ä𝄞", "a\nb", "a\\b", "# no comment", "]", "=", "'''", "\t")
NUMBERS = (0.0, -1.5, 1e-300, 1.7e308, 5e-324, 1 / 3, 2.0, 123456.789)


def drawn_tables(draw: random.Random, depth: int = 3) -> dict[str, Any]:
    """Return a document of values, arrays and tables."""
    return {key: _drawn_value(draw, depth) for key in draw.sample(KEYS, draw.randint(1, 4))}


def _drawn_value(draw: random.Random, depth: int) -> Any:
    match draw.randrange(8 if depth else 5):
        case 0:
            return draw.choice((0, 7, -12, 2**31, 1_000_000))
        case 1:
            return draw.choice(NUMBERS)
        case 2:
            return draw.random() < 0.5
        case 3 | 4:
            return draw.choice(TEXTS)
        case 5:
            return [_drawn_value(draw, 0) for _ in range(draw.randint(0, 4))]
        case 6:
            return [drawn_tables(draw, 0) for _ in range(draw.randint(1, 3))]
        case _:
            return drawn_tables(draw, depth - 1)


class Spelling:
    """Writes documents, each value and table in one of TOML's spellings; knows the lines of keys."""

    def __init__(self, draw: random.Random) -> None:
        self._draw = draw
        self._lines: list[str] = []
        self.places: dict[str, int] = {}

    def text(self, tables: dict[str, Any]) -> str:
        """Return the text of a document."""
        self._table(tables, ())
        return "\n".join(self._lines) + "\n"

    def _table(self, table: dict[str, Any], path: tuple[str, ...], place: str = "") -> None:
        draw = self._draw
        later = {key: value for key, value in table.items() if _is_apart(value) and draw.random() < 0.8}
        for key, value in table.items():
            if key in later:
                continue
            if draw.random() < 0.1:
                self._lines += [draw.choice(("", "# a comment = 1", "   # [no table]"))]
            equals, comment = draw.choice((" = ", "=", "  =\t")), draw.choice(("", "", " # a comment"))
            self._lines += f"{_key(draw, key)}{equals}{self._value(value)}{comment}".split("\n")
            self.places.setdefault(f"{place}.{key}".lstrip("."), len(self._lines))
        for key, value in later.items():
            inner = f"{place}.{key}".lstrip(".")
            head = ".".join(_key(draw, part) for part in (*path, key))
            for number, one in enumerate(value if isinstance(value, list) else [value], 1):
                self._lines.append(f"[[{head}]]" if isinstance(value, list) else f"[ {head} ]")
                self._table(one, (*path, key), f"{inner}[{number}]" if isinstance(value, list) else inner)

    def _value(self, value: Any) -> str:
        draw = self._draw
        if isinstance(value, bool):
            return str(value).lower()
        if isinstance(value, int):
            forms = [str(value)] + (
                [f"0x{value:x}", f"0o{value:o}", f"0b{value:b}", f"+{value}", f"{value:_}"]
                if value >= 0
                else []
            )
            return draw.choice(forms)
        if isinstance(value, float):
            return draw.choice((repr(value), f"{value:.17e}", f"{value:+.17e}"))
        if isinstance(value, str):
            return _text(draw, value)
        if isinstance(value, list):
            between = draw.choice((", ", ",", ",\n  ", ", # next\n  "))
            inner = between.join(self._value(one) for one in value)
            return f"[{inner}{draw.choice(('', ',')) if value else ''}]"
        return "{ " + ", ".join(f"{_key(draw, key)} = {self._flat(one)}" for key, one in value.items()) + " }"

    def _flat(self, value: Any) -> str:
        """Return a value on one line, as in an inline table."""
        written = self._value(value)
        while "\n" in written:
            written = self._value(value)
        return written


def _is_apart(value: Any) -> bool:
    """Whether a value can be written as separate tables."""
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(one, dict) for one in value)
    )


def _key(draw: random.Random, key: str) -> str:
    if key.isascii() and key.replace("_", "").replace("-", "").isalnum() and draw.random() < 0.8:
        return key
    return f"'{key}'" if draw.random() < 0.5 else f'"{key}"'


def _text(draw: random.Random, text: str) -> str:
    basic = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    forms = [f'"{basic}"', f'"""{basic}"""']
    if "'" not in text and "\n" not in text:
        forms.append(f"'{text}'")
    if "'''" not in text and not text.endswith("'"):
        forms.append(f"'''\n{text}'''")
    if text.isascii() and text.isalnum():
        forms.append('"' + "".join(f"\\u{ord(one):04x}" for one in text) + '"')
    return draw.choice(forms)


def _document(draw: random.Random) -> str | None:
    tables = drawn_tables(draw)
    spelling = Spelling(draw)
    text = spelling.text(tables)
    found = parse_toml(text)
    if found != tables:
        return f"{found} for {tables}: {text!r}"
    places = Places(text)
    for key, line in spelling.places.items():
        if all(
            part.replace("_", "a").isalnum() and part.isascii()
            for part in key.replace("[", ".").replace("]", "").split(".")
        ):
            first = next(at for at, one in enumerate(text.split("\n"), 1) if at <= line)
            got = places.of(key)[0]
            if not first <= got <= line:
                return f"{key}: line {got} for {line}: {text!r}"
    return None


def _scene(draw: random.Random) -> str | None:
    """Read a scene in another spelling; it equals the scene of its tables."""
    tables = body_tables(draw)
    known = Scene.from_dict(tables)
    path = Path("scene.toml")
    text = Spelling(draw).text(tables)
    path.write_text(text, encoding="utf-8")
    found = load_scene(path)
    return None if flat_scene(found) == flat_scene(known) else f"another scene: {text!r}"


def _odd(draw: random.Random) -> str | None:
    """Read a scene with odd values and lines, and find the places of its problems."""
    lines = Spelling(draw).text(body_tables(draw) if draw.random() < 0.7 else drawn_tables(draw)).split("\n")
    for _ in range(draw.choice((1, 1, 3, 9))):
        place = draw.randrange(len(lines))
        key, equals, _ = lines[place].partition("=")
        if equals and draw.random() < 0.6:
            lines[place] = f"{key}= {draw.choice(VALUES)}"
        else:
            lines.insert(place, draw.choice(LINES))
    text = "\n".join(lines)
    path = Path("scene.toml")
    path.write_text(text, encoding="utf-8", errors="replace")
    try:
        load_scene(path)
    except SceneError as refusal:
        problems = [problem.replace(str(path), "scene", 1) for problem in refusal.problems]
        found = located(problems, path.read_text(encoding="utf-8"))
        most = text.count("\n") + 1
        if any(not 1 <= one["line"] <= most or one["column"] < 1 for one in found):
            return f"places outside of the text: {found}"
        return wrong_message(str(refusal))
    return None


def check(seed: int) -> str | None:
    """Read one document."""
    draw = random.Random(seed)
    with files.bounded_memory() as grown:
        problem = draw.choice((_document, _scene, _odd))(draw)
    return problem or grown()
