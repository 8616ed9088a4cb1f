"""Each name of a variable is parsed once: FMPy takes 5 to 15 ms for one, and our FMUs share most of theirs."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from lark import Lark


@pytest.fixture(scope="session", autouse=True)
def names_parsed_once() -> Iterator[None]:
    parse, known = Lark.parse, {}

    def parse_once(parser: Lark, text: str, *options: Any) -> Any:
        key = (parser.source_grammar, text, *options)
        if key not in known:
            known[key] = parse(parser, text, *options)
        return known[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Lark, "parse", parse_once)
        yield
