"""The `wayfarer` command and its sub-commands."""
