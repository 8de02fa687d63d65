"""Bytes of a crowd by ring, against full detail, with a viewpoint that moves.

    python -m benchmarks.interest

One session has `agents` people that stand on a square, 5 % of them within the first ring. The clock
is manual and the engine computes nothing, so bytes do not depend on the machine. One reader has
rings, and its viewpoint goes across the square and back at 3 m/s; another has everybody in full.
Ends with 1 when the reader with rings gets more than an eighth of the other's bytes, or when
somebody pops in: comes without `added` and FIRST, misses a chunk while within the rings, or comes
after being `hidden`.
"""

import argparse
import asyncio
import json
import math
import sys
from collections import Counter
from collections.abc import AsyncGenerator
from contextlib import AsyncExitStack, aclosing
from typing import Any

import numpy as np

from benchmarks.driven import Driven, InstantEngine
from wayfarer.config.limits import Limits
from wayfarer.transport import schema
from wayfarer.transport.codec import PoseEncoding, PoseProfile
from wayfarer.transport.conversion.bodies import BodyLibrary
from wayfarer.transport.gateway import Gateway
from wayfarer.transport.streams.stream import MotionStream
from wayfarer.v1 import motion_pb2
from wayfarer_lab.load.rings import PART_BONES

NEAR, MIDDLE, FAR = 12.0, 25.0, 60.0
"""Radii of the rings in metres."""

NEAR_SHARE = 0.05
MOST = 1 / 8
SPEED = 3.0
LOOKS = 10
"""Moves of the viewpoint per second."""

NAMES = ("full", "fewer bones", "root")
FIRST, GAP = motion_pb2.CHUNK_FLAG_FIRST, motion_pb2.CHUNK_FLAG_GAP


def interest(x: float) -> schema.Interest:
    """The rings, seen from (x, 1.7, 0) in the glTF basis."""
    fewer = schema.PoseFormat(
        encoding=PoseEncoding.SMALLEST_THREE, profile=PoseProfile.BONES, bones=PART_BONES, fps=20
    )
    root = schema.PoseFormat(encoding=PoseEncoding.ROOT)
    return schema.Interest(
        rings=(
            schema.InterestRing(radius=NEAR),
            schema.InterestRing(radius=MIDDLE, format=fewer),
            schema.InterestRing(radius=FAR, format=root),
        ),
        viewpoints=views(x).viewpoints,
    )


def views(x: float) -> schema.Viewpoints:
    """One viewpoint."""
    place = schema.Vector3(x=x, y=1.7, z=0.0)
    return schema.Viewpoints(viewpoints=(schema.Viewpoint(position=place),))


class StandingEngine(InstantEngine):
    """Moves nobody."""

    stride = 0.0


class Tally:
    """The data of one reader."""

    def __init__(self) -> None:
        self.bytes: Counter[str] = Counter()
        self.chunks: Counter[str] = Counter()
        self.entered = self.left = 0
        self.faults: list[str] = []
        self._last: dict[int, int] = {}  # sequence numbers of agents within the rings

    def take(self, message: motion_pb2.StreamMotionResponse) -> None:
        """Counts a message, and looks for people that pop in."""
        batch = message.batch
        name = NAMES[batch.tier] if batch.chunks.aliases else "other"
        described = sum(agent.ByteSize() + 3 for agent in batch.added)
        self.bytes["descriptions"] += described
        self.bytes[name] += message.ByteSize() - described
        self.chunks[name] += len(batch.chunks.aliases)
        added = {agent.alias for agent in batch.added}
        columns = zip(batch.chunks.aliases, batch.chunks.seqs, batch.chunks.flags, strict=True)
        for alias, seq, flags in columns:
            before = self._last.get(alias)
            self.entered += before is None
            if before is None and not (flags & FIRST and alias in added):
                self.faults.append(f"{alias} came without FIRST or without being added")
            if before is not None and (seq != before + 1 or flags & (FIRST | GAP)):
                self.faults.append(f"{alias}: chunk {seq} with flags {flags} after {before}")
            self._last[alias] = seq
        for alias in batch.hidden:
            self.left += 1
            if self._last.pop(alias, None) is None:
                self.faults.append(f"{alias} was hidden, and was not there")


async def read(messages: AsyncGenerator[bytes], tally: Tally) -> None:
    """Counts all messages."""
    async for message in messages:
        tally.take(motion_pb2.StreamMotionResponse.FromString(message))


async def measure(asked: argparse.Namespace) -> dict[str, object]:
    """The figures; `asked` also has what `Driven` needs."""
    driven = Driven(asked, StandingEngine())
    limits = Limits(agents=asked.agents, agents_per_session=asked.agents, agents_per_call=500)
    service: Any = driven
    gateway = Gateway(service, BodyLibrary("anny52"), limits, lambda: driven.now, lambda: None)
    await gateway.take_over()
    session_id = (await gateway.sessions.create(schema.NewSession())).session_id
    side = math.sqrt(math.pi * NEAR**2 / NEAR_SHARE)
    random = np.random.default_rng(7)
    places = random.uniform(-side / 2, side / 2, (asked.agents, 2))
    turns = random.uniform(-math.pi, math.pi, asked.agents)
    specs = [
        schema.AgentSpec(position=schema.Vector3(x=x, y=0.0, z=z), heading=turn)
        for (x, z), turn in zip(places.tolist(), turns.tolist(), strict=True)
    ]
    for start in range(0, asked.agents, limits.agents_per_call):
        part = specs[start : start + limits.agents_per_call]
        await gateway.agents.create(session_id, schema.NewAgents(agents=tuple(part)))
    full, ringed = Tally(), Tally()
    async with AsyncExitStack() as stack:
        streams: list[MotionStream] = []
        readers = []
        for tally, rings in ((full, None), (ringed, interest(-side / 2))):
            request = schema.StreamRequest(session_id=session_id, interest=rings)
            stream, messages = await stack.enter_async_context(gateway.motion.follow(request))
            await stack.enter_async_context(aclosing(messages))
            readers.append(asyncio.create_task(read(messages, tally)))
            streams.append(stream)
        for step in range(round(asked.seconds * LOOKS)):
            way = SPEED * step / LOOKS % (2 * side)
            x = (way if way < side else 2 * side - way) - side / 2
            streams[1].look(views(x))
            await driven.advance(1 / LOOKS)
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)
    return report(asked, full, ringed)


def report(asked: argparse.Namespace, full: Tally, ringed: Tally) -> dict[str, object]:
    """The figures in kB per second, and per second and person."""
    steps = full.chunks["full"] / asked.agents
    rings = {
        name: {
            "people": round(ringed.chunks[name] / steps, 1),
            "kB_s": round(ringed.bytes[name] / asked.seconds / 1000, 1),
            "kB_s_person": round(ringed.bytes[name] / max(1, ringed.chunks[name]) / 200, 3),
        }
        for name in NAMES
    }
    moving = ringed.bytes.total() - ringed.bytes["other"]
    whole = full.bytes.total() - full.bytes["other"]
    return {
        "agents": asked.agents,
        "seconds": asked.seconds,
        "full_kB_s": round(whole / asked.seconds / 1000, 1),
        "rings_kB_s": round(moving / asked.seconds / 1000, 1),
        "share": round(moving / whole, 4),
        "near_share": round(ringed.chunks["full"] / full.chunks["full"], 4),
        "rings": rings,
        "descriptions_kB_s": round(ringed.bytes["descriptions"] / asked.seconds / 1000, 1),
        "entered": ringed.entered,
        "left": ringed.left,
        "faults": full.faults[:5] + ringed.faults[:5],
    }


def measure_now(agents: int, seconds: float, phases: int = 8) -> dict[str, object]:
    """The figures; `phases`: moments of a step at which parts of the people are due."""
    crowd = argparse.Namespace(agents=agents, seconds=seconds, phases=phases)
    crowd.sessions, crowd.candidates, crowd.batch = 1, 1, 256
    return asyncio.run(measure(crowd))


def main() -> int:
    """Runs it; returns 0 if all is well."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--agents", type=int, default=1000, help="people (default %(default)s)")
    parser.add_argument("--seconds", type=float, default=60.0, help="default %(default)g")
    asked = parser.parse_args()
    found = measure_now(asked.agents, asked.seconds)
    print(json.dumps(found, indent=1))
    return 1 if found["faults"] or float(str(found["share"])) > MOST else 0


if __name__ == "__main__":
    sys.exit(main())
