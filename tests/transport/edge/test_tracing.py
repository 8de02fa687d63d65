import subprocess
import sys

import pytest

from wayfarer.transport.edge.tracing import OtlpTracing, Tracing, tracing

PARENT = {"traceparent": "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"}


@pytest.fixture
def spans():
    from opentelemetry.sdk.trace.export.in_memory_span_exporter import InMemorySpanExporter

    exporter = InMemorySpanExporter()
    traces = OtlpTracing("", exporter)

    def finished() -> list:
        traces.close()
        return list(exporter.get_finished_spans())

    return traces, finished


def test_a_span_for_a_call_that_continues_its_clients_trace(spans):
    traces, finished = spans
    with traces.call("GET", PARENT) as rename:
        rename("GET /v1/agents/{agent_id}")
    with pytest.raises(ValueError, match="secret"), traces.call("GET", {}):
        raise ValueError("secret")
    good, bad = finished()
    assert good.name == "GET /v1/agents/{agent_id}"
    assert f"{good.context.trace_id:032x}" == "0af7651916cd43dd8448eb211c80319c"
    assert not bad.status.is_ok and "secret" not in bad.to_json()


def test_a_span_for_an_engine_call(spans):
    traces, finished = spans
    traces.step(7, 0.05)
    (span,) = finished()
    assert (span.name, span.attributes["agents"]) == ("step", 7)
    assert span.end_time - span.start_time == pytest.approx(50_000_000, abs=1000)


def test_off_by_default():
    assert type(tracing("")) is Tracing
    with tracing("").call("GET", PARENT) as rename:
        rename("x")


def test_a_server_without_traces_does_not_load_opentelemetry():
    code = (
        "import sys, wayfarer.commands.serve; "
        "sys.exit(any(m.startswith('opentelemetry.sdk') for m in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
