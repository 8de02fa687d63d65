import io
import tarfile

import pytest

from wayfarer.errors import DataError
from wayfarer_lab.training.mocap.sources import list_entries, unpack


def archive(path, members: dict[str, bytes]) -> None:
    with tarfile.open(path, "w:xz") as tar:
        for name, data in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))


def test_without_an_index_files_are_found_and_subjects_guessed(tmp_path) -> None:
    (tmp_path / "deep").mkdir()
    for name in ("deep/07_01.bvh", "deep/jump.BVH", "notes.txt"):
        (tmp_path / name).write_text("x")
    entries = list_entries(tmp_path, tmp_path / "cache")
    assert [(e.name, e.subject, e.split) for e in entries] == [
        ("07_01", "07", "train"),
        ("jump", "deep", "train"),
    ]


def test_an_index_tells_what_files_do_not(tmp_path) -> None:
    (tmp_path / "train").mkdir()
    archive(tmp_path / "train" / "a.tar.xz", {"b/1.bvh": b"one", "b/readme": b"no"})
    (tmp_path / "2.bvh").write_text("two")
    (tmp_path / "index.csv").write_text(
        "clip,path,archive,member,subject,split,locomotion,fps,glitch_at\n"
        "one,,a.tar.xz,b/1.bvh,s1,train,0,60,3 9\n"
        "two,2.bvh,,,s2,heldout,,,\n"
        "gone,3.bvh,,,s2,heldout,,,\n"
    )
    told: list[str] = []
    one, two = list_entries(tmp_path, tmp_path / "cache", skip=told.append)
    assert (one.subject, one.locomotion, one.fps, one.glitch_at) == ("s1", False, 60, (3, 9))
    assert one.path.read_bytes() == b"one"
    assert (two.split, two.locomotion, two.fps) == ("heldout", None, None)
    assert len(told) == 1
    assert "3.bvh" in told[0]


def test_several_tables_list_what_is_in_one_folder(tmp_path) -> None:
    for name in ("one", "two"):
        (tmp_path / f"{name}.bvh").write_text(name)
        (tmp_path / f"{name}.csv").write_text(f"clip,path\n{name},{name}.bvh\n")
    tables = [tmp_path / "two.csv", tmp_path / "one.csv"]
    assert [e.name for e in list_entries(tmp_path, tmp_path / "cache", tables)] == ["two", "one"]


def test_a_malformed_index_is_named_with_its_line(tmp_path) -> None:
    (tmp_path / "2.bvh").write_text("two")
    index = tmp_path / "index.csv"
    index.write_text("clip,path,split\ntwo,2.bvh,train\ntwo,2.bvh,testing\n")
    with pytest.raises(DataError, match="testing") as caught:
        list_entries(tmp_path, tmp_path / "cache")
    assert caught.value.line == 3
    index.write_text("clip,path,fps\ntwo,2.bvh,fast\n")
    with pytest.raises(DataError, match="fast") as caught:
        list_entries(tmp_path, tmp_path / "cache")
    assert caught.value.line == 2


@pytest.mark.parametrize("name", ["../escaped.bvh", "/tmp/escaped.bvh"])
def test_archives_cannot_write_elsewhere(tmp_path, name) -> None:
    archive(tmp_path / "evil.tar.xz", {name: b"x"})
    if name.startswith("/"):  # the leading slash is dropped: it lands inside
        assert (unpack(tmp_path / "evil.tar.xz", tmp_path / "c") / "tmp/escaped.bvh").exists()
    else:
        with pytest.raises(DataError, match=r"evil\.tar\.xz"):
            unpack(tmp_path / "evil.tar.xz", tmp_path / "c")
    assert not (tmp_path / "escaped.bvh").exists()


def test_damaged_archives_and_empty_folders_are_named(tmp_path) -> None:
    (tmp_path / "bad.tar.xz").write_bytes(b"no archive")
    with pytest.raises(DataError, match=r"bad\.tar\.xz"):
        unpack(tmp_path / "bad.tar.xz", tmp_path / "c")
    with pytest.raises(DataError, match="no motion file"):
        list_entries(tmp_path, tmp_path / "c")
    with pytest.raises(DataError, match="no such folder"):
        list_entries(tmp_path / "nowhere", tmp_path / "c")
