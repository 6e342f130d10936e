"""What is written to the disk is there as a whole or not at all; what is read is right or refused."""

import io
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import ngalpha_pin as nga
from ngalpha_pin import robots
from ngalpha_pin.common import files
from ngalpha_pin.results.chunks import Store

KILLS = int(os.environ.get("NGALPHA_KILLS", "1"))
"""Of each kind of saving process; NGALPHA_KILLS=200 pytest tests/common/test_files.py kills as many as promised."""

SAVING = """
import sys
import ngalpha_pin as nga
run = nga.Trajectory.load(sys.argv[1])
print("ready", flush=True)
while True:
    run.save(sys.argv[2])
"""
CHUNKS = """
import sys
import ngalpha_pin as nga
from ngalpha_pin import robots
scene, q0, v0 = robots.load("rotating_ball")
print("ready", flush=True)
nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3, save_to=sys.argv[1], every=7)
"""


@pytest.fixture(scope="module")
def run():
    scene, q0, v0 = robots.load("rotating_ball", height=0.2)
    return nga.simulate(scene, q0, v0, t_end=0.3, dt=2e-3)


@pytest.fixture(scope="module")
def saved(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "run.npz"
    run.save(path)
    return path.read_bytes()


def killed(script, *arguments, seconds, written=None):
    """Start a script, and kill it some time after it is ready, and after it has written a file."""
    process = subprocess.Popen([sys.executable, "-c", script, *map(str, arguments)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    end = time.monotonic() + 60.0
    while written is not None and not written.exists() and time.monotonic() < end:
        time.sleep(0.01)
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    process.wait()
    process.stdout.close()


def test_kill_during_a_save_leaves_a_whole_file(run, saved, tmp_path):
    path, source = tmp_path / "run.npz", tmp_path / "source.npz"
    source.write_bytes(saved)
    path.write_bytes(saved)
    for seed in range(KILLS):
        killed(SAVING, source, path, seconds=random.Random(seed).uniform(0.0, 0.1))
        assert np.array_equal(nga.Trajectory.load(path).q, run.q)
    assert all(name.name.endswith(".part.npz") for name in tmp_path.iterdir() if name not in (path, source))


def test_kill_during_a_run_leaves_chunks_that_resume_to_the_same_bits(tmp_path):
    scene, q0, v0 = robots.load("rotating_ball")
    whole = nga.simulate(scene, q0, v0, t_end=1.0, dt=1e-3)
    for seed in range(KILLS):
        folder = tmp_path / str(seed)
        killed(CHUNKS, folder, seconds=random.Random(seed).uniform(0.0, 0.5), written=folder / "000000.npz")
        state = nga.Chunks(folder).final_state
        nga.simulate(scene, state=state, t_end=1.0, dt=1e-3, save_to=folder, every=50)
        chunks = list(nga.Chunks(folder))
        for name in ("t", "q", "v", "a", "P_N", "la_F"):
            parts = [getattr(chunks[0], name)[:1], *(getattr(chunk, name)[1:] for chunk in chunks)]
            assert np.array_equal(np.concatenate(parts), getattr(whole, name)), name
        assert chunks[-1].success


def test_chunks_are_those_of_one_run(tmp_path):
    scene, q0, v0 = robots.load("rotating_ball")
    last = nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3, save_to=tmp_path / "run", every=40)
    chunks = nga.Chunks(tmp_path / "run")
    assert [len(chunk.t) for chunk in chunks] == [41, 41, 21]
    assert [chunk.success for chunk in chunks] == [False, False, True]
    assert np.array_equal(last.q, chunks[-1].q)
    assert len(chunks[:2]) == 2
    with pytest.raises(nga.SceneError, match=r"not end where this one starts, at t = 0\.1 and not 0 s"):
        nga.simulate(scene, q0, v0, t_end=0.1, dt=1e-3, save_to=tmp_path / "run")
    end = chunks.final_state
    for change, said in (
        ({"v": end.v + 1e-3}, r"v \(by 0\.001\)"),
        ({"tau_f": np.zeros(9)}, r"tau_f \(of another length\)"),
    ):
        with pytest.raises(nga.SceneError, match=rf"not end where this one starts, its state differs in {said};"):
            Store(tmp_path / "run", 40, replace(end, **change))
    with pytest.raises(nga.SceneError, match=r"differs in q \(by 0\.5\)"):
        nga.simulate(scene, state=replace(end, q=end.q + [0.5, 0.0, 0.0, 0.0]), t_end=0.2, save_to=tmp_path / "run")
    assert len(nga.Chunks(tmp_path / "run")) == 3
    with pytest.raises(nga.SceneError, match="no folder with chunks"):
        nga.Chunks(tmp_path)
    (tmp_path / "run" / "000001.npz").unlink()
    with pytest.raises(nga.SceneError, match=r"chunk 000001\.npz is missing"):
        nga.Chunks(tmp_path / "run")


@pytest.fixture
def full_disk():
    """No file can become longer than some bytes, as on a disk that is full."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (3000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    signal.signal(signal.SIGXFSZ, before)


def test_full_disk_leaves_the_old_file_and_the_run(run, tmp_path, full_disk):
    path = tmp_path / "run.npz"
    path.write_text("old")
    with pytest.raises(nga.NotWritten, match=r"cannot write .*run\.npz: .*as before"):
        run.save(path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_no_space_for_chunks_leaves_what_was_computed(tmp_path, full_disk):
    scene, q0, v0 = robots.load("rotating_ball")
    with pytest.raises(nga.NotWritten) as caught:
        nga.simulate(scene, q0, v0, t_end=0.5, dt=1e-3, save_to=tmp_path, every=100)
    assert len(caught.value.trajectory.t) == 101
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("error", "said"), [(KeyboardInterrupt(), "interrupted"), (ValueError("own"), "own")])
def test_no_space_for_chunks_does_not_hide_what_ended_the_run(tmp_path, full_disk, error, said):
    scene, q0, v0 = robots.load("rotating_ball")

    def law(t, q, v):
        if t > 0.05:
            raise error
        return np.zeros(3)

    scene.add_force(nga.Control(law))
    with pytest.raises(nga.NotWritten, match=rf"cannot write .*; the run had ended at t = .*{said}") as caught:
        nga.simulate(scene, q0, v0, t_end=0.5, dt=1e-3, save_to=tmp_path, every=100)
    ended = caught.value.__cause__
    assert isinstance(ended, KeyboardInterrupt if said == "interrupted" else nga.SceneError)
    assert isinstance(caught.value.__context__.__cause__, OSError)
    assert caught.value.trajectory.t[0] == 0.0 and list(tmp_path.iterdir()) == []


def test_paths_that_cannot_be_written(run, tmp_path):
    for path in (tmp_path, tmp_path / "missing" / "run.npz", "/proc/run.npz"):
        with pytest.raises(nga.NotWritten, match="cannot write"):
            run.save(path)
    with pytest.raises(nga.SceneError, match="expected a path"):
        run.save(3)


def test_links_and_rights_of_the_file_stay(tmp_path):
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    files.write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640
    files.write_text("/dev/null", "nothing")


def test_what_fails_while_writing_leaves_the_old_file(tmp_path):
    path = tmp_path / "file"
    path.write_text("old")
    with pytest.raises(KeyboardInterrupt), files.replacing(path) as beside:
        beside.write_text("half")
        raise KeyboardInterrupt
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def load(content, folder):
    path = Path(folder) / "damaged.npz"
    path.write_bytes(content)
    return nga.Trajectory.load(path)


@settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_damaged_files_are_refused_or_right(data, saved, run, tmp_path_factory):
    """Flipped bits and missing parts; what the checksums do not cover, such as dates, does no harm."""
    content = bytearray(saved)
    if data.draw(st.booleans(), label="truncate"):
        del content[data.draw(st.integers(0, len(content) - 1)) :]
    else:
        for _ in range(data.draw(st.integers(1, 8))):
            content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    try:
        again = load(bytes(content), tmp_path_factory.getbasetemp())
    except nga.SceneError:
        return
    assert np.array_equal(again.q, run.q)


def rewritten(saved, change):
    """The file with members that are right by their checksums, but changed."""
    with zipfile.ZipFile(io.BytesIO(saved)) as old:
        members = {name: old.read(name) for name in old.namelist()}
    change(members)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as new:
        for name, content in members.items():
            new.writestr(name, content)
    return stream.getvalue()


def npy(array):
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def huge(members):
    members["q.npy"] = members["q.npy"].replace(b"'shape': (", b"'shape': (99999999999, ")


def header(**changes):
    def change(members):
        content = json.loads(str(np.load(io.BytesIO(members["header.npy"]))))
        members["header.npy"] = npy(np.array(json.dumps({**content, **changes})))

    return change


@pytest.mark.parametrize(
    "change",
    [
        huge,
        lambda members: members.pop("q.npy"),
        lambda members: members.update({"q.npy": npy(np.zeros((3, 3)))}),
        lambda members: members.update({"P_N.npy": npy(np.zeros(5))}),
        lambda members: members.update({"slot_ends.npy": npy(np.full(151, 10**9))}),
        lambda members: members.update({"contact_columns.npy": npy(np.array([99]))}),
        lambda members: members.update({"t.npy": b"no array"}),
        lambda members: members.update({"header.npy": npy(np.array("{"))}),
        header(format=1),
        header(scene={}),
        header(scene=None),
        header(friction_rows=[[0, 99]]),
        header(contact_names=3),
    ],
)
def test_files_that_are_none_inside_are_refused(change, saved, tmp_path):
    with pytest.raises(nga.SceneError, match=r"damaged\.npz"):
        load(rewritten(saved, change), tmp_path)
