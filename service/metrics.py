"""Metrics for Prometheus: jobs by state and points of running jobs, read from the store at each request."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from prometheus_client import CONTENT_TYPE_LATEST, CollectorRegistry, generate_latest
from prometheus_client.core import GaugeMetricFamily, Metric

from vibroimpact.orchestrator.campaign.workers.processors import processor_count
from vibroimpact.service.store import Job, Kind, State, Store

CONTENT_TYPE = CONTENT_TYPE_LATEST


class _Jobs:
    """Collector of the store's numbers."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def collect(self) -> Iterator[Metric]:
        """Yield the metrics."""
        jobs = GaugeMetricFamily("vibroimpact_jobs", "Jobs by state.", labels=["state"])
        for state, count in self._store.counts().items():
            jobs.add_metric([state], count)
        yield jobs
        running = [job for job in self._store.jobs_in(State.running) if job.started is not None]
        yield _of_each("points", "Points of a job that runs.", {job.id: job.total for job in running})
        yield _of_each("points_done", "Those that are done.", {job.id: job.done for job in running})
        yield _of_each("workers", "Workers that it may use.", {job.id: _workers(job) for job in running})
        rates = {job.id: self._store.rate(job.id) for job in running}
        yield _of_each("points_per_second", "Points done a second, of late.", rates)
        seconds = {job.id: _workers(job) / rates[job.id] for job in running if rates[job.id] > 0}
        yield _of_each("seconds_per_point", "Seconds of a worker that a point takes, of late.", seconds)
        outcomes = GaugeMetricFamily(
            "vibroimpact_outcomes", "Points by how they ended, of jobs that have ended.", labels=["outcome"]
        )
        for outcome, count in self._store.outcomes().items():
            outcomes.add_metric([outcome], count)
        yield outcomes


def _of_each(name: str, meaning: str, values: Mapping[str, float]) -> Metric:
    """Return a metric with a value for each job."""
    metric = GaugeMetricFamily(f"vibroimpact_{name}", meaning, labels=["job"])
    for job, value in values.items():
        metric.add_metric([job], value)
    return metric


def _workers(job: Job) -> int:
    """Return the number of worker processes of a job; a scheduler may have another number."""
    return (job.workers or processor_count()) if job.kind == Kind.campaign else 1


def exposition(store: Store) -> bytes:
    """Return all metrics in the text format of Prometheus."""
    registry = CollectorRegistry()
    registry.register(_Jobs(store))
    return generate_latest(registry)
