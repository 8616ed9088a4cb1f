"""HTML tables hold their contents unchanged, and no content is markup."""

from __future__ import annotations

from html.parser import HTMLParser

from hypothesis import given
from hypothesis import strategies as st

from vibroimpact.fmus.html_view import MOST_ROWS, html_table
from vibroimpact.fmus.printable import printable

TAGS = {"table", "caption", "thead", "tbody", "tr", "th", "td"}
NAMES = st.one_of(
    st.text(), st.sampled_from(["<script>alert(1)</script>", '"><img src=x onerror=y>', "&lt;", "]]>"])
)


class Read(HTMLParser):
    """The tags and the cells of a table."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.cells: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert not attrs
        self.tags.add(tag)
        if tag in ("caption", "th", "td"):
            self.cells.append("")

    def handle_data(self, data: str) -> None:
        self.cells[-1] += data


@given(NAMES, st.lists(st.tuples(NAMES, NAMES), max_size=5))
def test_names_of_strangers_are_shown_and_are_no_markup(caption: str, rows: list[tuple[str, str]]) -> None:
    read = Read(html_table(caption, ("a", "b"), rows))
    assert read.tags <= TAGS
    assert read.cells == [
        printable(each) for each in (caption, "a", "b", *(cell for row in rows for cell in row))
    ]


def test_more_rows_than_fit_are_counted() -> None:
    read = Read(html_table("many", (), [(number,) for number in range(MOST_ROWS + 7)]))
    assert read.cells[-1] == "and 7 more"
    assert len(read.cells) == 1 + MOST_ROWS + 1
