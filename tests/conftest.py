"""For all tests: hypothesis judges results, never speed (the machines are shared)."""

from hypothesis import settings

import wayfarer  # noqa: F401  switches telemetry of the engines off before they are imported

settings.register_profile("steady", deadline=None)
settings.load_profile("steady")
