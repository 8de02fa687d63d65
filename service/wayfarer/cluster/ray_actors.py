"""The cluster's processes on Ray: the directory, and a keeper on each machine. Ray only here.

Ray starts these actors, watches them and starts them again; between them go two texts a call
(directory_service.py). Nodes are processes of their own, which know nothing of Ray.
"""

import asyncio
import atexit
import contextlib
import hashlib
import os
import signal
import socket
import sys
import threading
from collections.abc import Collection
from typing import Any, Final

# Before Ray is imported; a Ray that `ray start` makes needs the last two, too (docs/cluster.md).
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # no call home
os.environ.setdefault("RAY_DEDUP_LOGS", "0")  # else it swallows lines of nodes that look alike
if sys.platform == "linux":  # nodes drain without their keepers (`RayCluster.close`)
    os.environ.setdefault("RAY_kill_child_processes_on_worker_exit", "0")
# in seconds: after a minute without Ray's head, Ray ends who waits for it; but entries find what
# lives, and keepers have their nodes, without a head
os.environ.setdefault("RAY_gcs_rpc_server_reconnect_timeout_s", "604800")
os.environ.setdefault("RAY_worker_niceness", "0")  # else all nodes give way to everything (15)

import ray
import structlog
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from wayfarer.cluster.directory import LeaseRules
from wayfarer.cluster.directory_service import DirectoryService
from wayfarer.cluster.keeper import NodeKeeper
from wayfarer.cluster.messages import NodePlan
from wayfarer.cluster.process_tree import adopt_orphans, descendants, end_descendants
from wayfarer.errors import InvalidArgument, Unavailable
from wayfarer.logs import configure_logging

log = structlog.get_logger(__name__)

NAMESPACE: Final = "wayfarer"
DIRECTORY: Final = "directory"
LOCAL_ADDRESS: Final = "127.0.0.2"
"""Of Ray on one machine: at 127.0.0.1 it waits for ever."""

OBJECT_BYTES: Final = 80 * 1024 * 1024
"""Ray's least: nothing is kept in its store."""

STARTS: Final = 4
"""Ray starts as many processes at a time as it is told that there are cores."""

START_S: Final = 30.0
"""For the first answer of the directory, which may be starting."""

CALL_S: Final = 1.5
LEAVE_S: Final = 3.0
"""Ray is left within 2 s; within 7 s if its head has ended, and never if its head hangs."""

FIND_S: Final = 3.0
"""For a connection to Ray's head, before Ray itself looks for it."""

GRACE_S: Final = 5.0
"""Beyond what a node takes at most to drain."""

FOREVER: Final = -1
ALIVE: Final = 0  # of GcsNodeInfo.GcsNodeState


class RayLink:
    """To the directory's actor."""

    def __init__(self, directory: Any) -> None:
        self._directory = self._first = directory
        """Where Ray has it for this process alone, it ends once the first handle is let go."""
        self._finding = threading.Thread()

    async def call(self, method: str, body: str) -> str:
        """See `DirectoryLink`."""
        try:
            asked = self._directory.answer.remote(method, body).future()
            answer: str = await asyncio.wait_for(asyncio.wrap_future(asked), CALL_S)
        except (TimeoutError, ray.exceptions.RayError) as error:
            self._find_again()
            raise Unavailable(f"the directory does not answer ({type(error).__name__})") from None
        return answer

    def _find_again(self) -> None:
        """If Ray has started it again, and its head as well, an earlier handle gets no answer ever.

        It runs on a thread, since Ray waits for its head.
        """
        if not self._finding.is_alive():
            self._finding = threading.Thread(target=self._find, name="directory", daemon=True)
            self._finding.start()

    def _find(self) -> None:
        with contextlib.suppress(ValueError, ray.exceptions.RayError):
            self._directory = ray.get_actor(DIRECTORY)


class DirectoryActor:
    """One for a cluster. Started again, it knows nothing, and is told by the nodes."""

    def __init__(self, rules: LeaseRules, digest: str) -> None:
        """`digest`: of the cluster's secret, which this process need not know."""
        self._service = DirectoryService(rules)
        self._digest = digest

    def digest(self) -> str:
        """Of the secret that the cluster was started with."""
        return self._digest

    def answer(self, method: str, body: str) -> str:
        """See `DirectoryService`."""
        return self._service.answer(method, body)


class KeeperActor:
    """Keeps a node on its machine; if this actor ends, its node ends, too."""

    def __init__(self, plan: str) -> None:
        """The directory is found by its name: a handle of it, sent here, gets no answers."""
        told = NodePlan.model_validate_json(plan)
        configure_logging(told.settings.log_level, told.settings.log_format)
        self._keeper = NodeKeeper(told, RayLink(ray.get_actor(DIRECTORY)))
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="keeper", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        self._loop.run_until_complete(self._keeper.keep())
        # its node has ended of its own will: who covers this machine again gets a new keeper
        ray.kill(ray.get_runtime_context().current_actor, no_restart=True)


class RayCluster:
    """The actors, as one who may start them sees them. Calls of Ray block: not on an event loop."""

    def __init__(self, secret: str, address: str = "") -> None:
        """`address`: of a Ray cluster; empty: one of its own on this machine, which ends with it.
        `secret`: what the cluster's nodes show each other.

        Raises Unavailable.
        """
        self._digest = hashlib.sha256(secret.encode()).hexdigest()
        self._own = not address
        self._others: Collection[int] = ()  # children of this process that are not Ray's
        self._keepers: dict[str, Any] = {}
        self._drain_s = 0.0
        if address:
            _find(address)
        common: dict[str, Any] = {"namespace": NAMESPACE, "configure_logging": False}
        try:
            if self._own:
                adopt_orphans()
                self._others = descendants()
                ray.init(
                    "local",
                    num_cpus=STARTS,
                    _node_ip_address=LOCAL_ADDRESS,
                    include_dashboard=False,
                    object_store_memory=OBJECT_BYTES,
                    **common,
                )
            else:
                ray.init(address, log_to_driver=False, **common)
        except Exception as error:  # Ray raises many kinds: also of tokens, and of slow machines
            where, told = address or "this machine", (str(error).splitlines() or [""])[-1]
            raise Unavailable(f"no Ray cluster at {where}: {told}") from None
        self._head = ray.get_runtime_context().gcs_address

    def directory(self, rules: LeaseRules) -> RayLink:
        """Start it, unless it runs. Raises InvalidArgument, Unavailable."""
        if not self._own and _runs(DIRECTORY):
            log.info("directory runs already, with the lease that it was started with")
            return self.find_directory()
        actor = ray.remote(DirectoryActor).options(name=DIRECTORY, **self._life())
        return RayLink(actor.remote(rules, self._digest))

    def find_directory(self) -> RayLink:
        """The one that runs. Raises Unavailable; InvalidArgument where its secret is another."""
        try:
            found = ray.get_actor(DIRECTORY)
        except ValueError:
            raise Unavailable(
                "no directory runs on this Ray cluster; start it with `wayfarer cluster start`"
            ) from None
        try:
            digest: Any = ray.get(found.digest.remote(), timeout=START_S)
        except ray.exceptions.RayError as error:
            raise Unavailable(f"the directory does not answer ({type(error).__name__})") from None
        if digest != self._digest:
            raise InvalidArgument(
                "WF_CLUSTER_SECRET differs from that which the cluster was started with"
            )
        return RayLink(found)

    def head_answers(self) -> bool:
        """Whether somebody listens at Ray's head. When nobody does, this process reads its logs and
        errors no more, because Ray's threads would ask an absent head again without any pause.
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

    def keep(self, plan: NodePlan, machine: str = "") -> None:
        """Have a node kept, unless it is. `machine`: Ray's id; empty: any."""
        if plan.name in self._keepers:
            return
        options = self._life()
        if machine:
            options["scheduling_strategy"] = NodeAffinitySchedulingStrategy(machine, soft=False)
        actor = ray.remote(KeeperActor).options(name=plan.name, **options)
        if not self._own and _runs(plan.name):
            log.info(
                "a node runs already, with the options that it was started with; drain it to give "
                "it others",
                node=plan.name,
            )
        self._keepers[plan.name] = actor.remote(plan.model_dump_json())
        self._drain_s = plan.settings.drain_s

    def close(self) -> None:
        """Leave Ray, whether it answers or not; end Ray and the nodes if they are its own.

        Ray ends first: then nobody starts a node again. No call of Ray ends the nodes: while its
        head is away, calls of actors that were started again get no answer. Call it on the main
        thread; it ignores SIGINT and SIGTERM from then on.
        """
        for sign in (signal.SIGINT, signal.SIGTERM):  # a second one would leave nodes behind
            signal.signal(sign, signal.SIG_IGN)
        leaving = threading.Thread(target=ray.shutdown, name="leave Ray", daemon=True)
        leaving.start()
        leaving.join(LEAVE_S)
        if self._own:
            end_descendants(2 * self._drain_s + GRACE_S, self._others)
        leaving.join(LEAVE_S)  # a head that hung has been killed
        if leaving.is_alive():
            log.warning("Ray's head does not answer; it is not waited for")
            atexit.unregister(ray.shutdown)  # which Ray has put there, and would wait, too

    def _life(self) -> dict[str, Any]:
        """Options of an actor: it needs no core, is started again, and is one of its name."""
        life = {} if self._own else {"lifetime": "detached"}
        return {"num_cpus": 0, "max_restarts": FOREVER, "get_if_exists": True, **life}


def _worker() -> Any:
    """Ray's own state of this process; that it offers no other way is seen in tests."""
    return ray._private.worker.global_worker


def _runs(name: str) -> bool:
    """An actor of this name is there."""
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
