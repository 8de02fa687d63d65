"""`wayfarer data prepare`: a folder of motion files → one prepared data set."""

import zlib
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from wayfarer.body.model import BodyModel
from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.fit import FitOptions, FittedClip
from wayfarer_lab.training.mocap.fitting import Fits, fit_all
from wayfarer_lab.training.mocap.level import level_subject
from wayfarer_lab.training.mocap.load import (
    MIN_FRAMES,
    Piece,
    ReadOptions,
    Recording,
    load_pieces,
    read_recordings,
)
from wayfarer_lab.training.mocap.pace import odd_pace
from wayfarer_lab.training.mocap.references import References
from wayfarer_lab.training.mocap.retarget import FitProblem, Subject, make_problem
from wayfarer_lab.training.mocap.rig import SourceClip
from wayfarer_lab.training.mocap.selection import classify, useful_stretches
from wayfarer_lab.training.mocap.shape import own_shape, random_shape
from wayfarer_lab.training.mocap.sources import SourceFile, find_asf, list_entries
from wayfarer_lab.training.mocap.standing import save_start_poses, standing_poses
from wayfarer_lab.training.mocap.store import ClipRange, Dataset
from wayfarer_lab.training.mocap.upper import plain_uppers


@dataclass(frozen=True)
class PrepareOptions:
    """Everything that decides what is prepared, apart from SRC."""

    index: tuple[Path, ...] = ()  # empty: SRC/index.csv, or every file of SRC
    read: ReadOptions = field(default_factory=ReadOptions)
    fit: FitOptions = field(default_factory=FitOptions)
    validation: tuple[str, ...] = ()  # subjects and clips carved out of train
    shapes: int = 2  # per gender and locomotion clip: own proportions first, then random adults
    other_shapes: int = 1  # per clip of any other kind; genders take turns
    acted: tuple[str, ...] = ()  # patterns of clips that get a plain upper body, see `upper.py`
    clips: tuple[str, ...] = ()  # only these, by name; empty: all
    seed: int = 0
    workers: int = 1


@dataclass(frozen=True)
class Prepared:
    """Results of a run, for the report."""

    dataset: Dataset
    fits: list[Fits]
    skipped: list[str]
    notes: list[str]


@dataclass
class Messages:
    """A run's messages about its files: skipped files, and other notes for the user."""

    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def skip(self, line: str) -> None:
        """Names a file that is left out."""
        self.skipped.append(line)

    def note(self, line: str) -> None:
        """Names what is odd about a file that is read."""
        self.notes.append(line)

    @contextmanager
    def skipping(self, path: Path) -> Iterator[None]:
        """Skips a file that cannot be read, with its path in the reason."""
        try:
            yield
        except (DataError, OSError) as error:
            line = str(error)
            self.skip(line if str(path) in line else f"{path}: {line}")


def prepare(
    src: Path,
    dst: Path,
    bodies: dict[str, BodyModel],
    options: PrepareOptions,
    console: Console | None = None,
) -> Prepared:
    """Reads, fits and writes everything. Malformed files are named, skipped, and listed at the end.

    Raises DataError when nothing usable is left.
    """
    console = console or Console(stderr=True)
    cache = dst / "cache"
    told = Messages()
    with Progress(console=console) as progress:

        def fit(problems: list[FitProblem], what: str) -> list[Fits]:
            task = progress.add_task(f"{what} (frames)", total=sum(map(len, problems)))
            return fit_all(
                problems,
                bodies,
                options.fit,
                cache / "fits",
                options.workers,
                lambda frames: progress.advance(task, frames),
            )

        pieces = _read_all(src, cache, options, told, progress)
        recorded = fit(plan(_level_all(pieces, options, told), bodies, options), "fitting")
        uppers = plain_uppers([r.fitted for r in recorded], options.acted)
        recorded = [replace(r, fitted=f) for r, f in zip(recorded, uppers, strict=True)]
    dataset = assemble([f.fitted for f in recorded])
    dataset.save(dst)
    save_start_poses(dst, standing_poses(dataset))
    for what, lines in (("skipped", told.skipped), ("note", told.notes)):
        for line in lines:
            console.print(f"[yellow]{what}[/] {escape(line)}", highlight=False)
    return Prepared(dataset, recorded, told.skipped, told.notes)


def _read_all(
    src: Path, cache: Path, options: PrepareOptions, told: Messages, progress: Progress
) -> list[Piece]:
    entries = list_entries(src, cache / "unpacked", options.index, told.skip)
    if options.clips:
        entries = [e for e in entries if e.name in options.clips]
    folders = {src, cache / "unpacked"}
    skeletons = {p.stem: p for f in folders if f.is_dir() for p in sorted(f.rglob("*.asf"))}
    references = References(options.read.reference, options.read.up)
    pieces: list[Piece] = []
    waiting: list[SourceFile] = []  # files whose zero pose does not stand

    def recordings(entry: SourceFile) -> list[Recording]:
        return read_recordings(entry, find_asf(entry, skeletons), options.read)

    for entry in progress.track(entries, description="reading (files)"):
        with told.skipping(entry.path):
            for recording in recordings(entry):
                if recording.stands:
                    pieces += load_pieces(recording, options.read, tell=told.note)
                else:
                    references.add(recording.name, recording.motion)
                    if entry not in waiting:
                        waiting.append(entry)
    again = progress.track(waiting, description="reading again (files)") if waiting else ()
    for entry in again:
        with told.skipping(entry.path):
            for recording in recordings(entry):
                if not recording.stands:
                    rest, up = references.find(recording.name, recording.motion)
                    pieces += load_pieces(recording, options.read, rest, up, told.note)
    told.notes += references.notes()
    if not pieces:
        raise DataError("no usable motion; " + "; ".join(told.skipped[:5]), str(src))
    return pieces


def _level_all(
    pieces: list[Piece], options: PrepareOptions, told: Messages
) -> list[tuple[SourceClip, Subject]]:
    """All clips on the floor, cut to the frames that are of use, with their split settled."""
    by_subject: dict[str, list[Piece]] = defaultdict(list)
    for piece in pieces:
        by_subject[piece.info.subject].append(piece)
    unknown = set(options.validation) - set(by_subject) - {p.info.source for p in pieces}
    if unknown:
        raise DataError(f"no such validation subject or clip: {', '.join(sorted(unknown))}")
    ready = []
    for own in by_subject.values():
        clips, subject = level_subject(own)
        told.notes += [note for clip in clips if (note := odd_pace(clip))]
        for leveled in clips:
            clip = leveled
            held = {clip.info.subject, clip.info.source} & set(options.validation)
            if clip.info.split == "train" and held:
                clip = replace(clip, info=replace(clip.info, split="validation"))
            stretches = useful_stretches(classify(clip), MIN_FRAMES)
            for number, (first, last) in enumerate(stretches):
                name = f"{clip.info.name}-{number}" if number else clip.info.name
                ready.append((clip.cut(first, last, name=name), subject))
    return ready


def plan(
    clips: list[tuple[SourceClip, Subject]], bodies: dict[str, BodyModel], options: PrepareOptions
) -> list[FitProblem]:
    """Each clip for its shapes: its subject's own per gender, then random adults."""
    own = {
        (clip.info.subject, gender): own_shape(body, clip.rest)
        for clip in {c.info.subject: c for c, _ in clips}.values()
        for gender, body in bodies.items()
    }
    problems = []
    for number, (clip, subject) in enumerate(clips):
        generator = np.random.default_rng([options.seed, zlib.crc32(clip.info.name.encode())])
        count, genders = options.shapes, list(bodies)
        if not clip.info.locomotion:  # genders take turns
            count, genders = options.other_shapes, [genders[number % len(genders)]]
        for gender in genders:
            body = bodies[gender]
            shapes = [own[clip.info.subject, gender]]
            shapes += [random_shape(body, generator) for _ in range(count - 1)]
            problems += [make_problem(clip, subject, body, s) for s in shapes[:count]]
    return problems


def assemble(fits: list[FittedClip]) -> Dataset:
    """Lay fitted clips one after the other."""
    edges = np.cumsum([0, *(len(f) for f in fits)])
    ranges = tuple(
        ClipRange(
            start=int(a),
            stop=int(b),
            name=f.info.name,
            source=f.info.source,
            subject=f.info.subject,
            split=f.info.split,
            category=f.info.category,
            locomotion=f.info.locomotion,
            gender=f.shape.gender,
            betas=tuple(float(x) for x in f.shape.betas),
            shape=f.shape.kind,
            augmentation=f.info.augmentation,
        )
        for f, a, b in zip(fits, edges, edges[1:], strict=False)
    )
    return Dataset(
        translation=np.concatenate([f.translation for f in fits]).astype(np.float32),
        rotations=np.concatenate([f.rotations for f in fits]).astype(np.float32),
        contacts=np.concatenate([f.touch.any(-1) for f in fits]),
        use=np.concatenate([f.use for f in fits]),
        clips=ranges,
    )
