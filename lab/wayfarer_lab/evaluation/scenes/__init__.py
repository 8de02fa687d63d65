"""How well agents walk in scenes and among each other: measures, scenarios, pictures."""
