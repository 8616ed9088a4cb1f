"""Drives one tool with one FMU, or with two that it couples, in its own Python: `python -m exchange._drive REQUEST`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from exchange import _couple, _single

if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    drivers = _couple.DRIVERS if "fmus" in request else _single.DRIVERS
    Path(request["answer"]).write_text(json.dumps(drivers[request["tool"]](request)))
