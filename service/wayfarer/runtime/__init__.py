"""Worlds in time: threads, clocks, streams, what is kept on disk."""
