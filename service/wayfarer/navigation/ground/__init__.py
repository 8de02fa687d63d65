"""Floors, solids and meshes → the ground that can be stood on, in layers, before any radius."""
