"""The synchronous client offers what the asynchronous one does, with the same parameters."""

import inspect

import pytest

from wayfarer_client import Client, Scene, Session, SyncClient, SyncScene, SyncScenes, SyncSession
from wayfarer_client.scenes import Scenes

ASYNC_ONLY = {"control", "connect"}


@pytest.mark.parametrize(
    ("kind", "sync"),
    [(Client, SyncClient), (Session, SyncSession), (Scenes, SyncScenes), (Scene, SyncScene)],
)
def test_every_method_is_there(kind: type, sync: type):
    for name, method in inspect.getmembers(kind, inspect.isfunction):
        if not name.startswith("_") and name not in ASYNC_ONLY:
            assert inspect.signature(method).parameters.keys() == (
                inspect.signature(getattr(sync, name)).parameters.keys()
            ), name
