"""Systems for exchange: scenes of components to SSP archives, and back."""

from __future__ import annotations

from vibroimpact.orchestrator.ssp.opening import is_system, opened_scene, refuse_system_elsewhere, say_notes

TYPE_CHECKING = False
if TYPE_CHECKING:
    from vibroimpact.orchestrator.ssp.exporting import export_system
    from vibroimpact.orchestrator.ssp.importing import Imported, import_system, load_system

_HOMES = {"export_system": "exporting"} | dict.fromkeys(
    ("Imported", "import_system", "load_system"), "importing"
)
__all__ = [
    "Imported",
    "export_system",
    "import_system",
    "is_system",
    "load_system",
    "opened_scene",
    "refuse_system_elsewhere",
    "say_notes",
]


if not TYPE_CHECKING:  # else every name would be one

    def __getattr__(name: str) -> object:
        # the reader of model descriptions takes time to load, and most scenes are no systems
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        import importlib

        return getattr(importlib.import_module(f"{__name__}.{_HOMES[name]}"), name)
