"""OpenTelemetry spans of calls and of engine calls, but not of messages. Off by default.

The packages come with the extra `otel` and are imported only if traces are wanted. Sampling,
headers and the like are set by OpenTelemetry's own variables (OTEL_TRACES_SAMPLER, …).
"""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from wayfarer import __version__


def _unnamed(name: str) -> None:
    """Does nothing, since there is no span."""


class Tracing:
    """Receives spans; this one drops them."""

    @contextmanager
    def call(self, name: str, headers: Mapping[str, str]) -> Iterator[Callable[[str], None]]:
        """A context manager around a call; `headers` may carry the client's `traceparent`.

        It yields a function that renames the span.
        """
        yield _unnamed

    def step(self, agents: int, seconds: float) -> None:
        """Records an engine call that has just ended."""

    def close(self) -> None:
        """Sends the remaining spans."""


class OtlpTracing(Tracing):
    """Spans over OTLP. A thread of the library sends them in batches."""

    def __init__(self, endpoint: str, exporter: Any = None) -> None:
        """Raises ModuleNotFoundError without the extra. `exporter`: replaces OTLP's."""
        from opentelemetry.exporter.otlp.proto.grpc.trace_exporter import OTLPSpanExporter
        from opentelemetry.propagate import extract
        from opentelemetry.sdk.resources import Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
        from opentelemetry.trace import SpanKind, StatusCode

        resource = Resource.create({"service.name": "wayfarer", "service.version": __version__})
        self._provider = TracerProvider(resource=resource, shutdown_on_exit=False)
        self._provider.add_span_processor(
            BatchSpanProcessor(exporter or OTLPSpanExporter(endpoint=endpoint))
        )
        self._tracer = self._provider.get_tracer("wayfarer", __version__)
        self._extract = extract
        self._server = SpanKind.SERVER
        self._failed = StatusCode.ERROR

    @contextmanager
    def call(self, name: str, headers: Mapping[str, str]) -> Iterator[Callable[[str], None]]:
        """Implements `Tracing`."""
        with self._tracer.start_as_current_span(
            name,
            context=self._extract(headers),
            kind=self._server,
            record_exception=False,  # its text belongs in the log, which removes secrets
            set_status_on_exception=False,
        ) as span:
            try:
                yield span.update_name
            except BaseException:
                span.set_status(self._failed)
                raise

    def step(self, agents: int, seconds: float) -> None:
        """Implements `Tracing`."""
        end = time.time_ns()
        span = self._tracer.start_span(
            "step", start_time=end - round(1e9 * seconds), attributes={"agents": agents}
        )
        span.end(end)

    def close(self) -> None:
        """Implements `Tracing`."""
        self._provider.shutdown()


def tracing(endpoint: str) -> Tracing:
    """A tracer that exports to an OTLP endpoint, or traces nothing if that is empty."""
    return OtlpTracing(endpoint) if endpoint else Tracing()
