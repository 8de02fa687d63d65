"""Write the golden files."""

from tests.golden import messages, rules, vectors, words

for made in (vectors, messages, rules, words):
    for path, content in made.files().items():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
