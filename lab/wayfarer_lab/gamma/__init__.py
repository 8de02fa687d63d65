"""Checkpoints of GAMMA-release, the paper's own code, as models of ours."""
