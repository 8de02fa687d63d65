"""Every definition of a figure, as pure functions of arrays."""

from typing import Final

VERSION: Final = 3
"""Written into every report; tables of different versions must not be compared."""
