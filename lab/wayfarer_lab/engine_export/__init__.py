"""`wayfarer export --for engines`: the step as one file that game engines run. Needs no torch."""
