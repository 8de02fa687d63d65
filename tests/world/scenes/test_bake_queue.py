"""Bakes in a separate process, and the life of that process."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import shapely

from tests.world.scenes.grounds import BOX, FIELD
from wayfarer.config.limits import Limits
from wayfarer.errors import InvalidArgument, ResourceExhausted, Unavailable
from wayfarer.navigation.examples import cubes_field, slope_with_steps, town_square, two_storeys
from wayfarer.navigation.scene import bake
from wayfarer.navigation.scene_spec import Box, Floor, MeshFile, SceneSpec
from wayfarer.world.scenes import bake_queue as module
from wayfarer.world.scenes.bake_queue import BakeQueue, BakeWorker

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals and limits of POSIX")

SIDE = 400.0
HUGE = SceneSpec(
    (Floor(((0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE))),),
    tuple(
        Box((SIDE / 2, SIDE / 2), (0.9 * SIDE, 0.02), 1.0, yaw=k * 0.0016)  # all across each other
        for k in range(1900)
    ),
)


@pytest.fixture
def make():
    made = []

    def one(**limits):
        made.append(BakeQueue(Limits(**limits)))
        return made[-1]

    yield one
    for bake_queue in made:
        bake_queue.stop()


@pytest.fixture(scope="module")
def bake_queue():
    shared = BakeQueue(Limits())
    yield shared
    shared.stop()


def whole(value):
    """Everything in a scene, for exact comparison."""
    if isinstance(value, np.ndarray):
        if value.dtype == object:
            return [whole(one) for one in value]
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, shapely.Geometry):
        return shapely.to_wkb(value, include_srid=True)
    if isinstance(value, shapely.STRtree):
        return whole(value.geometries)
    if isinstance(value, tuple | list):
        return [whole(one) for one in value]
    if hasattr(value, "__dataclass_fields__"):
        return type(value), {k: whole(getattr(value, k)) for k in value.__dataclass_fields__}
    return type(value), value if isinstance(value, int | float | str | bytes) else str(value)


def in_background(call):
    """A thread, and a list that receives its result or error."""
    found = []

    def run():
        try:
            found.append(call())
        except Exception as error:
            found.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, found


def until(condition, seconds=60.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def lives(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.parametrize("spec", [cubes_field(), town_square(), slope_with_steps(), two_storeys()])
def test_a_scene_is_bit_for_bit_what_a_bake_here_gives(bake_queue, spec):
    there, here = bake_queue.bake(spec), bake(spec)
    assert there.spec is spec
    assert whole(there) == whole(here)
    for layer, same in zip(there.ground.layers, here.ground.layers, strict=True):
        assert (layer.own is layer.ground) == (same.own is same.ground)
    crate = Box(there.mesh.corners[0].mean(0).tolist(), (0.5, 0.5), 1.0)
    assert whole(there.put("crate", crate)) == whole(here.put("crate", crate))


def test_a_scene_with_obstacles_can_be_pickled_and_still_cannot_be_changed():
    scene = bake(SceneSpec((FIELD,))).put("crate", BOX)
    other = pickle.loads(pickle.dumps(scene))
    assert whole(other) == whole(scene)
    with pytest.raises(TypeError):
        other.obstacles["more"] = BOX


def test_errors_keep_their_type_and_say_which_field(bake_queue):
    with pytest.raises(InvalidArgument, match="up axis") as caught:
        bake_queue.bake(SceneSpec((FIELD,), (Box((6.0, 6.0), (90.0, 90.0), 9.0, bottom=0.3),)))
    assert caught.value.field == "floors"
    with pytest.raises(InvalidArgument) as caught:
        bake_queue.bake(SceneSpec(mesh=MeshFile(b"no mesh", "glb")))
    assert caught.value.field == "mesh.data"
    pid = bake_queue.pid
    bake_queue.bake(cubes_field())
    assert bake_queue.pid == pid, "a scene that is refused costs no process"


def test_what_is_no_scene_at_all_is_our_own_mistake_and_costs_no_process(bake_queue):
    with pytest.raises(RuntimeError, match="AttributeError"):
        bake_queue.bake("no spec")
    assert bake_queue.bake(cubes_field()).islands == 1


def test_a_bake_that_takes_too_much_memory(make):
    bake_queue = make(bake_mb=300)
    with pytest.raises(ResourceExhausted, match=r"300 MB of memory \(limits.bake_mb\)"):
        bake_queue.bake(HUGE)
    assert bake_queue.bake(cubes_field()).islands == 1


def test_a_bake_that_keeps_a_processor_too_long(make):
    bake_queue = make(bake_s=2, bake_mb=8192)
    with pytest.raises(ResourceExhausted, match=r"more than 2 s .*\(limits.bake_s\): leave out"):
        bake_queue.bake(HUGE)
    assert bake_queue.bake(cubes_field()).islands == 1


def test_a_process_that_hangs_is_given_up(make):
    bake_queue = make(bake_s=2)
    bake_queue.bake(cubes_field())
    first = bake_queue.pid
    os.kill(first, signal.SIGSTOP)
    with pytest.raises(ResourceExhausted, match=r"limits\.bake_s"):
        bake_queue.bake(cubes_field())
    until(lambda: not lives(first))


@pytest.fixture
def baking(make):
    """A bake_queue in the middle of a bake, the waiting thread, and its result."""
    bake_queue = make(bake_s=600, bake_mb=8192)
    bake_queue.bake(cubes_field())
    thread, found = in_background(lambda: bake_queue.bake(HUGE))
    until(bake_queue._turn.locked)
    time.sleep(0.2)
    assert not found
    return bake_queue, thread, found


def test_a_process_killed_in_mid_bake_is_replaced(baking):
    bake_queue, thread, found = baking
    os.kill(bake_queue.pid, signal.SIGKILL)
    thread.join()
    assert isinstance(found[0], ResourceExhausted) and "signal 9" in str(found[0])
    assert bake_queue.bake(cubes_field()).islands == 1


def test_a_process_killed_between_bakes_is_replaced_unnoticed(bake_queue):
    bake_queue.bake(cubes_field())
    pid = bake_queue.pid
    os.kill(pid, signal.SIGKILL)
    os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)  # on a busy machine it takes a while to die
    assert bake_queue.bake(cubes_field()).islands == 1
    assert bake_queue.pid != pid


def test_stopping_ends_the_bake_under_way_and_those_after_it(baking):
    bake_queue, thread, found = baking
    pid = bake_queue.pid
    bake_queue.stop()
    thread.join()
    assert isinstance(found[0], Unavailable)
    assert not lives(pid)
    with pytest.raises(Unavailable, match="stopping"):
        bake_queue.bake(cubes_field())


def test_two_at_once_take_turns_in_one_process(bake_queue):
    both = [
        in_background(lambda s=spec: bake_queue.bake(s)) for spec in (cubes_field(), town_square())
    ]
    for thread, _ in both:
        thread.join()
    assert [found[0].content_hash for _, found in both] == [
        cubes_field().content_hash,
        town_square().content_hash,
    ]


def test_a_process_that_does_not_start_is_told(make, monkeypatch):
    monkeypatch.setattr(module, "COMMAND", (sys.executable, "-c", "raise SystemExit(3)"))
    with pytest.raises(Unavailable, match="exit code 3"):
        make().bake(cubes_field())


def test_no_process_is_left_when_its_parent_is_killed():
    """Neither one that waits nor one that bakes."""
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE)
    pids = [int(pid) for pid in parent.stdout.readline().split()]
    time.sleep(0.3)
    assert len(pids) == 2 and all(map(lives, pids))
    parent.kill()
    parent.wait()
    parent.stdout.close()
    until(lambda: not any(map(lives, pids)), 10.0)


PARENT = """
from wayfarer.world.scenes.bake_queue import BakeQueue
from wayfarer.config.limits import Limits
from wayfarer.navigation.examples import cubes_field
from tests.world.scenes.test_bake_queue import HUGE
idle, busy = (BakeQueue(Limits(bake_s=600, bake_mb=8192)) for _ in range(2))
idle.bake(cubes_field())
busy.bake(cubes_field())
print(idle.pid, busy.pid, flush=True)
busy.bake(HUGE)
"""


def test_runs_at_low_priority(bake_queue):
    bake_queue.bake(cubes_field())
    mine = os.getpriority(os.PRIO_PROCESS, 0)
    assert os.getpriority(os.PRIO_PROCESS, bake_queue.pid) == min(mine + 10, 19)


def test_nothing_printed_is_taken_for_an_answer():
    worker = BakeWorker((sys.executable, "-c", NOISY))
    try:
        assert worker.await_answer(60.0) is True
        assert worker.ask(cubes_field(), 60.0).islands == 1
    finally:
        worker.kill()


NOISY = """
from wayfarer.world.scenes import bake_process
bake = bake_process.bake
def noisy(spec):
    print("a library says something")
    return bake(spec)
bake_process.bake = noisy
bake_process.main(1024, 20.0)
"""
