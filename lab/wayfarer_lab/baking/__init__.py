"""Parts of the bake (`body/bake.py`): build time only, none is imported by the service."""
