"""Engines for the step graph (onnxruntime, OpenVINO, torch), and models by name."""
