"""A manoeuvre: cases to play, figures of each take, and bars.

A foot's *height* is that of its lowest sole marker above the ground. It is *lifted* from the moment
it rises above 1.5 cm until it is below 1.0. It *bears* if it is not lifted and slower than 0.7 m/s,
or if the other foot does not bear either. A *stance* is a period of bearing; its *slip* is the
farthest that the patch on the ground (sole markers within 1 cm of the lowest) was from its start,
its *turn* the range of the foot's heading. `n` are takes, `people` are people, or styles of one
person.

Figures:
    hips_p5: height of the hips ÷ that in the T-pose, 5th percentile of all frames
    hips_least: the same, minimum
    lean_*: angle from the vertical of the line from between the ankles to the head; `p95`: 95th
        percentile of frames
    left_right_points: largest difference between left and right of `hips_p5`, `float_share`,
        `contact_up` and `arrive`, in points of 100
    tilt_*: angle of the trunk (waist to chest) from that of the T-pose, to any side
    over_30_deg: share of frames with the trunk over 30°
    float_share: share of frames with the lower foot more than 3 cm up
    floats_seen: share of takes in which that lasts 0.2 s
    airborne_share: share of frames in which neither foot bears
    contact_up: share of reported contacts with that foot more than 2 cm up
    contact_floating: share of floating frames with any contact reported
    slip_cm_*: slip of all stances: median, 95th percentile, each foot
    stance_turn_deg_*: turn of all stances, likewise
    lift_cm_p50: median height of lifts
    arrive: share within 0.3 m of the goal at the end
    end_m: distance to the goal at the end
    off_heading_*: angle off the asked heading
    off_goal_cm*: stop: distance from the goal 2 s after rest
    lifts: lifts of both feet together
    lifts_per_04_m: lifts per 0.4 m of path
    no_lift: share of takes without any lift
    slide_cm*: stand: how far a sole moved between two lifts, whether it bears or hovers; largest of
        a take
    heading_range_deg*: stand: range of the hips' heading
    pivot_deg: turn: turn of all stances together, mean of both feet, in 6 s
    faces: turn: share within 15° of the asked heading after 6 s
    peak_deg_s: greatest speed of the hips' heading, over 0.05 s
    turn_s: seconds from 10 % to 90 % of the turn
    apart_cm*: stop: ankle to ankle along the facing, 2 s after rest (hips and ankles slower than 8
        cm/s for 1 s)
    heel_up: stop: share with a heel over 2 cm above the lowest sole marker at that moment
    sway_back_cm*: stop: how far the hips go back, the way that they faced, within 3 s after they
        have slowed to 0.3 m/s
    behind_cm*: stop: how far they are behind the rear ankle in that time, at worst
    lean_back_deg*: stop: how far the trunk leans back in that time, at worst
    more_lifts*: stop: lifts of both feet in that time
    hand_ahead_cm*: stand and stop: how far a wrist is ahead of the hips, of the one that is
        farther; in a stand its mean over time, in a stop 2 s after rest
    hands_apart_cm*: by how far it is ahead of the other one
    hand_up_cm*: by how far one wrist is above the other one
    pop_cm*: largest second difference of any joint's position, cm/frame²
    both_up: share of frames with both soles more than 3 cm above the ground
    sunk: share of frames with a sole more than 3 cm below the ground
    folded: share of agents whose hips sink below 0.75 of their height in the T-pose
    root_step_cm: longest way of the hips from one frame to the next, in space
    knee_*: flexion from the T-pose, −180 … 180; negative is beyond straight, or inside out
    steps_per_riser: footholds (slower than 0.3 m/s, 10 cm apart) ÷ risers between the lowest and
        the highest
    speed_mps*: speed along the path
    cadence*: steps per second, from strikes: an ankle farthest ahead of the hips (Zeni 2008)
    step_m: length of a step, from strikes
    width_cm: width of a step, from strikes
    bob_cm: hips up and down: 2 √2 σ after the mean over a stride is subtracted
    lateral_cm: the same sideways
    surge_mps: the same of the speed
    trunk_deg: forward tilt of the trunk
    head_deg: pitch of the head; negative: it looks down
    hips_*_hz: mean square velocity of the hips by frequency band, (m/s)²; `÷ recorded`: each
        recorded walk against ours of the nearest speed
    limbs_*_hz: the same of ten limb joints relative to the hips
    pace*: way made toward the goal while a walk is steady ÷ way asked for; people that stand count
    right_first: share of starts in which the right foot is lifted first
    cycle_sd_deg: standard deviation of the mean gait cycle between people, by joint, axis and
        moment
    phase_order: |mean exp(2πi phase)| of all walkers, from 2 s on, while 9 of 10 phases are known;
        1 is a march, chance is 0.9 ÷ √n
    start_spread_s: 5th to 95th percentile of the time until 0.3 m/s
    start_sd_s: standard deviation of that time
    auc: linear classifier (shrunk LDA, 4 folds by person) between ours and recorded people, on the
        statistics of `frechet_v1` without mean heights, windows of 2 s at 0.9–1.5 m/s, matched in
        number and speed, mean of 5 draws. In the column *recorded*: half of the people against the
        other half
    frechet: Fréchet distance on the same
    arrive_s*: path: seconds until it is within 0.3 m of the last goal
    passed: path: share of waypoints within whose radius the hips came
    missed_by_m: path: nearest approach to a waypoint
    speed_kept: path: lowest speed within 1 s of a waypoint ÷ median speed between waypoints
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, nan, pi, radians, sin
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from wayfarer.navigation.scene_spec import SceneSpec
from wayfarer.spec import FPS
from wayfarer.world.agents.agent import AgentInfo, AgentSpec
from wayfarer.world.agents.goal import Goal
from wayfarer_lab.evaluation.figures import mean, quantile
from wayfarer_lab.evaluation.takes import Take
from wayfarer_lab.evaluation.tasks import AgentTask, Plan, TimedCommand, random_specs, relative

Array = NDArray[np.floating[Any]]
Figures = dict[str, float]
"""Name → value; NaN: could not be measured."""

SENT: Final = "sent"
RAW: Final = "raw"
RECORDED: Final = "recorded"
"""Sources of a row: as sent, the model alone without any rule after it, recorded people."""


@dataclass(frozen=True)
class MeasuredTake:
    """A take and its goal; a recorded take has none."""

    take: Take
    goal: Goal | None = None  # the last one


@dataclass(frozen=True)
class Case:
    """One variant of a manoeuvre. Agents get their first orders after 2 s of standing."""

    name: str
    seconds: float  # from the first order
    tasks: Callable[[int, np.random.Generator], list[AgentTask]]  # of N agents
    scene: Callable[[], SceneSpec] | None = None  # None: an endless flat floor
    share: float = 1.0  # of the manoeuvre's agents


@dataclass(frozen=True)
class Request:
    """An order for an agent: numbers of both, from 0 on."""

    agent: int
    order: int
    spec: AgentSpec
    random: np.random.Generator


def case(
    name: str,
    seconds: float,
    plan: Callable[[Request], Plan] | None = None,
    *,
    every: float | None = None,
    placed: Callable[[AgentSpec, np.random.Generator], AgentSpec] = lambda spec, random: spec,
    scene: Callable[[], SceneSpec] | None = None,
    share: float = 1.0,
) -> Case:
    """A case of random people, moved by `placed`, and the path that `plan` makes of each request.

    Orders come at 0 s alone, or every `every` seconds; without `plan` there are none.
    """
    moments = np.arange(0.0, seconds - 1e-6, every or seconds)

    def tasks(agents: int, random: np.random.Generator) -> list[AgentTask]:
        found = []
        for number, spec in enumerate(random_specs(agents, random)):
            person = placed(spec, random)
            orders = [
                TimedCommand(round(float(at), 3), plan(Request(number, order, person, random)))
                for order, at in enumerate(moments)
                if plan is not None
            ]
            found.append(AgentTask(person, tuple(orders)))
        return found

    return Case(name, seconds, tasks, scene, share)


@dataclass(frozen=True)
class Bar:
    """The range that a figure has to be in. `case` None: in every case."""

    figure: str
    low: float = -np.inf
    high: float = np.inf
    case: str | None = None
    origin: str = "quality target"

    def met(self, value: float) -> bool | None:
        """Whether `value` is in range; None for NaN."""
        return None if np.isnan(value) else bool(self.low <= value <= self.high)

    def text(self) -> str:
        """The range as text."""
        if np.isinf(self.low):
            return f"≤ {self.high:g}"
        return f"≥ {self.low:g}" if np.isinf(self.high) else f"{self.low:g} … {self.high:g}"


Rows = Mapping[tuple[str, str], Figures]
"""(case, source) → its row."""


MeasuredTakes = Mapping[tuple[str, str], Sequence[MeasuredTake]]
"""(case, source) → its takes."""


def nothing_more(rows: Rows, shots: MeasuredTakes) -> dict[tuple[str, str], Figures]:
    """The default of `Maneuver.across`: no further rows."""
    return {}


@dataclass(frozen=True)
class Maneuver:
    """A test that is played, and its measurement."""

    name: str
    about: str  # a line
    agents: int  # of each case
    cases: tuple[Case, ...]
    measure: Callable[[MeasuredTake], Figures]  # of one take
    row: Callable[[Sequence[MeasuredTake], Sequence[Figures]], Figures]  # of all takes of a case
    bars: tuple[Bar, ...]
    across: Callable[[Rows, MeasuredTakes], dict[tuple[str, str], Figures]] = nothing_more
    # rows that need several cases or sources
    least: int = 2  # agents of a case, in the smallest trial, too
    worst: str = ""  # figure whose largest value marks the worst take, for the pictures
    strip: Callable[[MeasuredTake], Take] = lambda shot: shot.take[
        : 4 * FPS
    ]  # the part of a take that is drawn


def part(take: Take, start: float, stop: float) -> Take:
    """The part of a take between two seconds, clipped to the take; at least a frame."""
    first = min(max(round(start * FPS), 0), len(take) - 1)
    return take[first : max(round(stop * FPS), first + 1)]


def spread(each: Sequence[Figures], **wanted: str) -> Figures:
    """Figures of a row from those of its takes: `name="mean of figure"`, or a quantile such as
    `p95 of`, `max of`, `min of`, `median of`. NaN takes are left out.
    """
    row = {}
    for name, rule in wanted.items():
        how, _, figure = rule.partition(" of ")
        values = [figures[figure] for figures in each]
        row[name] = mean(values) if how == "mean" else quantile(values, QUANTILES[how])
    return row


QUANTILES: Final = {
    "min": 0.0, "p5": 0.05, "p10": 0.1, "median": 0.5, "p90": 0.9, "p95": 0.95, "max": 1.0,
}  # fmt: skip


def pooled(values: Sequence[Array], at: float) -> float:
    """Quantile of all values of several arrays; NaN without any."""
    every = np.concatenate([np.zeros(0), *values])
    return float(np.quantile(every, at)) if len(every) else nan


def way_to(angle: float, metres: float, speed: float = 1.2, **how: Any) -> Plan:
    """One goal `metres` away, `angle` degrees to the left of straight ahead."""

    def plan(agent: AgentInfo) -> list[Goal]:
        ahead, left = metres * cos(radians(angle)), metres * sin(radians(angle))
        return [Goal(relative(agent, ahead, left), speed=speed, **how)]

    return plan


def strafe_to(angle: float, metres: float, speed: float) -> Plan:
    """`way_to`, with the heading kept."""
    return lambda agent: way_to(angle, metres, speed, heading=agent.heading, strafe=True)(agent)


def turn_by(angle: float) -> Plan:
    """The agent's own place, with a heading `angle` degrees further to the left."""

    def plan(agent: AgentInfo) -> list[Goal]:
        x, y, _ = agent.position
        heading = (agent.heading + radians(angle) + pi) % (2 * pi) - pi
        return [Goal((x, y, 0.0), heading=heading)]

    return plan
