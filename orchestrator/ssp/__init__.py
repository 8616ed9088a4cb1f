"""Systems that travel: scenes of components to SSP archives, and back."""

from __future__ import annotations

from vibroimpact.orchestrator.ssp.exporting import export_system
from vibroimpact.orchestrator.ssp.importing import Imported, import_system, load_system, opened_scene

__all__ = ["Imported", "export_system", "import_system", "load_system", "opened_scene"]
