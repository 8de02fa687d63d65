"""Mesh files from clients → triangles: strict readers that follow no reference out of the file.

They are ours because clients are not trusted. trimesh 5.2 asks for 32 GiB for an OBJ of 155 bytes
(an index of 2³² − 1), takes index 0 and indices that count back for other vertices without a word,
and fails in eight ways besides; `benchmarks/fuzz_meshes.py` holds the readers here to one.
"""
