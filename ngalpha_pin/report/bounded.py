"""Work that ends after some time, whatever it is doing: a comparator that hangs does not hold up a report."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import TypeVar

Found = TypeVar("Found")
AGAIN = 1.0  # after so many seconds it is told once more, where the first time was swallowed


class OutOfTime(KeyboardInterrupt):
    """The time is over; work that keeps what it has on Ctrl-C does so now, and what it raises is the cause."""


def within(seconds: float, work: Callable[[], Found]) -> Found:
    """What the work returns.

    Only the main thread of a POSIX system can be told; elsewhere the work goes on until it ends by itself.

    Raises:
        OutOfTime: it takes longer than so many seconds.
    """
    told = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
    if not told or not 0.0 < seconds < 1e6:
        return work()

    told_at: list[bool] = []

    def stop(number: int, frame: FrameType | None) -> None:
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
