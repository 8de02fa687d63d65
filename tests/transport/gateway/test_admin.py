import pytest

from wayfarer.errors import AlreadyExists, FailedPrecondition, NotFound
from wayfarer.transport import schema
from wayfarer.transport.conversion.basis import Basis


async def test_what_cannot_be_loaded_says_why(api):
    for name, error in (
        ("none", NotFound),
        ("fake", AlreadyExists),
        ("broken", FailedPrecondition),
    ):
        with pytest.raises(error) as caught:
            await api.admin.load_model(schema.NewModel(name=name))
    assert "hash is wrong" in str(caught.value)


async def test_catalogue(api):
    bodies = api.catalogue.bodies().bodies
    assert [b.gender for b in bodies] == ["female", "male"]
    assert all(b.glb_path == f"/v1/bodies/anny52-{b.gender}.glb" for b in bodies)
    assert (await api.catalogue.models()).models[0].name == "fake"
    info = api.catalogue.info()
    assert (info.fps, info.frames_per_chunk) == (40, 8)
    assert {b.basis for b in info.bases} == set(Basis)
    assert (await api.catalogue.stats()).agents == 1
