"""People come to a scene until it is full, and the call says why the rest wait."""

import httpx

FLOOR = [{"x": x, "y": 0, "z": z} for x, z in ((-20, -20), (20, -20), (20, 20), (-20, 20))]


async def test_as_many_come_as_there_is_room_for(server):
    async with httpx.AsyncClient(base_url=server.http_url, timeout=60) as http:
        scene = (await http.post("/v1/scenes", json={"floors": [{"outline": FLOOR}]})).json()
        made = await http.post("/v1/sessions", json={"scene": scene["scene_id"]})
        path = f"/v1/sessions/{made.json()['session_id']}"

        async def asked(count: int) -> dict:
            answer = await http.post(f"{path}/crowd", json={"count": count, "seed": 1})
            assert answer.status_code == 200, answer.text
            return answer.json()

        assert await asked(4) == {"came": 4, "waiting": 0, "reason": ""}
        assert len((await http.get(f"{path}/agents")).json()["agents"]) == 4
        full = await asked(40)
        assert (full["came"], full["waiting"]) == (32, 8)
        assert "has 32 agents and may have 32" in full["reason"]
        assert await asked(0) == {"came": 0, "waiting": 0, "reason": ""}
