"""Write the golden files."""

from tests.golden import messages, rules, vectors

for path, content in {**vectors.files(), **messages.files(), **rules.files()}.items():
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
