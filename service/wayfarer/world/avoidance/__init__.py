"""Collision avoidance: directions that are tried, and their free paces."""
