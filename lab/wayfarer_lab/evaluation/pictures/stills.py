"""Stills: strips of one body at intervals, and sheets with a row per clip."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from PIL import Image, ImageDraw

from wayfarer.errors import InvalidArgument
from wayfarer_lab.evaluation.pictures.camera import Size
from wayfarer_lab.evaluation.pictures.chart import contact_lane, foot_chart
from wayfarer_lab.evaluation.pictures.framing import check_view, close_up, marks
from wayfarer_lab.evaluation.pictures.paper import FEET, FONT, INK, PAPER, TRAIL
from wayfarer_lab.evaluation.pictures.scene import ClipActor, picture
from wayfarer_lab.evaluation.pictures.top import top_view

Watch = Callable[[int, int], None]
"""Called with the number of pictures drawn, and their total."""

NARROW: Final = 0.62  # width of a cell, in heights
BAR: Final = 5  # pixels of a contact bar
CAPTION: Final = 20  # pixels of a line of text over a row
GAP: Final = 12  # pixels between two rows
MIN_CHART_WIDTH: Final = 900  # pixels that the foot chart is wide at least


def strip(
    actor: ClipActor,
    every: int = 8,
    view: str = "quarter",
    columns: int = 10,
    height: int = 260,
    watch: Watch = lambda done, total: None,
) -> Image.Image:
    """One body each `every` frames, and below them the feet's height and speed over time.

    Floor lines are fixed in the world, 0.25 m apart; a red (left) or blue (right) bar is a
    contact flag; parts under the floor are red. `height` is that of a cell in pixels.
    """
    check_view(view)
    if every < 1 or columns < 1:
        raise InvalidArgument("every and columns must be 1 or more", "every")
    frames = list(range(0, actor.clip.frames, every))
    size = (round(NARROW * height), height)
    columns = min(columns, len(frames))
    rows = -(-len(frames) // columns)
    chart = foot_chart(actor, max(columns * size[0], MIN_CHART_WIDTH))
    sheet = Image.new("RGB", (chart.width, rows * height + chart.height), PAPER)
    for index, frame in enumerate(frames):
        cell = _cell(actor, frame, view, size)
        sheet.paste(cell, (index % columns * size[0], index // columns * height))
        watch(index + 1, len(frames))
    sheet.paste(chart, (0, rows * height))
    return sheet


def contact_sheet(
    actors: Sequence[ClipActor],
    captions: Sequence[str],
    columns: int = 10,
    view: str = "quarter",
    height: int = 180,
    watch: Watch = lambda done, total: None,
) -> Image.Image:
    """A row for each clip: `columns` moments from its first to its last frame, its contacts over
    that time (red left, blue right) and its way from above. `height` of a cell in pixels.
    """
    check_view(view)
    if columns < 2:
        raise InvalidArgument(f"columns is {columns}; a row needs 2 moments or more", "columns")
    size = (round(NARROW * height), height)
    lane = 2 * BAR + 6
    row_height = CAPTION + height + lane + GAP
    width = columns * size[0] + height + lane
    sheet = Image.new("RGB", (width, len(actors) * row_height), PAPER)
    draw = ImageDraw.Draw(sheet)
    total = len(actors) * columns
    for row, (actor, caption) in enumerate(zip(actors, captions, strict=True)):
        top = row * row_height
        draw.text((4, top + 3), caption, INK, FONT)
        moments = np.linspace(0, actor.clip.frames - 1, columns).round().astype(int)
        for column, frame in enumerate(moments.tolist()):
            cell = _cell(actor, frame, view, size, bars=False)
            sheet.paste(cell, (column * size[0], top + CAPTION))
            watch(row * columns + column + 1, total)
        # a moment is in the middle of its cell, so that time runs between the outer middles
        left, right = size[0] / 2, (columns - 0.5) * size[0]
        for foot, ink in enumerate(FEET):
            y = top + CAPTION + height + 3 + foot * (BAR + 1)
            contact_lane(draw, actor.clip.contacts[:, foot], left, right, y, ink, height=BAR - 1)
        plan = top_view([actor], (height + lane, height + lane))
        sheet.paste(plan, (columns * size[0], top + CAPTION))
    return sheet


def _cell(actor: ClipActor, frame: int, view: str, size: Size, bars: bool = True) -> Image.Image:
    cell = picture(close_up(actor, frame, view, size), [(actor, frame)], marks(actor, frame))
    draw = ImageDraw.Draw(cell)
    draw.text((5, 2), f"{frame / actor.clip.fps:.2f} s", TRAIL, FONT)
    if bars:
        for foot, ink in enumerate(FEET):
            if actor.clip.contacts[frame, foot]:
                x = size[0] / 2 + (8 if foot else -38)
                draw.rectangle([x, size[1] - 9, x + 30, size[1] - 5], fill=ink)
    draw.line([size[0] - 1, 0, size[0] - 1, size[1]], PAPER)
    return cell
