"""What the modules of this folder raise here: the service's own."""

from wayfarer.errors import InvalidArgument

__all__ = ["InvalidArgument"]
