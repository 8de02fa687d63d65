import pytest

from tests.transport.fakes import FakeService
from tests.transport.gateway.calls import session_of_two
from tests.transport.samples import NOW
from tests.world.fakes import ManualClock
from wayfarer.config.limits import Limits
from wayfarer.errors import AlreadyExists, FailedPrecondition, NotFound
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway


async def test_a_model_is_loaded_used_and_unloaded(api):
    await session_of_two(api)
    loaded = await api.admin.load_model(schema.NewModel(name="next"))
    assert (loaded.name, loaded.in_use) == ("next", False)
    with pytest.raises(FailedPrecondition):
        await api.admin.unload_model("fake")
    assert (await api.admin.use_model("next", schema.ModelUse())).moved == 0
    assert (await api.admin.use_model("next", schema.ModelUse(move_agents=True))).moved == 2
    await api.admin.unload_model("fake")
    assert [(m.name, m.in_use) for m in (await api.catalogue.models()).models] == [("next", True)]


async def test_what_cannot_be_loaded_says_why(api):
    for name, error in (
        ("none", NotFound),
        ("fake", AlreadyExists),
        ("broken", FailedPrecondition),
    ):
        with pytest.raises(error) as caught:
            await api.admin.load_model(schema.NewModel(name=name))
    assert "hash is wrong" in str(caught.value)


async def test_drain_stops_the_server():
    stops = []
    api = Gateway(
        FakeService(), BodyLibrary("anny52"), Limits(), ManualClock(NOW), lambda: stops.append(None)
    )
    await api.admin.drain()
    assert stops == [None]


async def test_catalogue(api):
    bodies = api.catalogue.bodies().bodies
    assert [b.gender for b in bodies] == ["female", "male"]
    assert all(b.glb_path == f"/v1/bodies/anny52-{b.gender}.glb" for b in bodies)
    assert (await api.catalogue.models()).models[0].name == "fake"
    info = api.catalogue.info()
    assert (info.fps, info.frames_per_chunk) == (40, 8)
    assert {b.basis for b in info.bases} == set(Basis)
    assert (await api.catalogue.stats()).agents == 1
