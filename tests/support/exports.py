"""An export of any component, including the one that plays a recording."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import Any

from support.replay_records import SIGNALS
from vibroimpact.fmus.packaging.export import REPLAY, export_fmu
from vibroimpact.fmus.packaging.replay_fmu import build_replay


def exported(name: str, path: Path, *, fmi: str = "3.0", **options: Any) -> Path:
    """Return an FMU for other tools; without options it is made once in a process. A Replay has no options."""
    if name != REPLAY and options:
        return export_fmu(name, path, fmi=fmi, **options)
    path.write_bytes(_plain(name, fmi))
    return path


@cache
def _plain(name: str, fmi: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "x.fmu")
        made = build_replay(SIGNALS, path, fmi=fmi) if name == REPLAY else export_fmu(name, path, fmi=fmi)
        return made.read_bytes()
