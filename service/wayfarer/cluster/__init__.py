"""Many nodes that share sessions: who owns what, and how it moves. Ray only in `ray_*.py`."""
