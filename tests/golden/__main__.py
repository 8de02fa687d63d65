"""Write the golden files."""

from tests.golden import gait, homes, messages, rules, tiers, vectors, words

for made in (gait, homes, vectors, messages, rules, words, tiers):
    for path, content in made.files().items():
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(content)
