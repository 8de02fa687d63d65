"""Worlds as the service makes them, of the fake engine or of the shipped one."""

from functools import cache
from pathlib import Path

from tests.world.fakes import BODIES, FakeEngine, start_poses
from wayfarer.engines.models import LoadedModels
from wayfarer.models.bundle import DEFAULT_MODEL, START_POSES, open_bundle
from wayfarer.runtime.persistence.journal import Journal
from wayfarer.runtime.persistence.snapshot import BodyStamp
from wayfarer.runtime.world_factory import WorldFactory
from wayfarer.spec import GENDERS
from wayfarer.world.agents.spawn import load_start_poses
from wayfarer.world.stepping.budget import BudgetRules
from wayfarer.world.stepping.settings import WorldSettings

STICK = BodyStamp("stick", dict.fromkeys(GENDERS, "0" * 64))


def fake_worlds(journal=None, engine=None, **settings) -> WorldFactory:
    return WorldFactory(
        LoadedModels(engine or FakeEngine()),
        STICK,
        BODIES,
        start_poses(),
        WorldSettings(**settings),
        journal,
    )


@cache
def shipped_bundle():
    return open_bundle(DEFAULT_MODEL, threads=1)


def shipped_worlds(**settings) -> WorldFactory:
    bundle = shipped_bundle()
    body = BodyStamp("anny52", dict.fromkeys(GENDERS, "0" * 64))
    return WorldFactory(
        LoadedModels(bundle.engine),
        body,
        bundle.bodies,
        load_start_poses(START_POSES),
        WorldSettings(**{"budget": BudgetRules(), **settings}),
    )


def open_journal(folder: Path, body=STICK) -> Journal:
    return Journal(folder, body)


def assert_same_poses(found, expected):
    """Chunks equal in everything that a client gets, bit for bit."""
    for name in ("translation", "rotations", "contacts"):
        a, b = getattr(found, name), getattr(expected, name)
        assert a.dtype == b.dtype and a.tobytes() == b.tobytes(), (name, found.seq)
    for name in ("agent_id", "alias", "seq", "first_frame", "goal_revision", "state", "waypoint"):
        assert getattr(found, name) == getattr(expected, name), (name, found.seq)
