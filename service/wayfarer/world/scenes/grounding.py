"""Sets sent agents of scenes on the floor there: slots and chunks to `ground.py`."""

import numpy as np

from wayfarer.navigation.scene import Scene
from wayfarer.world.agents.faults import check_finite
from wayfarer.world.agents.slots import Slots
from wayfarer.world.output.ground import Grounded, set_on_ground
from wayfarer.world.rows import Array, Index
from wayfarer.world.scenes.world_scenes import NOWHERE, WorldScenes
from wayfarer.world.stepping.playback import Sent


def ground(slots: Slots, scenery: WorldScenes, sent: Sent) -> None:
    """Raises the chunks of `sent` to the floors of their agents' scenes: all, or none on errors."""
    scenes = slots.scene[sent.slots]
    if not scenes.any():
        return
    translation, uneven = sent.chunks.translation, list[tuple[Index, Grounded]]()
    raised = np.zeros(len(scenes), np.float32)
    for number in np.unique(scenes[scenes != NOWHERE]).tolist():
        rows = np.flatnonzero(scenes == number)
        scene = scenery.scene(number)
        if is_level(scene):
            raised[rows] = scene.ground.layers[0].heights.level
        else:
            uneven.append((rows, _grounded(slots, scene, sent, rows)))
    check_finite("floors", raised)
    translation[..., 2] += raised[:, None]
    for rows, found in uneven:
        translation[rows], sent.chunks.rotations[rows] = found.translation, found.rotations
        slots.footing.put(sent.slots[rows], found.footing)


def is_level(scene: Scene) -> bool:
    """Whether the floor has one height everywhere."""
    heights = [layer.heights for layer in scene.ground.layers]
    return all(h.values is None and h.level == heights[0].level for h in heights)


def _grounded(slots: Slots, scene: Scene, sent: Sent, rows: Index) -> Grounded:
    chunks, agents = sent.chunks, sent.slots[rows]
    before = slots.footing.take(agents)

    def floor(points: Array) -> Array:
        """The height of the storey that each agent is on."""
        storey = np.broadcast_to(before.hips[:, None, None], (*points.shape[:2], 1))
        return scene.floor(np.concatenate([points, storey], -1))

    found = set_on_ground(
        before, slots.legs.take(agents), chunks.translation[rows], chunks.rotations[rows], floor
    )
    check_finite("frames on the ground", found.translation, found.rotations)
    return found
