"""What runs the step graph, and which models are loaded."""
