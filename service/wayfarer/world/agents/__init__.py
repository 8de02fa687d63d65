"""Agents in their slots: columns, sessions, records."""
