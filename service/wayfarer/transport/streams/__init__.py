"""Streams of motion: what each reader gets, as wire messages."""
