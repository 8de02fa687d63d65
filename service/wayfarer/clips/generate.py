"""Motion without a server: a world is stepped as fast as it goes and its frames become a clip."""

import math
from collections.abc import Callable, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.progress import Progress

from wayfarer.body.outfit import OUTFIT_TEXT, check_outfit
from wayfarer.body.phenotype import betas_from_phenotype
from wayfarer.characters.character import Character
from wayfarer.clips.clip import Clip, join_chunks
from wayfarer.clips.crowd import crowd_clips, scene_of
from wayfarer.clips.files import (
    BodyDetail,
    BoneNames,
    FileOptions,
    FileUnit,
    RootMotion,
    check_target,
    encode,
    format_of,
    write_clip,
)
from wayfarer.clips.on_character import body_of, on_character, read_character
from wayfarer.clips.planned import plan_clip
from wayfarer.errors import InvalidArgument
from wayfarer.models.bundle import DEFAULT_MODEL, open_bundle
from wayfarer.navigation.ground.ground import triangles
from wayfarer.runtime.walk import walk
from wayfarer.spec import BETAS, FPS, TURN
from wayfarer.world.agents.agent import AgentSpec, AgentState, ChunkFlag, MotionChunk
from wayfarer.world.agents.goal import Goal
from wayfarer.world.goals.steering import Steering
from wayfarer.world.scenes.messages import Crowd, SceneSource
from wayfarer.world.scenes.scene_registry import SceneRegistry
from wayfarer.world.search.beam_settings import HARD, BeamSettings
from wayfarer.world.world import World

SPEED = 1.2
"""Default speed of a person, metres per second."""
MAX_SECONDS = 120.0
"""Longest clip that ends with the arrival, seconds."""
REST = 1.0
"""Seconds that such a clip continues after the arrival."""
MOST = 200
"""Maximum number of people in a file."""
NOBODY_GOES = 20.0
"""Default seconds of a clip without goals, or of one planned by beam search."""


class SearchKind(StrEnum):
    """How primitives are chosen."""

    ONLINE = "online"  # as the service does: the best of each step, final
    BEAM = "beam"  # several ways are kept at every step, and the best one at the end


def generate_clip(
    world: World,
    spec: AgentSpec,
    goals: Sequence[Goal],
    seconds: float | None = None,
    watch: Callable[[float], None] = lambda done: None,
) -> Clip:
    """One agent visits `goals` in turn; it stops at each goal before the next.

    The clip has exactly `seconds` × 40 frames, whether or not all goals were reached. None: it ends
    a second after the agent has stopped at the last goal. `clip.meta` gives the number of goals
    reached, and the seconds after which each was (`goals_reached`, `arrivals`). `watch` receives
    the seconds done. Raises InvalidArgument on a bad spec or goal.
    """
    most = seconds
    if most is None:
        most = MAX_SECONDS if goals else NOBODY_GOES
    chunks: list[MotionChunk] = []
    arrivals: list[str] = []
    frames, left = 0, round(REST * FPS)
    for published in walk(world, spec, goals, most, until_arrival=False):
        [chunk] = published.chunks
        chunks.append(chunk)
        frames += len(chunk.translation)
        if chunk.flags & ChunkFlag.ARRIVED:
            arrivals.append(f"{frames / FPS:.1f}")
        watch(frames / FPS)
        if seconds is None and goals and len(arrivals) >= len(goals):
            left -= len(chunk.translation) if chunk.state is AgentState.STANDING else 0
            if left <= 0:
                break
    visited = tuple(goal.position for goal in goals)
    arrived = {"goals_reached": str(len(arrivals)), "arrivals": " ".join(arrivals)}
    return join_chunks(chunks, spec, goals=visited, meta=arrived)


def generate(
    target: Annotated[
        Path,
        typer.Argument(
            help="File to write: .glb (body and motion), .vrma (for any VRM), .bvh, .npz (AMASS), "
            ".usd (needs usd-core)."
        ),
    ],
    goal: Annotated[
        list[str] | None, typer.Option(help="Goal on the floor: X,Y in metres; repeatable.")
    ] = None,
    gender: Annotated[
        str | None,
        typer.Option(help="female or male; default female, or the gender that fits a --character."),
    ] = None,
    outfit: Annotated[
        str, typer.Option(help=f"Clothes of the body: {OUTFIT_TEXT.partition(';')[0]}.")
    ] = "",
    height: Annotated[
        float | None,
        typer.Option(help="Standing height in metres, e.g. 1.70; without it, the mean body."),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            help="Target speed, metres per second; default 1.2, for a --character of another size "
            "than a person's 1.2 times the root of its scale."
        ),
    ] = None,
    heading: Annotated[
        float, typer.Option(help="Heading at the start, in radians; 0 faces +Y.")
    ] = 0.0,
    seconds: Annotated[
        float | None,
        typer.Option(
            help="Length of the clip in seconds; without it, the clip ends a second after the "
            "arrival at the last goal. Without goals, and with beam: 20."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="The same seed gives the same motion.", min=0)] = 0,
    search: Annotated[
        SearchKind,
        typer.Option(
            help="online: choose step by step, as the server does. beam: keep several motions at "
            "every step and choose the best at the end; slower by about children x keep."
        ),
    ] = SearchKind.ONLINE,
    candidates: Annotated[
        int | None,
        typer.Option(
            help="With online: candidate primitives per step; default 1, as on the server.", min=1
        ),
    ] = None,
    children: Annotated[
        int | None, typer.Option(help="With beam: primitives tried after each kept one; default 4.")
    ] = None,
    keep: Annotated[
        int | None, typer.Option(help="With beam: primitives kept at every step; default 4.")
    ] = None,
    people: Annotated[
        int,
        typer.Option(
            help="More than one: they walk about by themselves, in one file.", min=1, max=MOST
        ),
    ] = 1,
    scene: Annotated[
        str,
        typer.Option(
            help="Where several people walk, and in the file with them: an example's name such as "
            "town_square, or a level's file; default an empty field."
        ),
    ] = "",
    hard: Annotated[
        bool,
        typer.Option("--hard", help="With beam: reject motions whose feet slide, float or sink."),
    ] = False,
    character: Annotated[
        Path | None,
        typer.Option(
            help="Your own character, .glb or .vrm: the file written is this one with the motion "
            "in it; without --height the person has its proportions."
        ),
    ] = None,
    names: Annotated[
        BoneNames,
        typer.Option(help="Names of the bones in .glb, .bvh and .usd; smpl: as in the API."),
    ] = BoneNames.MIXAMO,
    fps: Annotated[
        float | None, typer.Option(help="Frames per second of the file, 1 to 240; default 40.")
    ] = None,
    root: Annotated[
        RootMotion,
        typer.Option(
            help="Where the travelled path is. hips: the hips have it. bone: a bone `root` above "
            "the hips has it (Unreal's root motion). in_place: nowhere."
        ),
    ] = RootMotion.HIPS,
    loop: Annotated[
        bool,
        typer.Option("--loop", help="Write one cycle of steady walking, whose ends meet."),
    ] = False,
    unit: Annotated[FileUnit, typer.Option(help="Unit of a .bvh file.")] = FileUnit.METRES,
    detail: Annotated[BodyDetail, typer.Option(help="Mesh of the body.")] = BodyDetail.HIGH,
    threads: Annotated[int, typer.Option(help="Threads of the engine; 0: all cores.", min=0)] = 0,
    model: Annotated[
        Path, typer.Option(help="Folder of a motion model.", show_default="the shipped model")
    ] = DEFAULT_MODEL,
) -> None:
    """Let one person walk from the origin to goals in turn, and write the motion to a file.

    Goals are in metres: X to the right, Y ahead of a person at heading 0. Files have Y up and show
    that person's front, as glTF does: the goal 3,2 is at (-3, 0, 2) there, at (-3, -2) in Blender.

    wayfarer generate walk.glb --goal 3,2 --goal -1,4

    wayfarer generate cycle.glb --goal 0,12 --seconds 8 --loop --root in_place --fps 30

    wayfarer generate square.glb --people 8 --scene town_square --seconds 10
    """
    check_target(target)
    check_outfit(outfit)
    if outfit and character is not None:
        raise InvalidArgument("--outfit dresses the shipped body, not a --character", "outfit")
    options = FileOptions(format_of(target), names, fps, root, loop, unit, detail)
    beam = _beam(search, candidates, children, keep, hard)
    if people > 1 or scene:
        alone: dict[str, object] = {"goal": goal, "character": character, "gender": gender}
        alone |= {"height": height, "outfit": outfit, "speed": speed, "loop": loop, "search": beam}
        if given := [name for name, value in alone.items() if value]:
            raise InvalidArgument(f"--{given[0]} is for one person without a --scene", given[0])
        crowd = Crowd(people, seed)
        _generate_crowd(target, crowd, scene, seconds or NOBODY_GOES, options, model, threads)
        return
    own = None if character is None else read_character(character, options)
    gender, betas, scale = _body(gender, height, own)
    pace = math.sqrt(scale)  # times of a character of this scale by those of a person
    if speed is None:
        speed = SPEED * pace
    if abs(heading) > TURN:
        allowed = f"in radians, from {-TURN} to {TURN}"
        raise InvalidArgument(f"--heading must be {allowed}, not {heading:g}", "heading")
    goals = []
    for text in goal or []:
        x, y, z = _place(text)
        goals.append(Goal((x / scale, y / scale, z / scale), speed=speed / pace))
    if seconds is None and (beam or not goals):
        seconds = NOBODY_GOES
    length = None if seconds is None else seconds / pace
    spec = AgentSpec(gender=gender, betas=betas, heading=heading, noise_seed=seed)
    bundle = open_bundle(model, threads)
    world = bundle.world(1, Steering().with_search(candidates=candidates))
    with Progress(transient=True) as progress:
        task = progress.add_task("generating", total=length)

        def watch(done: float) -> None:
            progress.update(task, completed=done)

        if beam is None:
            clip = generate_clip(world, spec, goals, length, watch)
        else:
            [start] = world.prepare([spec])
            body = bundle.bodies[gender]
            clip = plan_clip(
                bundle.engine, body, spec, start, goals, length or NOBODY_GOES, beam, watch
            )
    if own is None:
        write_clip(target, clip, options, outfit)
    else:
        target.write_bytes(on_character(clip, own, options, target.stem, scale))
    reached = f", {clip.meta['goals_reached']} of {len(goals)} goals reached" if goals else ""
    times = [f"{pace * float(time):.1f}" for time in clip.meta.get("arrivals", "").split()]
    reached += f" (after {', '.join(times)} s)" if times else ""
    kept = ", of which the file has one cycle" if loop else ""
    size = f", for a character of {scale:.2f} times a person's size" if scale != 1.0 else ""
    typer.echo(f"{target}: {clip.frames} frames, {pace * clip.seconds:.1f} s{reached}{kept}{size}")


def _generate_crowd(
    target: Path,
    crowd: Crowd,
    scene: str,
    seconds: float,
    options: FileOptions,
    model: Path,
    threads: int,
) -> None:
    """Writes the file of several people. Raises InvalidArgument."""
    spec, scenes = scene_of(scene), SceneRegistry()
    scene_id = scenes.create(SceneSource(spec)).scene_id
    world = open_bundle(model, threads).world(crowd.count, Steering(), scenes)
    with Progress(transient=True) as progress:
        task = progress.add_task("generating", total=seconds)
        clips = crowd_clips(
            world, scene_id, crowd, seconds, lambda done: progress.update(task, completed=done)
        )
    target.write_bytes(encode(clips, options, target.stem, triangles(spec)))
    typer.echo(f"{target}: {len(clips)} of {crowd.count} people, {seconds:.1f} s")


def _body(
    gender: str | None, height: float | None, character: Character | None
) -> tuple[str, tuple[float, ...], float]:
    """Gender and betas of the person, and the character's scale. Raises InvalidArgument,
    NotFound.
    """
    fit = None if character is None else body_of(character, gender)
    scale = 1.0 if fit is None else fit.scale
    if height is not None:
        gender = gender or "female"
        return gender, tuple(betas_from_phenotype(gender, height)), scale
    if fit is not None:
        return fit.gender, fit.betas, scale
    return gender or "female", (0.0,) * BETAS, 1.0


def _beam(
    search: SearchKind, candidates: int | None, children: int | None, keep: int | None, hard: bool
) -> BeamSettings | None:
    """Settings of the tree search, or None for the search online. Raises InvalidArgument."""
    if search is SearchKind.ONLINE:
        _refuse(SearchKind.BEAM, children=children, keep=keep, hard=hard or None)
        return None
    _refuse(SearchKind.ONLINE, candidates=candidates)
    asked: dict[str, Any] = {"children": children, "keep": keep, "limits": HARD if hard else None}
    return BeamSettings(**{name: value for name, value in asked.items() if value is not None})


def _refuse(search: SearchKind, **options: object) -> None:
    """Given options that belong to another search."""
    for name, value in options.items():
        if value is not None:
            raise InvalidArgument(f"--{name} works with --search {search} only", name)


def _place(text: str) -> tuple[float, float, float]:
    """Text "3,2" → (3.0, 2.0, 0.0). Raises InvalidArgument."""
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise InvalidArgument(f"{text!r} is not a place; write X,Y, e.g. 3,-1.5", "goal") from None
    return x, y, 0.0
