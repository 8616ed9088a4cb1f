"""Where the problems of a submitted scene are."""

from __future__ import annotations

import time

import pytest

from vibroimpact.service.scenes import located


@pytest.mark.parametrize(
    ("key", "text", "line", "column"),
    [
        ("body.mass", "body.mass = -1", 1, 1),
        ("body.mass", "body = { stiffness = 1, mass = -1 }", 1, 25),
        ("body.mass", "[body]\r\nmass = -1\r\n", 2, 1),
        ("body.mass", "\ufeff[body]\nmass = -1", 2, 1),
        ("body.mass", '["body"]\n"mass" = -1', 2, 1),
        ("body.mass", "[ body ] # [other]\n  mass = -1", 2, 3),
        ("body.mass", "[body] # says nothing\nstiffness = 1", 1, 1),
        ("sweep.body.mass", '[sweep]\n"body.mass" = 3', 2, 1),
        ("stop[2].position", "[[stop]]\nposition = 1\n[[stop]]\nposition = 2", 4, 1),
        ("stop[2].position", "stop = [{ position = 1 }, { position = 2 }]", 1, 29),
        ("body.mass", '# """\nt = """\n[body]\nmass = 3\n"""\n[body]\nmass = -1', 7, 1),
        ("body.mass", "t = '''\n[body]\nmass = 3\n'''\n[body]\nmass = -1", 6, 1),
        ("body.mass", "[scene]\ntitle = 'a\u2028b\x85c'\n[body]\nmass = -1", 4, 1),
    ],
)
def test_a_problem_is_where_its_key_is_written(key: str, text: str, line: int, column: int) -> None:
    found = located(f"scene: {key}: expected a number > 0, got -1.", text)
    assert (found["line"], found["column"]) == (line, column)


def test_the_place_in_a_megabyte_of_quotes_is_found_at_once() -> None:
    text = "# " + '"""\\' * 250_000 + "\n[body]\nmass = -1"
    began = time.process_time()
    assert located("scene: body.mass: expected a number > 0, got -1.", text)["line"] == 3
    assert time.process_time() - began < 5.0
