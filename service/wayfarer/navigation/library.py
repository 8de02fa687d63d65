"""Baked scenes by content: the same geometry is baked once, whoever asks."""

from collections import OrderedDict
from concurrent.futures import Future
from threading import Lock
from typing import Final

from wayfarer.navigation.scene import Scene, bake
from wayfarer.navigation.spec import SceneSpec

KEPT: Final = 32
"""Scenes kept; the one asked for longest ago goes first (sessions that use it keep it alive)."""


class SceneLibrary:
    """A bounded, thread-safe cache of scenes at version 0."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._scenes: OrderedDict[str, Future[Scene]] = OrderedDict()
        self._lock = Lock()

    def get(self, spec: SceneSpec) -> Scene:
        """The baked scene; who asks while another bakes it waits for that bake.

        Raises InvalidArgument; a scene that failed is not kept.
        """
        key = spec.content_hash
        with self._lock:
            found = self._scenes.get(key)
            mine = Future[Scene]() if found is None else None
            if mine is not None:
                self._scenes[key] = mine
                while len(self._scenes) > self._kept:
                    self._scenes.popitem(last=False)
            self._scenes.move_to_end(key)
        if found is not None:
            return found.result()
        assert mine is not None
        try:
            mine.set_result(bake(spec))
        except BaseException as error:
            with self._lock:
                if self._scenes.get(key) is mine:
                    del self._scenes[key]
            mine.set_exception(error)
        return mine.result()

    def __len__(self) -> int:
        """Scenes kept now."""
        with self._lock:
            return len(self._scenes)
