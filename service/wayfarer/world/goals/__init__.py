"""Goals and paths of agents: commands, checks, columns, steering."""
