"""What is tried in the example scenes: each scenario makes a row or two."""
