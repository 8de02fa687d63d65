"""Scenes at run time: kept, baked and changed beside the agents who walk in them."""
