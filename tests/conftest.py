"""For all tests: hypothesis judges results, never speed (the machines are shared)."""

from hypothesis import settings

settings.register_profile("steady", deadline=None)
settings.load_profile("steady")
