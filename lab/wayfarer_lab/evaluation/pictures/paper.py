"""What drawings share: paper, inks and letters."""

from typing import Final

from PIL import ImageFont

PAPER: Final = "#ffffff"
INK: Final = "#30343a"
FAINT: Final = "#c9ced6"
TRAIL: Final = "#5b6470"
GOAL: Final = "#2f9e44"
LEFT: Final = "#d1495b"
RIGHT: Final = "#2a6fb0"
FEET: Final = (LEFT, RIGHT)
"""Colours of the left and the right foot, in all pictures."""

FONT = ImageFont.load_default(12)
