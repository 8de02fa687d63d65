"""Pictures and films to files, which appear whole or not at all."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from wayfarer.errors import InvalidArgument
from wayfarer.spec import FPS
from wayfarer_lab.evaluation.pictures.film import Film
from wayfarer_lab.training.mocap.store import atomically

STILLS: Final = ("strip", "sheet", "top")
FILMS: Final = ("film", "crowd")
KINDS_OF: Final = {".png": STILLS, ".gif": FILMS, ".mp4": FILMS}
"""Suffix of a file → what can be in it."""

GIF_FPS: Final = 20.0
"""Every second frame: GIF counts in 1/100 s, so that it has no 40 fps, and 25 would limp."""

COLOURS: Final = 200
"""Colours of a GIF, unless fewer are asked for: a third of them makes it a third smaller."""

SAMPLES: Final = 6  # pictures of a film from which its colours are chosen
WEIGHED: Final = 40_000  # pixels that choose them
SIX_BITS: Final = np.array([4096, 64, 1])
QUALITY: Final = 6  # of 10: H.264 at a constant rate factor of 20


def choose_kind(target: Path, kind: str | None, clips: int) -> str:
    """What to draw, from the file's name and the number of clips where it is not said.

    Raises InvalidArgument when the name, the kind and the number do not go together, or the
    file's folder does not exist.
    """
    suffix = target.suffix.lower()
    if suffix not in KINDS_OF:
        allowed = "; ".join(f"{name} for {' or '.join(kinds)}" for name, kinds in KINDS_OF.items())
        raise InvalidArgument(f"{target.name}: the name must end in {allowed}", "out")
    if not target.parent.is_dir():
        raise InvalidArgument(f"{target}: there is no folder {target.parent}", "out")
    if clips == 0:
        raise InvalidArgument("nothing to draw: name a clip, or ask for --goals N", "sources")
    kinds = KINDS_OF[suffix]
    if kind is None:
        kind = "sheet" if kinds is STILLS and clips > 1 else kinds[0]
    if kind not in (*STILLS, *FILMS):
        raise InvalidArgument(f"kind is {kind!r}; allowed: {', '.join((*STILLS, *FILMS))}", "kind")
    if kind not in kinds:
        fitting = [name for name, held in KINDS_OF.items() if kind in held]
        raise InvalidArgument(
            f"a {kind} does not fit into {suffix}; name the file {' or '.join(fitting)}", "kind"
        )
    if kind == "strip" and clips > 1:
        raise InvalidArgument(f"a strip shows one clip, not {clips}; try --kind sheet", "kind")
    return kind


def film_rate(target: Path, fps: float | None) -> float:
    """Pictures per second of a film. Raises InvalidArgument when a GIF cannot have that rate."""
    if target.suffix.lower() != ".gif":
        return FPS if fps is None else fps
    if fps is not None and (100 / fps) % 1:
        raise InvalidArgument(f"a GIF has no {fps:g} pictures per second: 10, 20, 25 or 50", "fps")
    return GIF_FPS if fps is None else fps


def write_still(path: Path, picture: Image.Image) -> None:
    """Writes a PNG."""
    atomically(path, lambda unfinished: picture.save(unfinished, format="PNG", optimize=True))


def write_film(
    path: Path, film: Film, watch: Callable[[int, int], None], colours: int = COLOURS
) -> None:
    """Writes a GIF of some colours, or an MP4 (H.264), by the name. Raises ModuleNotFoundError
    without ffmpeg.
    """
    is_gif = path.suffix.lower() == ".gif"
    write = partial(_write_gif, colours) if is_gif else _write_mp4

    def pictures() -> Iterator[Image.Image]:
        for number in range(film.pictures):
            yield film.draw(number)
            watch(number + 1, film.pictures)

    atomically(path, lambda unfinished: write(unfinished, film, pictures()))


def _write_gif(colours: int, path: Path, film: Film, pictures: Iterator[Image.Image]) -> None:
    palette = _palette(film, colours)
    # without dithering, the still parts of two pictures are equal and cost nothing
    frames = (p.quantize(palette=palette, dither=Image.Dither.NONE) for p in pictures)
    next(frames).save(
        path,
        format="GIF",
        save_all=True,
        append_images=frames,
        duration=round(1000 / film.fps),
        loop=0,
        optimize=False,
    )


def _palette(film: Film, count: int) -> Image.Image:
    """Colours that serve the whole film, as a picture in them."""
    numbers = np.unique(np.linspace(0, film.pictures - 1, SAMPLES).astype(int)).tolist()
    pixels = np.concatenate([np.asarray(film.draw(number)).reshape(-1, 3) for number in numbers])
    # half of the choice is the pixels', the other half is the colours': each of these weighs the
    # same, or the floor, which is most of a picture, would leave too few to the people
    codes = np.unique((pixels >> 2) @ SIX_BITS)
    distinct = (codes[:, None] // SIX_BITS % 64 * 4).astype(np.uint8)
    chosen = [
        colours[np.linspace(0, len(colours) - 1, WEIGHED).astype(int)]
        for colours in (pixels, distinct)
    ]
    weighed = np.concatenate(chosen).reshape(-1, 200, 3)
    return Image.fromarray(weighed).quantize(count, Image.Quantize.MEDIANCUT)


def _write_mp4(path: Path, film: Film, pictures: Iterator[Image.Image]) -> None:
    # H.264 comes with GPL code; as a separate program, it stays apart from this package
    from imageio_ffmpeg import write_frames

    even = (film.size[0] // 2 * 2, film.size[1] // 2 * 2)  # as H.264 wants it
    encoder = write_frames(
        path,
        even,
        fps=film.fps,
        quality=QUALITY,
        codec="libx264",
        macro_block_size=2,
        ffmpeg_log_level="error",
        output_params=["-movflags", "+faststart", "-preset", "slow"],
    )
    encoder.send(None)
    try:
        for picture in pictures:
            encoder.send(picture.crop((0, 0, *even)).tobytes())
    finally:
        encoder.close()
