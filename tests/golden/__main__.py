"""Write the golden files."""

from tests.golden import messages, vectors

for path, content in {**vectors.files(), **messages.files()}.items():
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content)
