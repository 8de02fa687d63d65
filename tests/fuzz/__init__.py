"""Hostile inputs for a running server: see benchmarks/fuzz.py for the long form."""
