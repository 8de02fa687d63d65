"""Marks of byte order, as editors leave them."""

import codecs

import numpy as np
import pytest

from tests.lab.training.mocap.synthetic import AMC, ASF, bvh_text, standing_rows
from wayfarer_lab.training.mocap.asf import load_asf
from wayfarer_lab.training.mocap.load import ReadOptions, read_recordings
from wayfarer_lab.training.mocap.sources import SourceFile, list_entries
from wayfarer_lab.training.mocap.text import read_text

MARKS = {
    "utf-8": codecs.BOM_UTF8,
    "utf-16-le": codecs.BOM_UTF16_LE,
    "utf-16-be": codecs.BOM_UTF16_BE,
    "utf-32-le": codecs.BOM_UTF32_LE,
}


@pytest.mark.parametrize("encoding", MARKS)
def test_every_kind_of_text_is_read_with_its_mark(encoding, tmp_path) -> None:
    def write(name: str, text: str):
        path = tmp_path / name
        path.write_bytes(MARKS[encoding] + text.encode(encoding))
        return path

    bvh = write("a.bvh", bvh_text(standing_rows(4), newline="\r\n"))
    (recording,) = read_recordings(SourceFile("a", bvh, "s"), None, ReadOptions())
    assert recording.motion.skeleton.names[0] == "Hips"
    asf = write("s.asf", ASF)
    assert load_asf(asf).skeleton.names[1] == "upper"
    amc = write("s_1.amc", AMC)
    (recording,) = read_recordings(SourceFile("s_1", amc, "s"), asf, ReadOptions())
    assert len(recording.motion) == 2
    write("index.csv", "clip,path,subject\nwalk,a.bvh,Zoë\n")
    (entry,) = list_entries(tmp_path, tmp_path / "cache")
    assert (entry.name, entry.subject) == ("walk", "Zoë")


def test_bytes_of_another_encoding_do_not_matter(tmp_path) -> None:
    path = tmp_path / "a.asf"
    path.write_bytes(b"# Gr\xf6\xdfe\n" + ASF.encode())
    assert read_text(path).startswith("# Gr")
    assert np.isfinite(load_asf(path).unit)
