"""`/metrics` of all workers as one page: each sample with the label `worker`."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Final

from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.parser import text_string_to_metric_families
from prometheus_client.registry import Collector

from wayfarer.workers.process import WorkerProcess

LABEL: Final = "worker"


class _Pages(Collector):
    def __init__(self, pages: Mapping[int, str], workers: Sequence[WorkerProcess]) -> None:
        self._pages = pages
        self._workers = workers

    def collect(self) -> Iterator[Metric]:
        """Families of all pages, one of a name."""
        families: dict[str, Metric] = {}
        for worker, page in self._pages.items():
            for family in text_string_to_metric_families(page):
                whole = families.setdefault(
                    family.name, Metric(family.name, family.documentation, family.type)
                )
                for sample in family.samples:
                    labels = {LABEL: str(worker), **sample.labels}
                    whole.samples.append(sample._replace(labels=labels))
        yield from families.values()
        yield from _of_workers(self._workers)


def _of_workers(workers: Iterable[WorkerProcess]) -> Iterator[Metric]:
    ready = GaugeMetricFamily("wayfarer_worker_ready", "1 while it takes work", labels=[LABEL])
    restarts = CounterMetricFamily(
        "wayfarer_worker_restarts", "Times it was started again", labels=[LABEL]
    )
    for worker in workers:
        ready.add_metric([str(worker.index)], float(worker.report.ready))
        restarts.add_metric([str(worker.index)], worker.restarts)
    yield ready
    yield restarts


def merged_page(pages: Mapping[int, str], workers: Sequence[WorkerProcess]) -> bytes:
    """All in Prometheus' text format. `pages`: those of the running workers, by number."""
    registry = CollectorRegistry()
    registry.register(_Pages(pages, workers))
    return generate_latest(registry)
