"""Mesh files from clients → triangles: strict readers that follow no reference out of the file.

They are our own because clients are not trusted. trimesh 5.2 asks for 32 GiB for an OBJ of 155
bytes (an index of 2³² − 1), silently reads index 0 and negative indices as other vertices, and
fails with eight further kinds of exception; the readers here have one, which
`benchmarks/fuzz_meshes.py` checks.
"""
