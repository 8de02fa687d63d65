"""People as points with the inertia of bodies, for tests of avoidance.

They receive a velocity every 0.2 s, a quarter of them at a time, react within 0.3 s, and turn by at
most 2 rad/s. Like bodies, they stumble along at 0.5 m/s when asked to walk more slowly. A standing
person starts after 0.6 s of continuous requests.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from wayfarer.world.avoidance.avoid import avoid
from wayfarer.world.avoidance.people import Aims, Float, Memory, People

TICK, PHASES = 0.05, 4
STEP = TICK * PHASES
REACTION, TURN, SLOWEST = 0.3, 2.0, 0.5
START, STANDS = 0.6, 0.25


@dataclass
class Walkers:
    """`goals(walkers)` returns the next goals [N, 2]; a goal is reached within 0.3 m."""

    start: Float  # [N, 2]
    goals: Callable[["Walkers"], Float]
    clear: Callable[[Float], Float] | None = None
    speed: Float | float = 1.2
    group: np.ndarray | None = None
    now: float = 0.0
    nearest: list[Float] = field(default_factory=list)  # [N] distances to the nearest person
    people: People = field(init=False)
    told: Float = field(init=False)
    stuck: Float = field(init=False)  # longest seconds without 0.3 m of progress before the goal
    contact: float = np.inf  # minimum distance to a wall

    def __post_init__(self) -> None:
        count = len(self.start)
        self.people = People.empty(count)
        self.people.memory, self.people.aims = Memory.empty(count), Aims.empty(count)
        self.people.number[:] = np.arange(count)
        self.people.position[:] = self.start
        self.people.radius[:] = 0.25
        if self.group is not None:
            self.people.group[:] = self.group
        self.told = np.zeros((count, 2), np.float32)
        self.speed = np.broadcast_to(np.float32(self.speed), count)
        self.facing = None
        self._starting = np.zeros(count)
        self.stuck = np.zeros(count)
        self._anchor = np.array(self.start, float)
        self._since = np.zeros(count)

    @property
    def there(self) -> np.ndarray:
        return np.linalg.norm(self.goals(self) - self.people.position, axis=-1) < 0.3

    def run(self, seconds: float) -> "Walkers":
        for _ in range(round(seconds / TICK)):
            self._tell(round(self.now / TICK) % PHASES)
            self._move()
            self.now += TICK
            self._observe()
        return self

    def _tell(self, phase: int) -> None:
        people = self.people
        people.aims.spot[:] = goals = self.goals(self)
        way = goals - people.position
        distance = np.linalg.norm(way, axis=-1)
        people.walks[:] = distance >= 0.3
        self.told[~people.walks] = 0
        rows = np.flatnonzero(people.walks & (people.number % PHASES == phase))
        if not len(rows):
            return
        preferred = way[rows] / distance[rows, None] * self.speed[rows, None]
        course = avoid(people, rows, preferred.astype(np.float32), self.clear, STEP)
        self.told[rows] = course.velocity
        people.memory.put(rows, course.memory)

    def _move(self) -> None:
        people = self.people
        want = np.linalg.norm(self.told, axis=-1)
        want = np.where(want > 0, np.maximum(want, np.minimum(SLOWEST, self.speed)), 0)
        stands = np.linalg.norm(people.velocity, axis=-1) < STANDS
        self._starting = np.where(stands & (want > 0), self._starting + TICK, 0)
        want = np.where(stands & (self._starting < START), 0, want)
        if self.facing is None:
            self.facing = np.arctan2(*(self.goals(self) - people.position).T[::-1])
        aim = np.arctan2(self.told[:, 1], self.told[:, 0])
        off = (aim - self.facing + np.pi) % (2 * np.pi) - np.pi
        turn = np.clip(off, -TURN * TICK, TURN * TICK) * (want > 0)
        self.facing = self.facing + turn
        speed = np.linalg.norm(people.velocity, axis=-1)
        want = want * (np.abs(off) < np.radians(120))  # first it turns about
        speed += (want - speed) * TICK / REACTION
        heading = np.stack([np.cos(self.facing), np.sin(self.facing)], -1)
        people.velocity[:] = heading * speed[:, None]
        people.position[:] += people.velocity * TICK

    def _observe(self) -> None:
        place = self.people.position
        apart = np.linalg.norm(place[:, None] - place, axis=-1)
        np.fill_diagonal(apart, np.inf)
        self.nearest.append(apart.min(1))
        if self.clear is not None:
            self.contact = min(self.contact, float(self.clear(place[None]).min()))
        on = np.linalg.norm(place - self._anchor, axis=-1) > 0.3
        self._anchor[on] = place[on]
        self._since = np.where(on | self.there, 0, self._since + TICK)
        self.stuck = np.maximum(self.stuck, self._since)
