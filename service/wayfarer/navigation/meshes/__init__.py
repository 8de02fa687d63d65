"""Mesh files from clients → triangles: strict readers that follow no reference out of the file."""
