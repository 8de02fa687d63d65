"""The faults of all worlds of a server: counted, and logged once each."""

import threading
from typing import Final

import structlog

from wayfarer.runtime.metrics_sink import MetricsSink
from wayfarer.world.agents.faults import Fault

log = structlog.get_logger(__name__)

REMEMBERED: Final = 1024
"""Maximum number of places in the code whose errors have been logged with their traceback."""


class FaultLog:
    """A `Report`, for any number of worlds. Thread-safe."""

    def __init__(self, meter: MetricsSink) -> None:
        self._meter = meter
        self._lock = threading.Lock()
        self._traced: set[tuple[str, str, int]] = set()

    def __call__(self, fault: Fault) -> None:
        """Counts a fault; logs it unless the same agent or session had it before.

        The traceback is logged once for each place in the code.
        """
        self._meter.fault(fault.stage)
        is_new = self._is_new(fault)
        labels = {
            name: value
            for name, value in (("session", fault.session_id), ("agent", fault.agent_id))
            if value
        }
        if is_new or (labels and fault.times == 1):
            log.error(
                "an error was contained: all others continue",
                stage=str(fault.stage),
                error=repr(fault.error),
                exc_info=fault.error if is_new else None,
                **labels,
            )
        if fault.given_up:
            log.error("not tried again by itself", stage=str(fault.stage), **labels)

    def _is_new(self, fault: Fault) -> bool:
        """Whether this is the first error at its place in the code."""
        trace = fault.error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        where = ("", 0) if trace is None else (trace.tb_frame.f_code.co_filename, trace.tb_lineno)
        place = (f"{fault.stage} {type(fault.error).__name__}", *where)
        with self._lock:
            if place in self._traced:
                return False
            if len(self._traced) >= REMEMBERED:
                self._traced.clear()
            self._traced.add(place)
            return True
