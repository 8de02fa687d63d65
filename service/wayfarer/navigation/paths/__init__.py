"""Ways over a navigation mesh: search, string pulling, following."""
