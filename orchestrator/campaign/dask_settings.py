"""Settings of Dask for a campaign; docs/clusters.md says what they are worth."""

from __future__ import annotations

from typing import Any

QUIET: dict[str, Any] = {
    "distributed.worker.profile.enabled": False,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": False,
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.admin.system-monitor.gil.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.tick.limit": "1h",
    "distributed.scheduler.active-memory-manager.start": False,
    "distributed.scheduler.work-stealing-interval": "100ms",
    "distributed.client.scheduler-info-interval": "10s",
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    # A chunk whose worker died twice is handed back, so that the campaign can find the point that kills.
    "distributed.scheduler.allowed-failures": 1,
    "logging": {"distributed": "critical"},
}
"""Settings of Dask: what it does beside the work is switched off or slowed down."""
