"""The last lines that an instance logged; a component that logs without end costs no memory."""

from __future__ import annotations

from collections import deque

LINES_KEPT = 20
LONGEST_LINE = 500


class LogTail:
    """Keeps the last lines that a component logged, for the message of an error."""

    def __init__(self) -> None:
        self._lines: deque[str] = deque(maxlen=LINES_KEPT)
        self.count = 0

    def add(self, status: int, text: bytes | None) -> None:
        """Take one line from the component."""
        self.count += 1
        self._lines.append((text or b"")[:LONGEST_LINE].decode("utf-8", "replace"))

    def take(self) -> tuple[str, ...]:
        """Return the lines kept, and forget them."""
        lines = tuple(self._lines)
        self._lines.clear()
        return lines
