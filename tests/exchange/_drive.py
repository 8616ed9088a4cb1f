"""Driver of one tool, in its own Python, with an FMU, a pair or a system: `python -m exchange._drive REQUEST`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from exchange import _couple, _model_exchange, _single, _stiff, _system

if __name__ == "__main__":
    request = json.loads(sys.argv[1])
    kind = _system if "system" in request else _couple if "fmus" in request else _single
    if "tolerance" in request:
        kind = _stiff if "stop_time" in request else _model_exchange
    Path(request["answer"]).write_text(json.dumps(kind.DRIVERS[request["tool"]](request)))
