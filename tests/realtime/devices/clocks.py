"""A clock that the test advances, and waiting for a thread without a fixed sleep."""

import time


class Clock:
    def __init__(self, now=100.0):
        self.now = now

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.now += seconds


def until(condition, patience=5.0):
    """Wait until something holds, as long as a loaded machine may need; return whether it does."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.001)
    return False
