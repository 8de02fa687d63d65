"""Sessions, agents, goals and paths over slots, and how an agent is steered."""
