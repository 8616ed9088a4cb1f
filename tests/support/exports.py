"""An export of any component, the one that plays a recording among them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from support.replay_records import SIGNALS
from vibroimpact.fmus.packaging.export import REPLAY, export_fmu
from vibroimpact.fmus.packaging.replay_fmu import build_replay


def exported(name: str, path: Path, *, fmi: str = "3.0", **options: Any) -> Path:
    """Return an FMU for other tools; a Replay has no options."""
    if name == REPLAY:
        return build_replay(SIGNALS, path, fmi=fmi)
    return export_fmu(name, path, fmi=fmi, **options)
