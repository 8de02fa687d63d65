"""Settings: their values, sources, limits and description."""
