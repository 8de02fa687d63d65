"""A scene's geometry → walkable ground → paths and clearance. The door is `scene.py`."""
