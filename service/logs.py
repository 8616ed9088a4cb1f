"""What the service says of itself on its standard error: lines of JSON, with the job that they are about."""

from __future__ import annotations

import json
import logging
import sys
import time
from typing import Any

FACTS = ("job", "state", "why", "method", "path", "status", "seconds", "client")
"""What a line may have beside its time, level and event; headers and queries, where secrets would be, are not."""


class _Lines(logging.Formatter):
    """Writes a record as one line of JSON.

    Examples
    --------
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
    logging.basicConfig(handlers=[handler], level=logging.WARNING, force=True)
    logging.getLogger("vibroimpact.service").setLevel(logging.INFO)
