"""What the service says of itself on its standard error: lines of JSON, with the job that they are about."""

from __future__ import annotations

import json
import logging
import sys
import time
from typing import Any

FACTS = ("job", "state", "why", "method", "path", "status", "seconds", "client", "left_out")
"""What a line may have beside its time, level and event; headers and queries, where secrets would be, are not."""

MOST_ALIKE = 20
"""Lines alike in `ALIKE_SECONDS`, above which more are counted only: strangers cause them, as many as they like."""
ALIKE_SECONDS = 60.0
_BEGINNING = 40
"""Characters by which a message of a library is known again."""


class _Seldom(logging.Filter):
    """Lets a few lines that are alike pass, and says in the next one how many were left out.

    The service's own lines pass always, but for those with `alike`, which says what they are alike in.
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
    """Writes a record as one line of JSON.

    >>> record = logging.makeLogRecord({"msg": "job", "created": 0.0, "levelname": "INFO", "job": "a1"})
    >>> _Lines().format(record)
    '{"at": "1970-01-01T00:00:00.000Z", "level": "info", "event": "job", "job": "a1"}'
    """

    def format(self, record: logging.LogRecord) -> str:
        """Return the line."""
        at = time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(record.created))
        line: dict[str, Any] = {"at": f"{at}.{int(record.created % 1 * 1000):03d}Z"}
        line |= {"level": record.levelname.lower(), "event": record.getMessage()}
        line |= {name: getattr(record, name) for name in FACTS if getattr(record, name, "") != ""}
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line)


def write_lines() -> None:
    """Let this process log in lines of JSON: of the service all, of the rest what is wrong."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Lines())
    handler.addFilter(_Seldom())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logging.getLogger("vibroimpact.service").setLevel(logging.INFO)
