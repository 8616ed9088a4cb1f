"""Non-ASCII signs in numbers: the minus of typesetters, and blanks between thousands."""

from __future__ import annotations

import re

# before a digit, at the start of a cell or of an exponent
_MINUS = re.compile('(?<![^\\s;,\t|"eE])\u2212(?=[\\d.,])')
# narrow, fixed and thin blanks between groups of three digits; a plain one only in a cell of its own
_BLANKS = "\u202f\u00a0\u2009"
_GROUPS = re.compile(rf"(?<=\d)[{_BLANKS}](?=\d{{3}}(?!\d))")
_PLAIN = re.compile(
    r"(?:(?<=[;\t|\"])|^)([-+]?[1-9]\d{0,2}(?: \d{3}){1,4}(?:[.,]\d{1,18})?)(?=[;\t|\"]|$)", re.M
)
_PLAIN_GROUP = re.compile(r"\d \d{3}(?!\d)")
_FIRST_LINES = 20_000
"""Characters in which a delimiter other than a blank is searched."""


def with_plain_numbers(content: str) -> str:
    """Return a text whose numbers have ASCII signs and no blanks between thousands.

    >>> with_plain_numbers("0,1;\\u22123\\u202f549,5;2 000"), with_plain_numbers("1 200 3")
    ('0,1;-3549,5;2000', '1 200 3')
    """
    if "\u2212" in content:
        content = _MINUS.sub("-", content)
    if not any(mark in content[:_FIRST_LINES] for mark in (";", "\t", "|", '"')):
        return content
    if any(blank in content for blank in _BLANKS):
        content = _GROUPS.sub("", content)
    if " " not in content or _PLAIN_GROUP.search(content) is None:
        return content
    return _PLAIN.sub(lambda match: match[1].replace(" ", ""), content)
