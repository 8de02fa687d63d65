"""What runs the step graph: onnxruntime, OpenVINO, or torch; and models by name."""
