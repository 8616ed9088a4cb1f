"""What Prometheus reads: jobs by state, points of those that run, all from the store at the moment of the question."""

from __future__ import annotations

import time
from collections.abc import Iterator

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric

from vibroimpact.service.store import State, Store

CONTENT_TYPE = CONTENT_TYPE_LATEST
MOST_TOLD = 1000


class _Jobs:
    """Collects what the store knows."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics."""
        jobs = GaugeMetricFamily("vibroimpact_jobs", "Jobs by state.", labels=["state"])
        for state, count in self._store.counts().items():
            jobs.add_metric([state], count)
        yield jobs
        total = GaugeMetricFamily("vibroimpact_points", "Points of a job that runs.", labels=["job"])
        done = GaugeMetricFamily("vibroimpact_points_done", "Those that are done.", labels=["job"])
        rate = GaugeMetricFamily(
            "vibroimpact_points_per_second", "Points done a second since it was started.", labels=["job"]
        )
        for job in self._store.jobs(most=MOST_TOLD):
            if job.state == State.running and job.started is not None:
                total.add_metric([job.id], job.total)
                done.add_metric([job.id], job.done)
                rate.add_metric([job.id], job.done / max(time.time() - job.started, 1e-3))
        yield from (total, done, rate)


def exposition(store: Store) -> bytes:
    """Return all metrics in the text format of Prometheus."""
    registry = CollectorRegistry()
    registry.register(_Jobs(store))
    return generate_latest(registry)
