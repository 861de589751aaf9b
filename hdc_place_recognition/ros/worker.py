# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""A worker thread behind a queue of depth 1."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from threading import Condition, Thread
from typing import Generic, TypeVar

Item = TypeVar('Item')


class LatestWorker(Generic[Item]):
    """
    Processes the newest item; an item that still waits when the next arrives is dropped.

    :param work: called with each item, in the worker thread.
    :param failed: called if it raises an exception; the thread goes on.
    """

    def __init__(
        self,
        work: Callable[[Item], None],
        failed: Callable[[Exception], None] = lambda error: None,
    ) -> None:
        self._work, self._failed = work, failed
        self._changed = Condition()
        self._waiting: list[Item] = []
        self._busy = False
        self._stopped = False
        self._thread = Thread(target=self._run, name='place_recognition', daemon=True)
        self._thread.start()

    def put(self, item: Item) -> bool:
        """Hand over an item; return whether a waiting item was dropped."""
        with self._changed:
            dropped = bool(self._waiting)
            self._waiting = [item]
            self._changed.notify_all()
            return dropped

    def wait_idle(self, timeout_s: float) -> bool:
        """Wait until no item is left; return False on timeout."""
        with self._changed:
            return self._changed.wait_for(lambda: not (self._waiting or self._busy), timeout_s)

    def stop(self, timeout_s: float) -> None:
        """Drop the waiting item, and end the thread after the current one."""
        with self._changed:
            self._stopped, self._waiting = True, []
            self._changed.notify_all()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (item := self._next()) is not None:
            try:
                self._work(item)
            except Exception as error:
                with suppress(Exception):
                    self._failed(error)
            with self._changed:
                self._busy = False
                self._changed.notify_all()

    def _next(self) -> Item | None:
        """Wait for an item and return it; return None if the worker was stopped."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting or self._stopped)
            if self._stopped:
                return None
            self._busy = True
            return self._waiting.pop()
