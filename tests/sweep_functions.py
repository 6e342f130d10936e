"""What the tests of sweeps run, in processes that find this module."""

import os
import signal
import time
from multiprocessing.synchronize import SemLock
from pathlib import Path

import numpy as np

import ngalpha_pin as nga
from ngalpha_pin import robots


def ball(mu, height):
    """A short run of a ball that bounces, slips and rolls."""
    scene, q0, v0 = robots.load("rotating_ball", mu=mu, height=height)
    run = nga.simulate(scene, q0, v0, t_end=0.4, dt=5e-3)
    return {"x": run.q[-1, 0], "impacts": len(run.impacts.t), "q": run.q[-1], "slips": mu < 0.2, "end": run.message}


def made(folder):
    """Something that is slow to make: a scene; leaves a trace of each time."""
    (Path(folder) / f"made-{os.getpid()}-{len(os.listdir(folder))}").touch()
    return robots.load("rotating_ball")[0]


def contacts(scene, mu):
    """Changes its scene, which the next cell must not see."""
    scene.contacts = [*scene.contacts, *scene.varied(mu=mu).contacts]
    return [pair.law.mu for pair in scene.contacts]


def dangerous(x, folder):
    """The process of 1 is killed once, 3 is an error; counts the calls of each."""
    seen = Path(folder) / f"{x}"
    tries = len(list(seen.parent.glob(f"{x}-*")))
    (seen.parent / f"{x}-{tries}").touch()
    if x == 1 and tries == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    if x == 3:
        raise nga.SceneError("no\nsuch thing")
    return x**2


def square(x):
    """A result that costs nothing."""
    return x**2


def semaphores_of_a_run():
    """How many semaphores of the system a run makes: one that is killed leaves them, and Python warns at the end."""
    made, init = [], SemLock.__init__
    SemLock.__init__ = lambda self, *args, **options: (made.append(self), init(self, *args, **options))[1]
    scene, q0, v0 = robots.load("rotating_ball")
    nga.simulate(scene, q0, v0, t_end=0.02, dt=1e-2)
    SemLock.__init__ = init
    return len(made)


def waits(x, folder):
    """Ready at once for 0, else much later."""
    (Path(folder) / f"{x}").touch()
    time.sleep(600.0 * (x > 0))
    return x


def drop(seed, folder=""):
    """ANYmal falls on the ground, turned and spinning by chance; the run of seed 3 is killed once."""
    if folder and seed == 3 and not (Path(folder) / "killed").exists():
        (Path(folder) / "killed").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    scene, q0, v0 = robots.load("anymal", height=0.2)
    random = np.random.default_rng(seed)
    v0[:6] = random.normal(size=6)
    run = nga.simulate(scene, q0, v0, t_end=1.5, dt=2e-3, on_failure="stop")
    return {"q": run.q[-1], "v": run.v[-1], "steps": len(run.t) - 1, "end": run.message}
