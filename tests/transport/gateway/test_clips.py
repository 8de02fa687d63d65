"""Clips and lock-step: motion at its caller's pace."""

import pytest

from tests.transport.fakes import FakeService, opened
from tests.transport.gateway.calls import TWO, session, session_of_two
from wayfarer.clips.files import FileFormat, FileOptions
from wayfarer.config.limits import Limits
from wayfarer.errors import FailedPrecondition, InvalidArgument
from wayfarer.transport import schema
from wayfarer.transport.conversion import motion_files


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({"seconds": 121}, "seconds"),
        ({"seconds": 1, "goals": [{"position": {"x": 0, "y": 0, "z": 0}}] * 257}, "goals"),
    ],
)
async def test_a_clip_that_cannot_be_made_names_the_field(body, field, api):
    with pytest.raises(InvalidArgument) as caught:
        await anext(api.motion.generate_clip(schema.ClipRequest.model_validate(body)))
    assert caught.value.field == field


async def test_time_passes_step_by_step():
    service = FakeService()
    api = await opened(service, Limits(steps_per_call=2))
    session_id, _ = await session_of_two(api, lock_step=True)
    reply = await api.motion.step(session_id, schema.StepRequest())
    assert len(reply.batches) == 1 and len(reply.batches[0].added) == 2
    reply = await api.motion.step(session_id, schema.StepRequest(steps=2))
    assert [seq for b in reply.batches for seq in b.chunks.seqs] == [1, 1, 2, 2]
    assert not any(b.added for b in reply.batches)
    with pytest.raises(InvalidArgument, match="1 to 2 primitives per call, not 3"):
        await api.motion.step(session_id, schema.StepRequest(steps=3))
    with pytest.raises(FailedPrecondition, match="lock-step"):
        await api.motion.step(await session(api), schema.StepRequest())
    await api.agents.create(session_id, TWO)
    assert len((await api.motion.step(session_id, schema.StepRequest())).batches[0].added) == 2


async def test_a_clip_as_a_file(service, api):
    request = schema.ClipRequest(
        agent=schema.AgentSpec(seed=3, name="Ada"),
        seconds=1.0,
        file=schema.MotionFile(format="bvh", names="unity", fps=20),
    )
    text = b"".join([m.file_part async for m in api.motion.generate_clip(request)]).decode()
    assert "JOINT LeftUpperLeg" in text and "Frame Time: 0.05" in text and "Frames: 20" in text


@pytest.mark.parametrize(
    ("file", "field"),
    [
        ({"format": "vrma", "root": "bone"}, "file.root"),
        ({"format": "glb", "unit": "cm"}, "file.unit"),
    ],
)
async def test_a_file_that_cannot_be_made_names_the_field(file, field, api):
    request = schema.ClipRequest.model_validate({"seconds": 1.0, "file": file})
    with pytest.raises(InvalidArgument) as caught:
        await anext(api.motion.generate_clip(request))
    assert caught.value.field == field


async def test_people_that_a_file_cannot_hold_are_its_formats_fault(monkeypatch):
    async def two_people(made, body):
        return [None, None]

    monkeypatch.setattr(motion_files, "performances", two_people)
    with pytest.raises(InvalidArgument, match="bvh holds one person, not 2") as caught:
        await motion_files.motion_file(None, FileOptions(FileFormat.BVH), "", "")
    assert caught.value.field == "file.format"
