"""The service's errors, which the modules of this folder raise."""

from wayfarer.errors import InvalidArgument

__all__ = ["InvalidArgument"]
