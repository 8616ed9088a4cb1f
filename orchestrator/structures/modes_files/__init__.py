"""Files of modes, from measurements or other programs: TOML, CSV, NetCDF and universal files (UFF 55)."""

from vibroimpact.orchestrator.structures.modes_files.reading import read_modes
from vibroimpact.orchestrator.structures.modes_files.writing import write_modes

__all__ = ["read_modes", "write_modes"]
