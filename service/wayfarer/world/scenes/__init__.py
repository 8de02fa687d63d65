"""Scenes of a world: ways through them, and the guide that puts both into a step."""
