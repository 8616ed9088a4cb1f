"""A scene file with the settings of a way; its comments and the order of its tables stay."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import tomli_w

from vibroimpact.fmus.safe_toml import parse_toml

TABLE = "execution"
_HEADER = re.compile(rf"^[ \t]*\[[ \t]*{TABLE}[ \t]*\][ \t]*(#.*)?$", re.MULTILINE)
_NEXT_HEADER = re.compile(r"^[ \t]*\[", re.MULTILINE)


def tuned_text(text: str, settings: Mapping[str, Any], reason: str) -> str:
    """Return a scene's TOML with new settings in `[execution]`, and the reason as a comment above them.

    The whole text is written anew where lines cannot be inserted into the table. `settings` have keys without the
    name of the table.

    Examples
    --------
    >>> print(tuned_text("[body]\\nmass = 1 # kg\\n", {"how": "fused"}, "the cheapest"), end="")
    [body]
    mass = 1 # kg
    <BLANKLINE>
    [execution]
    # the cheapest
    how = "fused"
    """
    lines = [f"# {line}" for line in reason.splitlines()] + tomli_w.dumps(dict(settings)).splitlines()
    expected = parse_toml(text)
    expected[TABLE] = {**expected.get(TABLE, {}), **settings}
    header = _HEADER.search(text)
    if header is None:
        found = f"{text.rstrip()}\n\n[{TABLE}]\n" + "\n".join(lines) + "\n"
    else:
        after = _NEXT_HEADER.search(text, header.end())
        end = len(text) if after is None else after.start()
        own = re.compile(rf"^[ \t]*({'|'.join(map(re.escape, settings))})[ \t]*=.*\n?", re.MULTILINE)
        kept = own.sub("", text[header.end() : end].lstrip("\n"))
        found = text[: header.end()] + "\n" + "\n".join(lines) + "\n" + kept + text[end:]
    try:
        if parse_toml(found) == expected:
            return found
    except ValueError:
        pass  # the table has a key of several lines or another form: all of the text is written anew
    return "\n".join(f"# {line}" for line in reason.splitlines()) + "\n" + tomli_w.dumps(expected)
