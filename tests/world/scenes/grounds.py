"""Small scenes, and worlds of the fake engine in them."""

from functools import cache

from tests.world.fakes import BODIES, FakeEngine, start_poses
from wayfarer.navigation.examples import rectangle, two_storeys
from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.scene_spec import Box, Floor, SceneSpec
from wayfarer.world.agents.agent import AgentInfo, AgentSpec, SessionSpec
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.stepping.settings import WorldSettings
from wayfarer.world.world import World

FIELD = Floor(rectangle(0.0, 0.0, 12.0, 12.0))
BOX = Box((6.0, 6.0), (4.0, 1.0), 2.0)
"""A box in the middle of the field, across the way from south to north."""

WALL = Box((6.0, 6.0), (12.2, 0.4), 2.0)
"""Divides the field."""

DOOR = (Box((2.7, 6.0), (5.4, 0.2), 3.0), Box((9.3, 6.0), (5.4, 0.2), 3.0))
"""A wall with a door of 1.2 m, which divides the field."""

ISLANDS = (FIELD, Floor(rectangle(20.0, 0.0, 32.0, 12.0)))


@cache
def field(*solids: Box) -> Scene:
    """The field, with solids on it."""
    return bake(SceneSpec((FIELD,), solids))


@cache
def storeys() -> Scene:
    """The example with two storeys."""
    return bake(two_storeys())


@cache
def islands() -> Scene:
    """Two fields with no way between them."""
    return bake(SceneSpec(ISLANDS))


def world_in(
    scene: Scene, avoid: bool = True, registry: SceneRegistry | None = None, **settings: object
) -> tuple[World, SceneRegistry, str]:
    """A world of the fake engine, whose session "s" is in the scene; and the scene's id."""
    registry = registry or SceneRegistry()
    scene_id = registry.create(SceneSource(scene.spec), baked=scene).scene_id
    settings = {"steering": Steering(reactions=1)} | settings  # nobody hesitates
    world = World(FakeEngine(), BODIES, start_poses(), WorldSettings(**settings), scenes=registry)
    world.create_session(SessionSpec("s", scene=scene_id, avoid=avoid), 0.0)
    return world, registry, scene_id


def enter(world: World, *places: tuple[float, float], **values: object) -> list[AgentInfo]:
    """Agents at places."""
    specs = [
        AgentSpec(position=place, noise_seed=number, **values)
        for number, place in enumerate(places)
    ]
    return world.create_agents("s", specs, 0.0)
