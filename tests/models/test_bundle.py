"""The model's manifest names the body, and every later model must be for that body."""

import json

import pytest

from wayfarer.body.library import SHIPPED
from wayfarer.errors import ArtifactError
from wayfarer.models.artifacts import MANIFEST, SCHEMA
from wayfarer.models.bundle import DEFAULT_MODEL, load_models


def test_the_manifest_names_the_body():
    assert load_models(DEFAULT_MODEL).body == SHIPPED


def test_a_model_of_an_unknown_body_is_refused_with_those_there_are(tmp_path):
    manifest = {"schema": SCHEMA, "name": "m", "files": {}, "body": "robot", "card": "CARD.md"}
    (tmp_path / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(ArtifactError, match=r"no body 'robot'; allowed: anny52, smplx"):
        load_models(tmp_path)


def test_a_model_of_another_body_than_the_servers_is_refused(tmp_path):
    manifest = {"schema": SCHEMA, "name": "m", "files": {}, "body": "smplx", "card": "CARD.md"}
    (tmp_path / MANIFEST).write_text(json.dumps(manifest))
    with pytest.raises(ArtifactError, match=r"body.*smplx"):
        load_models(tmp_path, SHIPPED)
