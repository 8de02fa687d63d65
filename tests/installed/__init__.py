"""What a user installs, started as a user starts it, and streamed from. See matrix.py, image.py."""
