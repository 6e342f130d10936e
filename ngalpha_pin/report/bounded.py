"""Work that ends after some time, whatever it is doing: a comparator that hangs does not hold up a report.

Time in which this thread waits for a processor does not count: a machine with other work makes a report take longer,
not lose its lines.
"""

from __future__ import annotations

import gc
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import TypeVar

Found = TypeVar("Found")
AGAIN = 1.0  # after so many seconds it is told once more, where the first time was swallowed
SOON = 1e-3  # seconds until it is told where it would be swallowed now
WEAK = ("weakref", "_weakrefset")  # modules whose functions run as things vanish
WAITED = Path("/proc/thread-self/schedstat")  # of Linux: what this thread has computed and waited [ns]


class Deadline:
    """The end of some seconds of work; work may also sleep, or compute in other threads.

    Args:
        seconds: until the end [s].
    """

    def __init__(self, seconds: float):
        self._clock, self._worked = time.perf_counter() + seconds, worked() + seconds

    def left(self) -> float:
        """Seconds to the end, negative after it [s]."""
        return self._worked - worked()

    def passed(self) -> bool:
        """Whether it is over; costs next to nothing before it can be."""
        return time.perf_counter() > self._clock and self.left() < 0.0


def worked() -> float:
    """Time on the clock [s], where the system tells it without what this thread has waited for a processor."""
    now = time.perf_counter()
    try:
        return now - 1e-9 * int(WAITED.read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return now


class OutOfTime(KeyboardInterrupt):
    """The time is over; work that keeps what it has on Ctrl-C does so now, and what it raises is the cause."""


def _swallowed(frame: FrameType | None) -> bool:
    """Whether what is raised here would be printed and lost: in finalizers and callbacks of the garbage collector."""
    callbacks = {getattr(callback, "__code__", None) for callback in gc.callbacks}
    while frame is not None:
        code = frame.f_code
        if code in callbacks or code.co_name == "__del__" or frame.f_globals.get("__name__") in WEAK:
            return True
        frame = frame.f_back
    return False


def within(seconds: float, work: Callable[[], Found]) -> Found:
    """What the work returns.

    Only the main thread of a POSIX system can be told; elsewhere the work goes on until it ends by itself.

    Raises:
        OutOfTime: it works longer than so many seconds.
    """
    told = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
    if not told or not 0.0 < seconds < 1e6:
        return work()

    told_at: list[bool] = []
    end = Deadline(seconds)

    def stop(number: int, frame: FrameType | None) -> None:
        if (left := end.left()) > 0.0 and not told_at:
            signal.setitimer(signal.ITIMER_REAL, left, AGAIN)
            return
        if _swallowed(frame):
            signal.setitimer(signal.ITIMER_REAL, SOON, AGAIN)
            return
        told_at.append(True)
        raise OutOfTime

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
        return work()
    except KeyboardInterrupt as error:
        if told_at and not isinstance(error, OutOfTime):
            raise OutOfTime from error
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
