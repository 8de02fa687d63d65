"""What Ray runs for a cluster: the directory, and a node on each machine. Ray starts these actors
again when their processes have ended.
"""

import asyncio
import contextlib
import faulthandler
import os
import pkgutil
import secrets
import select
import signal
import threading
import time
import warnings
import weakref
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeVar

import structlog

from wayfarer.cluster.directory import Directory, LeaseRules
from wayfarer.cluster.messages import CALL_S, NodeInfo, NodePlan
from wayfarer.cluster.node_lease import machine
from wayfarer.cluster.ray_settings import ray
from wayfarer.errors import Unavailable, WayfarerError
from wayfarer.process.logs import configure_logging

if TYPE_CHECKING:
    from wayfarer.cluster.node_agent import NodeAgent

log = structlog.get_logger(__name__)

T = TypeVar("T")

NAMESPACE: Final = "wayfarer"
DIRECTORY: Final = "directory"

ANSWER_S: Final = 1.5
"""Seconds to wait for an answer of the directory."""

HANGS_S: Final = 15.0
"""Seconds without a turn of the event loop after which a node that was ready ends."""

BEAT_S: Final = 1.0
PAUSE_S: Final = 5.0
"""Seconds before a node that has failed is started again."""


class _Actor:
    """One of Ray's actors, by its name."""

    def __init__(self, name: str, handle: Any = None) -> None:
        self._name = name
        self._handle = self._first = handle
        """Where Ray has it for this process alone, it ends once the first handle is let go."""
        self._finding = threading.Thread()

    async def ask(self, who: str, seconds: float, method: str, *told: Any) -> Any:
        """The answer of a method. Raises what the method raises.

        Raises Unavailable, with `who` in its text, without an answer: it may be done all the same.
        """
        try:
            async with asyncio.timeout(seconds):
                if self._handle is None:
                    self._handle = await on_daemon(lambda: ray.get_actor(self._name, NAMESPACE))
                asked = getattr(self._handle, method).remote(*told).future()
                return await asyncio.wrap_future(asked)
        except (TimeoutError, TypeError, ValueError, ray.exceptions.RayError) as error:
            cause = getattr(error, "cause", None)
            if isinstance(cause, WayfarerError):
                raise cause from None
            self._find_again()
            raise Unavailable(f"{who} does not answer ({type(error).__name__})") from None

    def _find_again(self) -> None:
        """Looks the actor up again: after a restart of Ray's head, earlier handles get no answers.

        It runs on a thread, since Ray waits for its head; the earlier handle is used meanwhile.
        """
        if not self._finding.is_alive():
            self._finding = threading.Thread(target=self._find, name=self._name, daemon=True)
            self._finding.start()

    def _find(self) -> None:
        with contextlib.suppress(ValueError, ray.exceptions.RayError):
            self._handle = ray.get_actor(self._name, NAMESPACE)


class RayLink:
    """The way to the directory's actor. Implements `DirectoryLink`."""

    def __init__(self, directory: Any) -> None:
        self._actor = _Actor(DIRECTORY, directory)

    @classmethod
    def find(cls) -> "RayLink":
        """Finds it by name: a handle from another process gets no answers. Raises Unavailable."""
        try:
            return cls(ray.get_actor(DIRECTORY, NAMESPACE))
        except (ValueError, ray.exceptions.RayError):
            raise Unavailable(
                "no directory runs on this Ray cluster; start it with `wayfarer cluster start`"
            ) from None

    async def call(self, verb: str, *told: Any) -> Any:
        """See `DirectoryLink`."""
        return await self._actor.ask("the directory", ANSWER_S, verb, *told)


class RayNodes:
    """The way to the nodes' actors. Implements `NodeLink`."""

    def __init__(self) -> None:
        self._actors: dict[str, _Actor] = {}  # by place: of all its lives

    async def call(self, node: NodeInfo, verb: str, *told: Any, seconds: float = CALL_S) -> Any:
        """See `NodeLink`."""
        place = node.name.rpartition("-")[0]
        actor = self._actors.setdefault(place, _Actor(place))
        return await actor.ask(f"node {node.name}", seconds, "call", node.name, verb, *told)


def watch(node: NodeInfo) -> Callable[[bool], bool]:
    """Returns a function that says whether its process has ended, if that can be seen from here.

    So nobody waits for the end of a lease, or until a busy machine has started the next process.
    Called with True, the function ends a process that is stopped (SIGSTOP), since the system would
    keep the connections of its clients open.
    """
    if not node.machine or node.machine != machine():
        return lambda forsaken: False
    try:
        process = os.pidfd_open(node.pid)
    except ProcessLookupError:
        return lambda forsaken: True
    poll = select.poll()
    poll.register(process, select.POLLIN)

    def has_ended(forsaken: bool) -> bool:
        with contextlib.suppress(OSError):  # it has just ended
            if forsaken and _is_stopped(node.pid):
                log.error("a stopped node is ended", node=node.name)
                signal.pidfd_send_signal(process, signal.SIGKILL)
        return bool(poll.poll(0))

    weakref.finalize(has_ended, os.close, process)
    return has_ended


def _is_stopped(pid: int) -> bool:
    """Whether the process is stopped. Raises OSError if it has ended."""
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


class DirectoryActor(Directory):
    """The directory of a cluster. After a restart it knows nothing until the nodes report."""

    def __init__(self, rules: LeaseRules) -> None:
        with warnings.catch_warnings(action="ignore"):  # Ray's, of what it calls itself
            again = ray.get_runtime_context().was_current_actor_reconstructed
        if again:
            rules = replace(rules, nodes=0)  # leases of the one before may hold
        super().__init__(rules, time.time_ns() // 1000, watch=watch)


class NodeActor:
    """A node: a whole server on a thread of this process, with its own event loop.

    Each life has a separate name. A node that hangs ends itself.
    """

    def __init__(self, plan: NodePlan, serve: str) -> None:
        """`serve`: "module:function", which runs the server of this node to its end.

        Ray calls this on the process's main thread, which alone gets signals.
        """
        self.plan = plan.model_copy(update={"name": f"{plan.name}-{secrets.token_hex(3)}"})
        self._place, self._serve = plan.name, serve
        configure_logging(plan.settings.log_level, plan.settings.log_format, node=self.plan.name)
        self._agent: NodeAgent | None = None
        self._started = Future[None]()
        self._ended = threading.Event()
        self._stopping = threading.Event()
        self._all_end = False
        self._tell_stop: Callable[[], Any] = lambda: None
        self._tell_reload: Callable[[], Any] = lambda: None
        signal.signal(signal.SIGTERM, lambda *_: self._ask_to_stop())
        signal.signal(signal.SIGHUP, lambda *_: self.reload())
        threading.Thread(target=self._run, name="node", daemon=True).start()

    # Methods for other processes; Ray calls each on one of its threads

    def until_ready(self) -> None:
        """Returns once the node takes calls. Raises what its start raised."""
        self._started.result()

    def stop(self) -> None:
        """Drains, and returns when the server has ended. No node adopts its sessions: all end."""
        self._all_end = True
        self._ask_to_stop()
        self._ended.wait()

    def reload(self) -> None:
        """Reads the keys again."""
        self._tell_reload()

    def call(self, name: str, verb: str, *told: Any) -> Any:
        """Calls a method of `NodeAgent` in the node's life of this name.

        Raises what the method raises, and Unavailable.
        """
        if name != self.plan.name or self._agent is None:
            raise Unavailable(f"node {name} has ended, or is starting or ending")
        work = getattr(self._agent, verb)(*told)
        return asyncio.run_coroutine_threadsafe(work, self._loop).result()

    # What its server calls, on its own thread

    def listen(self, stop: Callable[[], None], reload: Callable[[], None]) -> None:
        """Connects calls and signals with these functions, on the running event loop."""
        tell = asyncio.get_running_loop().call_soon_threadsafe
        self._tell_reload, self._tell_stop = partial(tell, reload), partial(tell, stop)
        if self._stopping.is_set():
            stop()

    @contextlib.asynccontextmanager
    async def joined(self, *server: Any) -> AsyncIterator[None]:
        """Makes the server a node of the cluster; see node_agent.py."""
        # with it comes the whole server: the directory, and what tells it that the life before has
        # ended, shall not wait for that
        from wayfarer.cluster.node_agent import joined

        self._loop = asyncio.get_running_loop()
        async with joined(RayLink.find(), RayNodes(), *server) as self._agent:
            yield
        self._agent = None

    def ready(self) -> None:
        """Notes that the node takes calls. If the event loop hangs from now on, the process ends.

        Before, nothing limits the time for compiling and loading.
        """
        self._started.set_result(None)
        loop = asyncio.get_running_loop()

        def beat() -> None:
            faulthandler.dump_traceback_later(HANGS_S, exit=True, file=2)
            loop.call_later(BEAT_S, beat)

        beat()

    def _ask_to_stop(self) -> None:
        self._stopping.set()
        with contextlib.suppress(RuntimeError):  # its loop is closed
            self._tell_stop()

    @staticmethod
    def _tell(verb: str, name: str) -> None:
        with contextlib.suppress(WayfarerError):  # then the lease's end is noticed
            asyncio.run(RayLink.find().call(verb, name))

    def _run(self) -> None:
        if self.plan.cores and hasattr(os, "sched_setaffinity"):
            os.sched_setaffinity(0, self.plan.cores)  # this thread, and threads that it starts
        try:
            self._tell("ended", self._place)
            pkgutil.resolve_name(self._serve)(self)
            faulthandler.cancel_dump_traceback_later()
        except Exception as error:
            if isinstance(error, WayfarerError):
                log.error("node ended", reason=str(error), again_in_s=PAUSE_S)
            else:
                log.exception("node ended", again_in_s=PAUSE_S)
            if not self._started.done():
                self._started.set_exception(error)
            self._ended.set()
            time.sleep(PAUSE_S)
            os._exit(1)
        self._ended.set()
        if not self._all_end:
            self._tell("ended", self.plan.name)
        # the node has ended as it was asked to: a later `cluster start` gives the machine a new one
        ray.kill(ray.get_runtime_context().current_actor, no_restart=True)


async def on_daemon(work: Callable[[], T]) -> T:
    """Runs work on a thread whose end the process does not wait for: Ray may never answer it."""
    done = Future[T]()
    done.set_running_or_notify_cancel()  # a call that cannot be stopped must not be cancelled

    def run_it() -> None:
        try:
            done.set_result(work())
        except Exception as error:
            done.set_exception(error)

    threading.Thread(target=run_it, name="Ray", daemon=True).start()
    return await asyncio.wrap_future(done)
