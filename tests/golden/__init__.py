"""Golden vectors: what the server sends, byte by byte, for every client to test against.

vectors.json    one motion in the core basis and in each of the others, and the list of files
poses/*.bin     MotionChunk.poses of that motion: every encoding × profile × basis, and frame rates
messages.json   StreamMotionResponse messages as the protobuf library encodes them, hexadecimal

`PYTHONPATH=service python -m tests.golden` writes them; test_golden.py fails when they are not what
the code gives, and README.md says what a client has to reproduce.
"""
