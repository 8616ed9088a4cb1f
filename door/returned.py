"""Datasets that callers get of files that are written first."""

from __future__ import annotations

import threading

ONE_AT_A_TIME = threading.Lock()
"""Held while datasets are written and read back: NetCDF's library is not for several threads at once."""
