# Copyright 2026 hdc_place_recognition contributors
# SPDX-License-Identifier: Apache-2.0
"""The worker thread: newest wins, drops are told, nothing is left behind."""

from threading import Event

from hdc_place_recognition.ros.worker import LatestWorker

SOON_S = 5.0


def test_works_in_order_when_there_is_time():
    done: list[int] = []
    worker = LatestWorker(done.append)
    for item in range(5):
        assert not worker.put(item)
        assert worker.wait_idle(SOON_S)
    worker.stop(SOON_S)
    assert done == [0, 1, 2, 3, 4]


def test_newest_wins_while_busy():
    started, go_on = Event(), Event()
    done: list[int] = []

    def work(item: int) -> None:
        started.set()
        assert go_on.wait(SOON_S)
        done.append(item)

    worker = LatestWorker(work)
    assert not worker.put(0)
    assert started.wait(SOON_S)
    assert [worker.put(item) for item in (1, 2, 3)] == [False, True, True]
    assert not worker.wait_idle(0.01)
    go_on.set()
    assert worker.wait_idle(SOON_S)
    worker.stop(SOON_S)
    assert done == [0, 3]


def test_stop_drops_what_waits_and_ends_the_thread():
    started, go_on = Event(), Event()
    done: list[int] = []

    def work(item: int) -> None:
        started.set()
        assert go_on.wait(SOON_S)
        done.append(item)

    worker = LatestWorker(work)
    worker.put(0)
    assert started.wait(SOON_S)
    worker.put(1)
    worker.stop(0.01)
    go_on.set()
    worker.stop(SOON_S)
    assert done == [0]
    assert not worker._thread.is_alive()


def test_an_error_is_handed_over_and_the_thread_goes_on():
    errors: list[Exception] = []
    done: list[int] = []

    def work(item: int) -> None:
        done.append(10 // item)

    def failed(error: Exception) -> None:
        errors.append(error)
        raise RuntimeError('cannot even be counted')

    worker = LatestWorker(work, failed)
    for item in (5, 0, 2):
        worker.put(item)
        assert worker.wait_idle(SOON_S)
    worker.stop(SOON_S)
    assert done == [2, 5]
    assert [type(error) for error in errors] == [ZeroDivisionError]
