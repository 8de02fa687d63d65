"""Compiled networks in a folder are found unchanged, or not at all."""

import os
import tempfile

import pytest

from wayfarer.engines import compiled_networks
from wayfarer.engines.compiled_networks import CompiledNetworks

BODY = bytes(range(256)) * 4


def found(folder, *about) -> bytes | None:
    kept = CompiledNetworks(folder).find(*about)
    return None if kept is None else kept.body.tobytes()


def test_what_is_kept_is_found_under_its_description_alone(tmp_path):
    folder = tmp_path / "made" / "with the first"
    CompiledNetworks(folder).keep(BODY, "a", 1, {"threads": 2})
    assert found(folder, "a", 1, {"threads": 2}) == BODY
    for other in (("a", 1, {"threads": 3}), ("a", 2, {"threads": 2}), ("b", 1, {"threads": 2})):
        assert found(folder, *other) is None
    assert folder.stat().st_mode & 0o077 == 0
    assert len(list(folder.iterdir())) == 1  # nothing unfinished


@pytest.mark.parametrize("damage", ["flipped", "cut", "empty", "folder"])
def test_what_is_damaged_is_not_found_and_can_be_kept_again(tmp_path, damage):
    networks = CompiledNetworks(tmp_path)
    networks.keep(BODY, "a")
    (file,) = tmp_path.iterdir()
    content = bytearray(file.read_bytes())
    if damage == "flipped":
        content[100] ^= 1
        file.write_bytes(content)
    elif damage == "folder":
        file.unlink()
        file.mkdir()
    else:
        file.write_bytes(content[:50] if damage == "cut" else b"")
    assert networks.find("a") is None
    networks.keep(BODY, "a")
    assert found(tmp_path, "a") == (None if damage == "folder" else BODY)


def test_what_was_released_can_be_read_again_though_the_file_is_gone(tmp_path):
    networks = CompiledNetworks(tmp_path)
    kept = networks.keep(BODY, "a")
    assert kept is not None
    for file in tmp_path.iterdir():
        file.unlink()
    kept.release()
    assert kept.body.tobytes() == BODY


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path):
    (tmp_path / "file").touch()
    networks = CompiledNetworks(tmp_path / "file" / "below")
    assert networks.keep(BODY, "a") is None
    assert networks.find("a") is None


def test_without_a_folder_nothing_is_found_again(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    networks = CompiledNetworks(None)
    kept = networks.keep(BODY, "a")
    assert kept is not None and kept.body.tobytes() == BODY
    assert networks.find("a") is None
    assert not list(tmp_path.iterdir())
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "nowhere"))
    assert networks.keep(BODY, "a") is None


def test_what_was_used_longest_ago_goes(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_networks, "MOST", 2)
    networks = CompiledNetworks(tmp_path)
    for number, name in enumerate("ab"):
        networks.keep(BODY, name)
        for file in tmp_path.iterdir():
            os.utime(file, (number, number))
    networks.find("a")
    networks.keep(BODY, "c")
    assert [found(tmp_path, name) is not None for name in "abc"] == [True, False, True]
