"""Finished clips and their files: GLB, BVH, npz."""
