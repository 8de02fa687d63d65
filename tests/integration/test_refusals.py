"""Refusals use the basis and the unit of the client, on both transports."""

import httpx
import pytest

HERE = {"x": 0, "y": 0, "z": 0}
BOUND = {"gltf": "10000 m", "unreal": "1e+06 cm"}
FAR = {"gltf": {"x": 1.5e6, "y": 0, "z": 2}, "unreal": {"x": 2, "y": 1.5e6, "z": 0}}
TOLD = {"gltf": "(1.5e+06, 0, 2)", "unreal": "(2, 1.5e+06, 0)"}


@pytest.fixture
async def http(server):
    async with httpx.AsyncClient(base_url=server.http_url, timeout=60) as client:
        yield client


async def walker(http: httpx.AsyncClient, basis: str) -> tuple[str, str]:
    """A session, and the path of a person in it."""
    made = await http.post("/v1/sessions", json={"basis": basis})
    session = made.json()["session_id"]
    people = await http.post(f"/v1/sessions/{session}/agents", json={"agents": [{}]})
    return session, f"/v1/agents/{people.json()['agents'][0]['agent_id']}"


async def refused(call) -> tuple[str, str]:
    """Field and detail of the only error."""
    answer = await call
    assert answer.status_code == 422, answer.text
    (error,) = answer.json()["errors"]
    detail = answer.json()["detail"]
    assert detail.endswith(error["detail"]) and detail.count(error["field"]) == 1
    return error["field"], error["detail"]


@pytest.mark.parametrize("basis", ["gltf", "unreal"])
async def test_places_are_the_clients(http, basis):
    session, agent = await walker(http, basis)
    told = f"is {TOLD[basis]}; allowed: at most {BOUND[basis]} from the origin along each axis"
    asked = {"position": FAR[basis]}
    found = await refused(http.put(f"{agent}/goal", json=asked))
    assert found == ("position", f"position {told}")
    found = await refused(http.put(f"{agent}/path", json={"goals": [{"position": HERE}, asked]}))
    assert found == ("goals[1].position", f"goals[1].position {told}")
    found = await refused(http.post(f"/v1/sessions/{session}/agents", json={"agents": [asked]}))
    assert found == ("agents[0].position", f"agents[0].position {told}")
    found = await refused(
        http.post("/v1/clips", json={"seconds": 1, "agent": asked, "basis": basis})
    )
    assert found[1].endswith(told)


@pytest.mark.parametrize(
    ("basis", "asked", "field", "told"),
    [
        ("gltf", {"radius": 20}, "radius", "holds 20 m; allowed: 0.05 m to 10 m"),
        ("unreal", {"radius": 2000}, "radius", "holds 2000 cm; allowed: 5 cm to 1000 cm"),
        ("gltf", {"speed": 9}, "speed", "holds 9 m/s; allowed: 0.2 m/s to 4 m/s"),
        ("unreal", {"speed": 900}, "speed", "holds 900 cm/s; allowed: 20 cm/s to 400 cm/s"),
        (
            "unreal_mannequin",
            {"position": {"x": 0, "y": 500_000, "z": 0}},
            "position",
            "goal is 500000 cm from the agent; allowed: at most 100000 cm",
        ),
    ],
)
async def test_lengths_and_speeds_are_the_clients(http, basis, asked, field, told):
    _, agent = await walker(http, basis)
    found = await refused(http.put(f"{agent}/goal", json={"position": HERE, **asked}))
    assert found[0] == field and found[1].endswith(told)


@pytest.mark.parametrize(
    ("behaviour", "field", "told"),
    [
        ({"follow": {"behind": 5000}}, "follow.behind", "holds 5000 cm; allowed: -1000 cm to 1000"),
        ({"follow": {"behind": 10}}, "follow.behind", "10 cm from whom it follows; allowed: 50 cm"),
        (
            {"wander": {"area": {"center": HERE, "radius": 10}}},
            "wander.area.radius",
            "holds 10 cm; allowed: 50 cm to 100000 cm",
        ),
        (
            {"routine": {"parts": [{"stand": {}, "seconds": 1}, {"wander": {"speed": 900}}]}},
            "routine.parts[1].wander.speed",
            "holds 900 cm/s; allowed: 20 cm/s to 400 cm/s",
        ),
        (
            {"queue": {"name": "till", "head": HERE, "spacing": 1}},
            "queue.spacing",
            "holds 1 cm; allowed: 50 cm to 500 cm",
        ),
    ],
)
async def test_behaviours_too(http, behaviour, field, told):
    _, agent = await walker(http, "unreal")
    if "follow" in behaviour:
        behaviour["follow"]["agent_id"] = "somebody"
    name, detail = await refused(http.put(f"{agent}/behaviour", json=behaviour))
    assert name == field and told in detail


@pytest.mark.parametrize(
    ("solid", "field", "told"),
    [
        (
            {"box": {"position": HERE, "size": {"x": 1, "y": 1, "z": 0.1}}},
            "solids[0].box.size",
            "is 0.1 cm, allowed is 1 cm to 50000 cm",
        ),
        (
            {"cylinder": {"position": {"x": 9e9, "y": 0, "z": 0}, "radius": 9, "height": 9}},
            "solids[0].cylinder.position",
            "is (9e+09, 0, 0), allowed is at most 1e+06 cm from the origin along each axis",
        ),
        (
            {
                "prism": {
                    "outline": [
                        {"x": x, "y": y, "z": 0}
                        for x, y in ((0, 0), (400, 200), (400, 0), (0, 200))
                    ],
                    "height": 90,
                }
            },
            "solids[0].prism.outline",
            "no simple outline (Self-intersection at (200, 100, 0))",
        ),
    ],
)
async def test_scenes_too(http, solid, field, told):
    corners = ((-900, -900), (900, -900), (900, 900), (-900, 900))
    floor = {"outline": [{"x": x, "y": y, "z": 0} for x, y in corners]}
    request = {"basis": "unreal", "floors": [floor], "solids": [solid]}
    name, detail = await refused(http.post("/v1/scenes", json=request))
    assert name == field and told in detail
