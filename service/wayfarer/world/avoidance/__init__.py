"""Who gives way to whom: sampled reciprocal velocity obstacles. Pure numpy."""
