"""One world: agents that walk as time passes. No threads, no clocks, no I/O."""
