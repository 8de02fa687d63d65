"""Which clips there are: any folder of BVH, FBX, ASF/AMC or AMASS files, with an optional index.

`index.csv` columns used when present: `clip`, `path` (or `archive` + `member`), `subject`,
`split` (train, validation, heldout), `category`, `locomotion`, `scene_contact`, `fps`,
`glitch_at`. Archives (.tar, .tar.xz, ...) are unpacked once, motion files only, and a member
whose name leads outside the folder is refused.
"""

import csv
import io
import tarfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap import amass
from wayfarer_lab.training.mocap.text import read_text

SUFFIXES = (".bvh", ".amc", ".fbx", amass.SUFFIX)
SPLITS = ("train", "validation", "heldout")


@dataclass(frozen=True)
class SourceFile:
    """One motion file to read."""

    name: str
    path: Path
    subject: str
    split: str = "train"
    category: str = ""
    locomotion: bool | None = None  # None: the index does not say
    scene_contact: bool = False
    fps: float | None = None
    glitch_at: tuple[int, ...] = ()


def list_entries(
    src: Path, unpacked: Path, index: Sequence[Path] = (), skip: Callable[[str], None] = print
) -> list[SourceFile]:
    """All motion files of `src`, in a stable order. `skip` is called with rows of missing files.

    `index` names the tables that list them; without one, `src/index.csv` if it exists;
    otherwise every file counts.

    Raises DataError when there is nothing to read or the index is malformed.
    """
    if not src.is_dir():
        raise DataError("no such folder", str(src))
    if not index and (src / "index.csv").exists():
        index = [src / "index.csv"]
    if not index:
        files = sorted(p for p in src.rglob("*") if _is_motion(p))
        entries = [SourceFile(_name(p, src), p, _subject(p, src)) for p in files]
    else:
        entries = [e for table in index for e in _read_index(table, src, unpacked, skip)]
    if not entries:
        raise DataError(f"no motion file ({', '.join(SUFFIXES)}) found", str(src))
    return entries


def _is_motion(path: Path) -> bool:
    """By its name. AMASS has files of shapes beside the motions."""
    npz = path.suffix.lower() == amass.SUFFIX
    return path.suffix.lower() in SUFFIXES and not (npz and path.stem.endswith(amass.NO_MOTION))


def _name(path: Path, src: Path) -> str:
    """A file's name; in AMASS with its folders, since subsets use the same names."""
    if path.suffix.lower() != amass.SUFFIX or not path.is_relative_to(src):
        return path.stem
    name = path.relative_to(src).with_suffix("").as_posix()
    return next((name.removesuffix(e) for e in amass.ENDINGS if name.endswith(e)), name)


def _subject(path: Path, src: Path) -> str:
    """CMU names clips <subject>_<trial>; otherwise the folder names the subject.

    In AMASS that is subset and subject, as `KIT/3`.
    """
    if path.suffix.lower() == amass.SUFFIX and path.is_relative_to(src):
        return path.relative_to(src).parent.as_posix()
    head, _, tail = path.stem.partition("_")
    return head if tail.isdigit() else path.parent.name


def _read_index(
    index: Path, src: Path, unpacked: Path, skip: Callable[[str], None]
) -> list[SourceFile]:
    entries = []
    with io.StringIO(read_text(index), newline="") as file:
        for row in (reader := csv.DictReader(file)):
            line = reader.line_num
            split = row.get("split") or "train"
            if split not in SPLITS:
                message = f"split must be one of {', '.join(SPLITS)}, got '{split}'"
                raise DataError(message, str(index), line)
            try:
                path = _locate(row, src, unpacked, split)
                entries.append(
                    SourceFile(
                        name=row.get("clip") or _name(path, src),
                        path=path,
                        subject=row.get("subject") or _subject(path, src),
                        split=split,
                        category=row.get("category") or "",
                        locomotion=row["locomotion"] == "1" if row.get("locomotion") else None,
                        scene_contact=row.get("scene_contact") == "1",
                        fps=float(row["fps"]) if row.get("fps") else None,
                        glitch_at=tuple(int(f) for f in (row.get("glitch_at") or "").split()),
                    )
                )
            except DataError as error:
                skip(str(error))
            except ValueError as error:
                raise DataError(str(error), str(index), line) from None
    return entries


def _locate(row: dict[str, str], src: Path, unpacked: Path, split: str) -> Path:
    """The file of an index row: `path`, or `member` of `archive`, or a file named as the clip."""
    if row.get("archive") and row.get("member"):
        places = [src / split / row["archive"], src / row["archive"]]
        archive = next((p for p in places if p.is_file()), None)
        if archive is None:
            raise DataError(f"archive '{row['archive']}' not found in {src}")
        path = unpack(archive, unpacked) / row["member"]
    elif row.get("path"):
        path = src / row["path"]
    else:
        matches = [p for p in src.rglob(f"{row.get('clip')}.*") if p.suffix.lower() in SUFFIXES]
        if not matches:
            raise DataError(f"clip '{row.get('clip')}' not found in {src}")
        path = matches[0]
    if not path.is_file():
        raise DataError("listed in the index, but no such file", str(path))
    return path


def unpack(archive: Path, into: Path) -> Path:
    """Unpacks motion files of an archive once; returns its folder.

    Raises DataError on a damaged archive or a member that leads outside.
    """
    folder = into / f"{archive.parent.name}-{archive.name.split('.')[0]}"
    done = folder / ".complete"
    if done.exists():
        return folder
    wanted = (*SUFFIXES, ".asf")
    try:
        with tarfile.open(archive) as tar:
            for member in tar:  # Python 3.11.2 of Debian 12 has no `filter` of `extractall`
                if not (member.isfile() and member.name.lower().endswith(wanted)):
                    continue
                path = (folder / member.name.lstrip("/")).resolve()
                if not path.is_relative_to(folder.resolve()):
                    raise DataError(f"'{member.name}' leads outside the archive", str(archive))
                path.parent.mkdir(parents=True, exist_ok=True)
                if content := tar.extractfile(member):
                    path.write_bytes(content.read())
    except (tarfile.TarError, OSError, EOFError) as error:
        raise DataError(f"cannot unpack: {error}", str(archive)) from error
    done.touch()
    return folder


def find_asf(entry: SourceFile, skeletons: dict[str, Path]) -> Path | None:
    """The ASF of a clip's subject: beside the clip, or anywhere in the source under its name."""
    beside = entry.path.parent / f"{entry.subject}.asf"
    if beside.is_file():
        return beside
    alone = sorted(entry.path.parent.glob("*.asf"))
    return alone[0] if len(alone) == 1 else skeletons.get(entry.subject)
