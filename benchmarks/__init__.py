"""Benchmarks of the service; docs/measuring.md explains how to run them."""

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported
