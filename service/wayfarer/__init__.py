"""Wayfarer: a motion-generation service for digital humans (GAMMA, CVPR 2022)."""

import os
import sys

__version__ = "0.2.0"

# Two engines report their use to their makers as soon as they are imported, and keep an id of the
# user in the home folder: ONNX Runtime unless this variable is set (its API comes too late), and
# OpenVINO unless its reporting package is missing. A package is imported before its modules, so
# this comes before either engine in all our processes.
os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")
sys.modules.setdefault("openvino_telemetry", None)  # type: ignore[arg-type]  # cannot be imported
