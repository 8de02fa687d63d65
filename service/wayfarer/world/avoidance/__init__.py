"""Collision avoidance: sampled reciprocal velocity obstacles. Pure numpy."""
