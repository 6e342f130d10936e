"""Processes as an executor: what ends one of them costs its own call alone."""

import functools
import operator
import os
import pickle
import signal
import time
from concurrent.futures import as_completed

import pytest
import sweep_functions

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.simulation.sweeps import processes
from ngalpha_pin.simulation.sweeps.processes import NotStarted, Processes, WorkerLost

# functions of installed modules: processes need not find this one
ends = functools.partial(os._exit, 7)
fails = functools.partial(operator.truediv, 1.0, 0.0)


@pytest.fixture(scope="module")
def pool():
    with Processes(1) as made:
        yield made


def test_a_process_that_ends_costs_its_own_call_alone(pool):
    calls = [pool.submit(operator.mul, i, i) for i in range(5)]
    lost = [pool.submit(ends)]
    calls += [pool.submit(operator.mul, i, i) for i in range(5, 10)]
    assert [call.result() for call in calls] == [i * i for i in range(10)]
    for call in lost:
        with pytest.raises(WorkerLost, match=r"ended \(exit code 7\)"):
            call.result()


def test_a_killed_process_says_by_what(pool):
    with pytest.raises(WorkerLost, match="SIGKILL"):
        pool.submit(functools.partial(signal.raise_signal, signal.SIGKILL)).result()


def test_errors_of_calls_come_back(pool):
    with pytest.raises(ZeroDivisionError):
        pool.submit(fails).result()
    with pytest.raises(nga.SceneError, match="no system named"):
        pool.submit(robots.load, "unicorn").result()
    with pytest.raises(pickle.PicklingError):
        pool.submit(functools.partial(eval, "lambda: 0")).result()


def test_a_run_in_a_process_leaves_nothing_in_the_system(pool):
    assert pool.submit(sweep_functions.semaphores_of_a_run).result() == 0


def test_what_an_exception_leaves_behind_is_ended_at_once():
    begin = time.perf_counter()
    with pytest.raises(RuntimeError, match="enough"), Processes(1) as own:
        call = own.submit(time.sleep, 1000.0)
        while not call.running():
            time.sleep(0.01)
        raise RuntimeError("enough")
    assert time.perf_counter() - begin < 500.0
    assert list(as_completed([call]))[0].exception() is not None


def test_a_process_that_does_not_start_says_why(monkeypatch):
    monkeypatch.setattr(processes, "_serve", operator.not_)  # ends at once
    with Processes(1) as own, pytest.raises(NotStarted, match="__name__ == '__main__'"):
        own.submit(operator.not_, 1).result()
