"""Wayfarer: a motion-generation service for digital humans (GAMMA, CVPR 2022)."""

__version__ = "0.1.0"
