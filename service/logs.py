"""Log of the service on its standard error: lines of JSON, each with its job."""

from __future__ import annotations

import json
import logging
import sys
import time
from typing import Any

FACTS = ("job", "state", "why", "method", "path", "status", "seconds", "client", "left_out")
"""Keys of a line besides its time, level and event; headers and queries, which may hold secrets, are excluded."""

MOST_ALIKE = 20
"""Number of similar lines in `ALIKE_SECONDS` above which more are only counted: clients can cause any number."""
ALIKE_SECONDS = 60.0
_BEGINNING = 40
"""Number of characters that identify a message of a library."""


class _RepeatFilter(logging.Filter):
    """Filter that passes a few similar lines, and adds the number of omitted ones to the next.

    The service's own lines always pass, except those with `alike`, which names their kind.
    """

    def __init__(self) -> None:
        super().__init__()
        self._seen: dict[str, tuple[float, int]] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a line is written."""
        ours = record.name.startswith("vibroimpact")
        kind = getattr(record, "alike", "" if ours else f"{record.name} {record.msg}"[:_BEGINNING])
        if not kind:
            return True
        began, count = self._seen.get(kind, (record.created, 0))
        if record.created - began >= ALIKE_SECONDS:
            if count > MOST_ALIKE:
                record.left_out = count - MOST_ALIKE
            began, count = record.created, 0
        self._seen[kind] = (began, count + 1)
        return count < MOST_ALIKE


class _Lines(logging.Formatter):
    """Formatter of a record as one line of JSON.

    >>> record = logging.makeLogRecord({"msg": "job", "created": 0.0, "levelname": "INFO", "job": "a1"})
    >>> _Lines().format(record)
    '{"at": "1970-01-01T00:00:00.000Z", "level": "info", "event": "job", "job": "a1"}'
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return a record as its line."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line: dict[str, Any] = {"at": f"{at}.{int(record.created % 1 * 1000):03d}Z"}
        line |= {"level": record.levelname.lower(), "event": record.getMessage()}
        line |= {name: getattr(record, name) for name in FACTS if getattr(record, name, "") != ""}
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


def write_lines() -> None:
    """Let this process log in lines of JSON: all of the service's messages, warnings of other modules."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Lines())
    handler.addFilter(_RepeatFilter())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logging.getLogger("vibroimpact.service").setLevel(logging.INFO)
