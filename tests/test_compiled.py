"""Compiled rules: where their code is kept, and that another text of a rule is other code."""

import importlib.util
import sys
from pathlib import Path

import pytest

from wayfarer import compiled

TEXT = "from wayfarer.compiled import compiled\n@compiled\ndef rule(x):\n    return x + {}\n"


def loaded(file: Path, more: int):
    file.write_text(TEXT.format(more))
    spec = importlib.util.spec_from_file_location("kept_rule", file)
    module = importlib.util.module_from_spec(spec)
    sys.modules["kept_rule"] = module
    spec.loader.exec_module(module)
    return module.rule


def test_code_is_kept_where_the_environment_says_and_for_one_text(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kept"))
    assert loaded(tmp_path / "rule.py", 1)(1) == 2
    again = loaded(tmp_path / "rule.py", 1)
    assert again(1) == 2 and again.stats.cache_hits
    other = loaded(tmp_path / "rule.py", 2)
    assert other(1) == 3 and not other.stats.cache_hits
    assert len(list((tmp_path / "kept").glob("wayfarer-*"))) == 2


def test_where_nothing_can_be_written_it_is_compiled_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setattr(compiled, "_bases", lambda file: iter([tmp_path / "file"]))
    rule = loaded(tmp_path / "rule.py", 1)
    assert rule.stats.cache_path is None
    compiled.warm(rule, 1)
    assert rule(1) == 2


@pytest.fixture(autouse=True)
def _forget():
    yield
    sys.modules.pop("kept_rule", None)
