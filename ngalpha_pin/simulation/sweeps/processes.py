"""Processes of this machine as an executor; one that ends takes only its own call with it."""

from __future__ import annotations

import pickle
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection
from typing import Any

from tqdm import tqdm

from ngalpha_pin.common import checks
from ngalpha_pin.errors import NgalphaError

READY = "ready"


class WorkerLost(NgalphaError):
    """The process of a call was ended: killed, out of memory, or by a fault in compiled code."""


class NotStarted(NgalphaError):
    """A process could not be started."""


class Processes(Executor):
    """Processes that make one call after the other, each started afresh (spawn).

    A process that is ended fails the call it was at, with `WorkerLost`; another one takes its place. Those of
    `concurrent.futures.ProcessPoolExecutor` fail all calls together and say not which of them it was.

    Args:
        n: how many; None is one for each core this process may use.
    """

    def __init__(self, n: int | None = None):
        n = checks.cores() if n is None else n
        self._threads = ThreadPoolExecutor(n, "ngalpha-pin worker")
        self._own, self._lock = threading.local(), threading.Lock()
        self._workers: set[_Worker] = set()
        self._ended = False

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Have a function called in a process; function, arguments and result are pickled."""
        return self._threads.submit(self._call, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes when they have made their calls."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            self.kill()

    def kill(self) -> None:
        """End the processes now; calls that have begun fail, others are cancelled."""
        with self._lock:
            self._ended = True
            for worker in self._workers:
                worker.process.kill()
        self._threads.shutdown(cancel_futures=True)

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        """What an exception leaves behind is not waited for."""
        self.kill() if kind is not None else self.shutdown()

    def _call(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        worker = getattr(self._own, "worker", None)
        if worker is None:
            worker = self._own.worker = self._started()
        try:
            return worker.call(pickle.dumps((fn, args, kwargs)))
        except WorkerLost:
            del self._own.worker
            with self._lock:
                self._workers.discard(worker)
            raise

    def _started(self) -> _Worker:
        with self._lock:
            if self._ended:
                raise WorkerLost("the processes have been ended")
            worker = _Worker()
            self._workers.add(worker)
        worker.expect_ready()
        return worker


class _Worker:
    """A process and this end of the line to it."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self._line, there = context.Pipe()
        self.process = context.Process(target=_serve, args=(there,), daemon=True)
        self.process.start()
        there.close()  # so that the end of the process is the end of the line

    def expect_ready(self) -> None:
        try:
            self._line.recv()
        except (EOFError, OSError) as error:
            raise NotStarted(
                "a process for the runs ended before it was ready; a script must have the lines that start runs under "
                "if __name__ == '__main__':, since each process imports it"
            ) from error

    def call(self, what: bytes) -> Any:
        try:
            self._line.send_bytes(what)
            good, result = pickle.loads(self._line.recv_bytes())
        except (EOFError, OSError) as error:
            self.process.join()
            raise WorkerLost(f"the process of this run was ended ({_reason(self.process.exitcode)})") from error
        if not good:
            raise result
        return result


def _reason(code: int | None) -> str:
    if code is not None and code < 0:
        return f"signal {signal.Signals(-code).name}"
    return f"exit code {code}"


def _serve(line: Connection) -> None:
    """What a process does: one call after the other, until the line ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started this one
    tqdm.set_lock(threading.RLock())  # bars of its own; tqdm's lock between processes outlives one that is killed
    line.send(READY)
    while True:
        try:
            what = line.recv_bytes()
        except (EOFError, OSError):
            return
        try:
            fn, args, kwargs = pickle.loads(what)
            answer = pickle.dumps((True, fn(*args, **kwargs)))
        except Exception as error:
            answer = pickle.dumps((False, _sent(error)))
        with suppress(ConnectionError):
            line.send_bytes(answer)


def _sent(error: Exception) -> Exception:
    """The error, or its words where it cannot be sent."""
    try:
        pickle.loads(pickle.dumps(error))
        return error
    except Exception:
        return NgalphaError(f"{type(error).__name__}: {error}")
