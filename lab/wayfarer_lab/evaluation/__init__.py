"""Metrics and tables over the same engine that serves."""
