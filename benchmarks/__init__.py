"""What the service costs; docs/measuring.md tells how to run these."""

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported
