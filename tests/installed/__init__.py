"""The installed product, started and streamed from like a user does. See matrix.py, image.py."""
