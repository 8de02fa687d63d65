"""How well agents get about in scenes and among each other: measures, scenarios, pictures."""
