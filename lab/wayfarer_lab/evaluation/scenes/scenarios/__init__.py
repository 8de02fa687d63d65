"""Scenarios in the example scenes; each makes one or two rows."""
