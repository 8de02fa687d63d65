"""Golden vectors: the server's messages, byte by byte, for tests of every client.

vectors.json    one motion in the core basis and in each of the others, and the list of files
poses/*.bin     MotionChunk.poses of that motion: every encoding × profile × basis, and frame rates
messages.json   StreamMotionResponse messages as the protobuf library encodes them, hexadecimal

`PYTHONPATH=service python -m tests.golden` writes them; test_golden.py fails if they differ
from the code's results, and README.md explains what a client must reproduce.
"""
