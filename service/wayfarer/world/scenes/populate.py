"""People who come to a session's scene, walk about all over it, and leave again.

    crowds.set("s", Crowd(200), now)   # then, repeatedly:
    crowds.tend(now)

Everything about the people follows from the crowd's seed and their number. A few come with every
call, so that none takes long. A person leaves when it next stands, not in mid-stride.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from wayfarer.errors import (
    FailedPrecondition,
    InvalidArgument,
    MetresPerSecond,
    ResourceExhausted,
)
from wayfarer.navigation.scene import Scene
from wayfarer.spec import BETAS, GENDERS
from wayfarer.world.agents.agent import AgentInfo, AgentSpec
from wayfarer.world.agents.behaviour import Agent
from wayfarer.world.agents.faults import MAX_FAULTS, Faults, Stage
from wayfarer.world.agents.goal import DWELL, SPEED
from wayfarer.world.agents.registry import Registry
from wayfarer.world.agents.slots import Mode, Slots
from wayfarer.world.behaviours import Wander
from wayfarer.world.behaviours.places import drawn_places
from wayfarer.world.goals.commands import GoalCommand
from wayfarer.world.ranges import check_range
from wayfarer.world.scenes.messages import Crowd, CrowdState
from wayfarer.world.scenes.world_scenes import WorldScenes

AT_ONCE: Final = 4
"""Maximum number of people that come with one call: each takes about 2 ms."""

APART: Final = 1.2
"""Minimum metres between a newcomer and all others."""

FROM_WALLS: Final = 0.45
"""Metres between a newcomer and any wall."""

TRIES: Final = 24
"""Places that are checked for each person; then a later call tries again."""

LOOKS_EVERY: Final = 0.05
"""Seconds between checks of a crowd."""

LATER: Final = 0.5
"""Seconds until a person for whom no place was found tries again."""

NO_ROOM: Final = 2.0
"""Seconds until a person that the server has refused for lack of room tries again."""

FAULT_PAUSE: Final = 0.5
"""Seconds for which a crowd is not tended after an error; doubled after each further one."""

LEAVES_WITHIN: Final = 60.0
"""Seconds after which a person leaves even if it has not stood since."""

SHAPES: Final = 24
"""Number of different bodies of each gender."""

MAX_RATE: Final = 50.0
MAX_STAY: Final = 86_400.0
_STREAM: Final = 0x43524F574443524F  # second half of the key: separates these draws from others


class Whereabouts(NamedTuple):
    """Agents of a session, as of the sent motion."""

    agent_ids: tuple[str, ...]
    places: NDArray[np.float32]  # [N, 2] metres
    stands: NDArray[np.bool_]  # [N]


class CrowdWorld(Protocol):
    """The part of a world that crowds need."""

    def create_agents(
        self, session_id: str, specs: Sequence[AgentSpec], now: float
    ) -> list[AgentInfo]:
        """Raises ResourceExhausted."""
        ...

    def give(self, agent_id: str, command: GoalCommand, now: float) -> int:
        """Gives an agent a command."""
        ...

    def delete_agent(self, agent_id: str) -> None:
        """Removes an agent."""
        ...


@dataclass(slots=True)
class CrowdPeople:
    """A crowd's present people; times are the world's."""

    crowd: Crowd
    next_at: float  # when the next person may come
    looks_at: float = -np.inf  # when it is tended again
    come: int = 0  # people so far: the number of the next one
    waits: str = ""  # why the next one did not come in time
    leaves_at: dict[str, float] = field(default_factory=dict)  # by agent


@dataclass(frozen=True, slots=True)
class _Person:
    """A person of a crowd; follows from the crowd's seed and the person's number."""

    spec: AgentSpec
    wander: Wander
    stay: float  # seconds; inf: endless


class Crowds:
    """The crowds of a world, by session. Time is an argument; not thread-safe."""

    def __init__(
        self,
        world: CrowdWorld,
        registry: Registry,
        slots: Slots,
        scenery: WorldScenes,
        faults: Faults,
    ) -> None:
        self._faults = faults
        self._world = world
        self._registry = registry
        self._slots = slots
        self._scenery = scenery
        self._crowds: dict[str, CrowdPeople] = {}

    def set(self, session_id: str, crowd: Crowd, now: float) -> None:
        """Replaces an earlier crowd; its people stay as far as the new crowd needs them.

        People for whom there is no room wait. Raises NotFound, InvalidArgument; FailedPrecondition
        if the session is in no scene.
        """
        check_crowd(crowd)
        here = set(self._whereabouts(session_id).agent_ids)
        if self._scene(session_id) is None:
            raise FailedPrecondition(
                f"session {session_id!r} is in no scene: people walk about in one, so name it "
                "when the session is created"
            )
        before = self._crowds.get(session_id)
        stay = {} if before is None else {a: t for a, t in before.leaves_at.items() if a in here}
        surplus = list(stay)[crowd.count :]
        stay |= {agent_id: min(stay[agent_id], now) for agent_id in surplus}
        self._crowds[session_id] = CrowdPeople(crowd, now, leaves_at=stay)

    def copy(self, session_id: str) -> CrowdPeople | None:
        """The session's present crowd, for another server; None: it has none."""
        people = self._crowds.get(session_id)
        return people and replace(people, leaves_at=dict(people.leaves_at))

    def put(self, session_id: str, people: CrowdPeople) -> None:
        """Resumes a crowd from another server, whose people are on this one."""
        self._crowds[session_id] = people

    def state(self, session_id: str) -> CrowdState:
        """The state of the session's crowd, which may be none. Raises NotFound."""
        here = set(self._whereabouts(session_id).agent_ids)
        people = self._crowds.get(session_id)
        if people is None:
            return CrowdState(0, 0)
        wanted = people.crowd.count
        came = min(len(here & people.leaves_at.keys()), wanted)
        return CrowdState(came, wanted - came, people.waits if came < wanted else "")

    def tend(self, now: float) -> list[Agent]:
        """Makes people come and go; returns the ones that have gone."""
        gone: list[Agent] = []
        self._faults.now = now
        for session_id in list(self._crowds):
            try:
                self._tend(session_id, gone, now)
            except Exception as error:
                self._fail(session_id, now, error)
        return gone

    def _tend(self, session_id: str, gone: list[Agent], now: float) -> None:
        scene = self._scene(session_id)
        people = self._crowds[session_id]
        if scene is None or not (people.crowd.count or people.leaves_at):
            del self._crowds[session_id]
        elif now >= people.looks_at and not self._registry.sessions[session_id].frozen:
            people.looks_at = now + LOOKS_EVERY
            self._leave(session_id, people, gone, now)
            self._let_in(session_id, people, scene, now)
            self._faults.succeeded(session_id, Stage.CROWD)

    def _fail(self, session_id: str, now: float, error: Exception) -> None:
        """Pauses a crowd for a while, or, after many faults, until it is set again."""
        times, people = self._faults.session(session_id, Stage.CROWD, error), self._crowds
        if session_id in people:
            people[session_id].looks_at = (
                now + FAULT_PAUSE * 2**times if times < MAX_FAULTS else np.inf
            )
            people[session_id].waits = "an error in the server keeps people from coming"

    def _scene(self, session_id: str) -> Scene | None:
        """A session's scene as the present step sees it; None: it is in none, or has ended."""
        session = self._registry.sessions.get(session_id)
        return self._scenery.scene(session.scene) if session and session.scene else None

    def _whereabouts(self, session_id: str) -> Whereabouts:
        """Raises NotFound."""
        agents = self._registry.session(session_id).agents
        rows = np.array([agent.slot for agent in agents.values()], np.int64)
        sent = self._slots.committed
        stands = sent.gait.mode[rows] == Mode.STANDING
        return Whereabouts(tuple(agents), sent.seed.translation[rows, -1, :2], stands)

    def _leave(self, session_id: str, people: CrowdPeople, gone: list[Agent], now: float) -> None:
        here = self._whereabouts(session_id)
        stands = dict(zip(here.agent_ids, here.stands.tolist(), strict=True))
        people.leaves_at = {a: at for a, at in people.leaves_at.items() if a in stands}
        leaving = [
            self._registry.agent(agent_id)
            for agent_id, at in people.leaves_at.items()
            if now >= at and (stands[agent_id] or now >= at + LEAVES_WITHIN)
        ]
        for agent in leaving:
            self._world.delete_agent(agent.agent_id)
            del people.leaves_at[agent.agent_id]
            gone.append(agent)

    def _let_in(self, session_id: str, people: CrowdPeople, scene: Scene, now: float) -> None:
        places = [(x, y) for x, y in self._whereabouts(session_id).places.tolist()]
        for _ in range(AT_ONCE):
            if now < people.next_at or len(people.leaves_at) >= people.crowd.count:
                return
            place = self._come(session_id, people, scene, places, now)
            if place is None:
                return
            places.append(place)
            if people.crowd.spawn_rate:
                people.waits = f"{people.crowd.spawn_rate:g} come a second, as was asked for"
                people.next_at = max(people.next_at, now - 1) + 1 / people.crowd.spawn_rate

    def _come(
        self,
        session_id: str,
        people: CrowdPeople,
        scene: Scene,
        places: list[tuple[float, float]],
        now: float,
    ) -> tuple[float, float] | None:
        """Creates the next person. Returns its place; None: there was no place or no room."""
        person = drawn_person(people.crowd, people.come, scene, places)
        if person is None:
            people.come += 1  # other draws the next time
            people.next_at = now + LATER
            people.waits = "no free place was found away from walls and from everybody else"
            return None
        try:
            [made] = self._world.create_agents(session_id, [person.spec], now)
        except ResourceExhausted as error:
            people.next_at = now + NO_ROOM
            people.waits = str(error)
            return None
        people.come += 1  # so that another one comes even if this one cannot be sent off
        people.waits = ""
        people.leaves_at[made.agent_id] = now + person.stay
        self._world.give(made.agent_id, person.wander, now)
        return person.spec.position


def check_crowd(crowd: Crowd) -> None:
    """Raises InvalidArgument that names the field."""
    if crowd.count < 0:
        raise InvalidArgument(f"count is {crowd.count}; allowed: 0 or more", "count")
    if not 0 <= crowd.seed < 2**64:
        raise InvalidArgument("seed must lie in [0, 2^64)", "seed")
    for name, kind, values, (low, high) in (
        ("speed", MetresPerSecond, crowd.speed, SPEED),
        ("dwell", "{:g}".format, crowd.dwell, DWELL),
    ):
        for end, value in zip(("min", "max"), values, strict=True):
            check_range([value], low, high, f"{end}_{name}", kind)
        least, most = values
        if least > most:
            raise InvalidArgument(
                "{} is {} and {} is {}; the first must not be the greater",
                f"min_{name}",
                f"min_{name}",
                kind(least),
                f"max_{name}",
                kind(most),
            )
    check_range([crowd.spawn_rate], 0, MAX_RATE, "spawn_rate")
    check_range([crowd.stay], 0, MAX_STAY, "stay")


def drawn_person(
    crowd: Crowd, number: int, scene: Scene, others: Sequence[tuple[float, float]]
) -> _Person | None:
    """Number `number` of a crowd, at a free place away from `others`; None: none was found."""
    key = np.array([crowd.seed, _STREAM], np.uint64)
    random = np.random.Generator(np.random.Philox(key=key, counter=number))
    place = _free_place(scene, random.random((TRIES, 3)), others)
    if place is None:
        return None
    x, y, floor = place
    shape = int(random.integers(SHAPES))
    betas = np.random.Generator(np.random.Philox(key=key, counter=2**64 + shape))
    spec = AgentSpec(
        name=f"passer-by {number + 1}",
        gender=GENDERS[int(random.integers(2))],
        betas=tuple(np.clip(betas.normal(0.0, 0.8, BETAS), -2.0, 2.0).tolist()),
        position=(x, y),
        heading=float(random.uniform(-np.pi, np.pi)),
        noise_seed=int(random.integers(2**32)),
        floor=floor,
    )
    wander = Wander(
        None, speed=float(random.uniform(*crowd.speed)), dwell=float(random.uniform(*crowd.dwell))
    )
    stay = float(random.exponential(crowd.stay)) if crowd.stay else np.inf
    return _Person(spec, wander, stay)


def _free_place(
    scene: Scene, draws: np.ndarray, others: Sequence[tuple[float, float]]
) -> tuple[float, float, float] | None:
    places = drawn_places(scene, scene.main_island, draws)
    free = scene.distance(places) >= FROM_WALLS
    if len(others):
        apart = np.linalg.norm(places[:, None, :2] - np.array(others), axis=-1)
        free &= apart.min(1) >= APART
    found = np.flatnonzero(free)
    if not len(found):
        return None
    x, y, z = places[found[0]].tolist()
    return x, y, z
