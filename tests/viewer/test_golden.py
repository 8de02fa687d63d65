"""The decoder's examples are what the contract encodes today."""

from tests.viewer import golden


def test_golden_file_is_up_to_date():
    assert golden.FILE.read_text() == golden.text(), "run: python -m tests.viewer.golden"
