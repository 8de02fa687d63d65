"""Ray for a cluster: start it, find it, have its actors (actors.py) run, leave it."""

import asyncio
import atexit
import contextlib
import socket
import sys
import tempfile
import threading
import traceback
from typing import Any, Final

import structlog

from wayfarer.cluster.actors import DIRECTORY, NAMESPACE, DirectoryActor, NodeActor, RayLink
from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.messages import NodePlan
from wayfarer.cluster.ray_settings import NodeAffinitySchedulingStrategy, ray
from wayfarer.errors import Unavailable

log = structlog.get_logger(__name__)

LOCAL_ADDRESS: Final = "127.0.0.2"
"""Address of Ray on one machine: at 127.0.0.1 its start never ends."""

OBJECT_BYTES: Final = 80 * 1024 * 1024
"""Ray's minimum: nothing is kept in its store."""

STARTS: Final = 4
"""The number of cores given to Ray: it starts as many processes at a time."""

LEAVE_S: Final = 8.0
"""Ray is left within 2 s; within 7 s if its head has ended, and never if its head hangs."""

TRIES: Final = 2
"""Starts of a local Ray, which gives up after 30 s on a busy machine."""

FIND_S: Final = 3.0
"""Seconds for a connection to Ray's head, before Ray itself looks for it."""

GRACE_S: Final = 5.0
"""Seconds beyond the maximum time of a drain."""

CALLS: Final = 16
"""Calls that a node answers at a time, each on a thread."""

FOREVER: Final = -1
ALIVE: Final = 0  # of GcsNodeInfo.GcsNodeState


class RayCluster:
    """A cluster of Ray. Its methods block, so they are not called on an event loop."""

    def __init__(self, address: str = "") -> None:
        """`address`: of a Ray cluster; empty: a Ray on this machine that ends with this object.

        Raises Unavailable.
        """
        self._own = not address
        self._nodes: dict[str, Any] = {}
        self._drain_s = 0.0
        self._folder = contextlib.ExitStack()
        if address:
            _find(address)
        for tries_left in reversed(range(TRIES if self._own else 1)):
            try:
                self._init(address)
                break
            except Exception as error:  # many kinds: also of tokens, and of slow machines
                _end_processes(error)
                self._folder.close()
                if not tries_left:
                    where, told = address or "this machine", (str(error).splitlines() or [""])[-1]
                    raise Unavailable(f"no Ray cluster at {where}: {told}") from None
                ray.shutdown()
        self._head = ray.get_runtime_context().gcs_address
        self.logs: str = _worker().node.get_logs_dir_path()
        """Folder of what this machine's actors write."""

    def _init(self, address: str) -> None:
        common: dict[str, Any] = {"namespace": NAMESPACE, "configure_logging": False}
        if address:
            ray.init(address, log_to_driver=False, **common)
            return
        ray.init(
            "local",
            num_cpus=STARTS,
            _node_ip_address=LOCAL_ADDRESS,
            _temp_dir=self._folder.enter_context(_folder()),
            include_dashboard=False,
            object_store_memory=OBJECT_BYTES,
            **common,
        )
        outputs = ray._private.ray_logging.global_worker_stdstream_dispatcher
        outputs.remove_handler("ray_print_logs")  # which writes a prefix before each line
        outputs.remove_handler("wayfarer")  # of a Ray before
        outputs.add_handler("wayfarer", _print)

    def directory(self, rules: LeaseRules) -> RayLink:
        """Starts the directory, unless it runs. Raises Unavailable."""
        if not self._own and _runs(DIRECTORY):
            log.info("directory runs already, with the lease that it was started with")
            return RayLink.find()
        # with a CPU, so that it is never on the head, with which it would be away
        options = self._life() | {"num_cpus": 0.01}
        actor = ray.remote(DirectoryActor).options(name=DIRECTORY, **options)
        return RayLink(actor.remote(rules))

    def head_answers(self) -> bool:
        """Whether something listens at Ray's head. If nothing does, this process stops reading the
        logs and errors, since Ray's threads would ask an absent head again without any pause.
        """
        try:
            _find(self._head)
        except Unavailable:
            _worker().threads_stopped.set()
            return False
        return True

    def machines(self) -> dict[str, str]:
        """Ray's nodes that may work: address by id. Raises Unavailable."""
        try:  # `ray.nodes()` ends this process where a new head has forgotten the old one's state
            found = _worker().gcs_client.get_all_node_info(timeout=FIND_S)
        except ray.exceptions.RayError as error:
            raise Unavailable(f"Ray's head does not tell its machines: {error}") from None
        return {
            one.hex(): told.node_manager_address
            for one, told in found.items()
            if told.state == ALIVE and told.resources_total.get("CPU", 0) > 0
        }

    def keep(self, plan: NodePlan, serve: str, machine: str = "") -> None:
        """Has a node run, unless one does. `serve`: see `NodeActor`. `machine`: Ray's id; empty:
        any.
        """
        if plan.name in self._nodes:
            return
        options = self._life()
        if machine:
            options["scheduling_strategy"] = NodeAffinitySchedulingStrategy(machine, soft=False)
        actor = ray.remote(NodeActor).options(name=plan.name, max_concurrency=CALLS, **options)
        if not self._own and _runs(plan.name):
            log.info("a node runs already; drain it to change its options", node=plan.name)
        self._nodes[plan.name] = actor.remote(plan, serve)
        self._drain_s = plan.settings.drain_s

    async def until_ready(self) -> None:
        """Waits until all nodes are ready. Raises Unavailable as soon as one ends before."""

        async def until(number: int, node: Any) -> None:
            try:
                await asyncio.wrap_future(node.until_ready.remote().future())
            except ray.exceptions.RayError as error:
                why = getattr(error, "cause", error)
                raise Unavailable(f"node {number} ended while it was starting: {why}") from None

        await asyncio.gather(*(until(*one) for one in enumerate(self._nodes.values())))

    def reload(self) -> None:
        """Asks all nodes to read their keys again."""
        for node in self._nodes.values():
            node.reload.remote()

    def close(self) -> None:
        """Leaves Ray, whether it answers or not. If it started Ray, Ray ends after the nodes have
        drained.
        """
        if self._own and self._nodes:
            asked = {node.stop.remote(): name for name, node in self._nodes.items()}
            patience = 2 * self._drain_s + GRACE_S
            _, late = ray.wait(list(asked), num_returns=len(asked), timeout=patience)
            if late:
                log.error("nodes killed: they did not end", nodes=[asked[one] for one in late])
        processes = ray._private.worker._global_node
        leaving = threading.Thread(target=ray.shutdown, name="leave Ray", daemon=True)
        leaving.start()
        leaving.join(LEAVE_S)
        if leaving.is_alive():
            atexit.unregister(ray.shutdown)  # which Ray has put there, and would wait, too
            if self._own and processes is not None:
                processes.kill_all_processes(check_alive=False, allow_graceful=False)
        self._folder.close()

    def _life(self) -> dict[str, Any]:
        """Options of an actor: it needs no core, is started again, and is one of its name."""
        life = {} if self._own else {"lifetime": "detached"}
        return {"num_cpus": 0, "max_restarts": FOREVER, "get_if_exists": True, **life}


def _end_processes(failure: Exception) -> None:
    """Ends what a start that failed has left: Ray itself does so at the end of this process."""
    for frame, _ in traceback.walk_tb(failure.__traceback__):
        made = frame.f_locals.get("self")
        if isinstance(made, ray._private.node.Node):
            made.kill_all_processes(check_alive=False, allow_graceful=True)  # with what it began


def _folder() -> tempfile.TemporaryDirectory[str]:
    """A folder for Ray's files. Its path is short, since sockets lie in it."""
    return tempfile.TemporaryDirectory(prefix="wf", dir="/tmp", ignore_cleanup_errors=True)


def _print(data: dict[str, Any]) -> None:
    """Prints the lines that an actor has written; Ray's own lines stay in its files."""
    if data.get("actor_name"):
        print(
            *data["lines"], sep="\n", file=sys.stderr if data["is_err"] else sys.stdout, flush=True
        )


def _worker() -> Any:
    """Ray's own state of this process; that it offers no other way is seen in tests."""
    return ray._private.worker.global_worker


def _runs(name: str) -> bool:
    """Whether an actor of this name is there."""
    try:
        ray.get_actor(name)
    except ValueError:
        return False
    return True


def _find(address: str) -> None:
    """Raises Unavailable at once where nothing listens: Ray itself tries for minutes."""
    host, _, port = address.rpartition(":")
    if "://" in host or not (host and port.isdecimal()):  # as `auto`
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), FIND_S).close()
    except OSError as error:
        raise Unavailable(f"no Ray cluster at {address}: {error.strerror or error}") from None
