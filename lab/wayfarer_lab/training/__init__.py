"""Prepared motion → trained networks → exported graphs."""
