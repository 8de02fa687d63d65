import tomllib
from hashlib import sha256

import pytest
from typer.testing import CliRunner

from wayfarer.errors import InvalidArgument
from wayfarer.transport.auth.commands import app
from wayfarer.transport.auth.keys import KeyFile


def test_a_new_key_works_once_its_entry_is_in_the_file(tmp_path):
    done = CliRunner().invoke(app, ["new", "ada@studio.example", "--scopes", "read,admin"])
    assert done.exit_code == 0
    key = done.stderr.split()[-1]
    entry = tomllib.loads(done.stdout)["keys"]["ada@studio.example"]
    assert entry == {"sha256": sha256(key.encode()).hexdigest(), "scopes": ["read", "admin"]}
    assert key not in done.stdout
    path = tmp_path / "keys.toml"
    path.write_text(done.stdout)
    assert KeyFile(path).caller(key).name == "key:ada@studio.example"


@pytest.mark.parametrize(
    ("arguments", "what"),
    [
        (["a b"], "letters"),
        (["a", "--scopes", "write"], "read, control, admin"),
        (["a", "--scopes", ""], "one scope at least"),
    ],
)
def test_mistakes_are_explained(arguments, what):
    done = CliRunner().invoke(app, ["new", *arguments])
    assert isinstance(done.exception, InvalidArgument)
    assert what in str(done.exception)
