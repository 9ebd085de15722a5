"""A limit on the time that a piece of Python may take, in any thread."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from asperity.errors import AsperityError


class _TimeIsOver(BaseException):
    """Raised in the thread whose time is over; no `except Exception` of its code stops it."""


@contextmanager
def time_limit(seconds: float | None) -> Iterator[None]:
    """Raise `AsperityError` in the block when it has taken longer than so many seconds.

    It is raised between two instructions of Python: compiled code that never returns is not
    interrupted. Workers of Dask run their tasks outside the main thread, where signals, which would
    do, are not to be had.

    Parameters
    ----------
    seconds : float, optional
        None: no limit.
    """
    if seconds is None:
        yield
        return
    thread, lock, over = ctypes.c_ulong(threading.get_ident()), threading.Lock(), False

    def end() -> None:
        with lock:
            if not over:
                ctypes.pythonapi.PyThreadState_SetAsyncExc(thread, ctypes.py_object(_TimeIsOver))

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        try:
            yield
        finally:
            timer.cancel()
            with lock:
                over = True
    except _TimeIsOver:
        raise AsperityError(f"took longer than the limit of {seconds:g} s") from None
