"""The machine that times were measured on, and a unit of time that makes machines comparable."""

from __future__ import annotations

import os
import platform
import statistics
import time
from importlib import metadata
from pathlib import Path

import numpy as np
from scipy.linalg.lapack import dgesv

THREADS = "OMP_NUM_THREADS"


def machine() -> dict[str, str]:
    """Processor, cores, versions and load, as a table."""
    packages = ", ".join(f"{name} {metadata.version(name)}" for name in ("pin", "coal", "numpy", "scipy"))
    return {
        "processor": _processor(),
        "cores": f"{os.cpu_count()}, of which {os.environ.get(THREADS, 'all')} for linear algebra ({THREADS})",
        "load": ", ".join(f"{x:.2f}" for x in os.getloadavg()) + " over 1, 5 and 15 minutes at the start",
        "system": f"{platform.system()} {platform.release()}, Python {platform.python_version()}, {packages}",
    }


def _processor() -> str:
    info = Path("/proc/cpuinfo")
    if info.is_file():
        for line in info.read_text().splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


def solve_time(n: int = 20, calls: int = 500, repeats: int = 9) -> tuple[float, float]:
    """Processor time of one LAPACK solve, as a unit for times, and its noise.

    Args:
        n: size of the matrix.
        calls: solves timed together.
        repeats: of which the median is taken.

    Returns:
        Seconds per solve, and the spread of the repeats in parts of it [-].
    """
    rng = np.random.default_rng(0)
    A, b = np.asfortranarray(rng.normal(size=(n, n)) + n * np.eye(n)), rng.normal(size=n)
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        for _ in range(calls):
            dgesv(A, b)
        times.append((time.process_time() - begin) / calls)
    middle = statistics.median(times)
    return middle, (max(times) - min(times)) / middle
