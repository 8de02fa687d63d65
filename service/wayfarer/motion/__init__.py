"""The method: pure torch, no input or output, no clock."""
