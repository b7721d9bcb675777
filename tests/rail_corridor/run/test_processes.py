"""Processes of a run: they end as they are told, and what they leave behind is removed."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from rail_corridor.run.processes import Child, ProcessGroup, remove_orphaned_segments

#: Only ever reached by a test that fails.
PATIENCE_S = 20.0


def sleep_for_ever() -> None:
    while True:
        signal.pause()


def fail() -> None:
    raise SystemExit("the traceback is this test's")


def ended(group: ProcessGroup) -> Child:
    """Wait for the next child to end."""
    limit_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < limit_s:
        if found := group.poll():
            return found[0]
        os.sched_yield()
    raise AssertionError("no process ended in time")


def hang_up() -> None:
    """End by a signal that who started the tests may have had ignored, as nohup does."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    os.kill(os.getpid(), signal.SIGHUP)


@pytest.mark.parametrize(
    ("work", "how"),
    [
        (lambda: None, "ended"),
        (fail, "ended with exit code 1"),
        (lambda: os.kill(os.getpid(), signal.SIGKILL), "killed by SIGKILL"),
        (hang_up, "killed by SIGHUP"),
    ],
)
def test_how_a_process_ended(work: Callable[[], None], how: str) -> None:
    group = ProcessGroup()
    started = group.start("one", work)
    try:
        assert ended(group) is started
        assert (started.name, started.ended) == ("one", how)
        assert group.poll() == []
    finally:
        group.stop()


def test_processes_end_when_asked() -> None:
    group = ProcessGroup()
    children = [group.start(f"n{n}", sleep_for_ever) for n in range(3)]
    assert group.poll() == []
    group.stop()
    assert all(child.ended == "killed by SIGTERM" for child in children)


def test_a_process_that_does_not_listen_is_killed() -> None:
    def deaf() -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        os.write(write_end, b"!")
        sleep_for_ever()

    read_end, write_end = os.pipe()
    group = ProcessGroup()
    child = group.start("deaf", deaf)
    assert os.read(read_end, 1) == b"!"
    group.stop(grace_s=0.05)
    assert child.ended == "killed by SIGKILL"
    os.close(read_end)
    os.close(write_end)


def test_processes_end_with_their_launcher() -> None:
    read_end, write_end = os.pipe()

    def worker() -> None:
        os.write(write_end, f"{os.getpid()}\n".encode())
        sleep_for_ever()

    def launcher() -> None:
        ProcessGroup().start("worker", worker)
        signal.pause()

    group = ProcessGroup()
    child = group.start("launcher", launcher)
    worker_pid = int(os.read(read_end, 32))
    os.kill(child.pid, signal.SIGKILL)
    assert ended(group) is child
    os.close(write_end)
    # Only the worker holds the other end now: it closes when the worker has gone.
    assert os.read(read_end, 1) == b""
    os.close(read_end)
    assert worker_pid != child.pid
    group.stop()


# What a killed process leaves behind ------------------------------------------------------


def process(proc: Path, number: int, maps: str = "", opened: tuple[Path, ...] = ()) -> None:
    """Make what the kernel says about a process."""
    here = proc / str(number)
    (here / "fd").mkdir(parents=True)
    (here / "maps").write_text(maps)
    for index, path in enumerate(opened):
        (here / "fd" / str(index)).symlink_to(path)


def test_only_segments_that_nobody_has_are_removed(tmp_path: Path) -> None:
    shm, proc = tmp_path / "shm", tmp_path / "proc"
    shm.mkdir()
    names = ["fastrtps_used", "fastrtps_used_el", "fastrtps_open_el", "fastrtps_open"]
    names += ["fastrtps_left", "fastrtps_left_el", "somebody_elses"]
    for name in names:
        (shm / name).touch()
    process(proc, 1, maps=f"7f00-7f01 rw-s 0000 00:19 42    {shm}/fastrtps_used\n")
    process(proc, 2, opened=(shm / "fastrtps_open_el",))
    (proc / "self").mkdir()
    removed = remove_orphaned_segments(shm, proc)
    left = {"fastrtps_left", "fastrtps_left_el"}
    assert {path.name for path in removed} == left
    assert {path.name for path in shm.iterdir()} == set(names) - left


def test_a_name_that_begins_like_a_used_one_is_not_used(tmp_path: Path) -> None:
    shm, proc = tmp_path / "shm", tmp_path / "proc"
    shm.mkdir()
    for name in ("fastrtps_1", "fastrtps_12"):
        (shm / name).touch()
    process(proc, 1, maps=f"7f00-7f01 rw-s 0000 00:19 42    {shm}/fastrtps_12\n")
    assert [path.name for path in remove_orphaned_segments(shm, proc)] == ["fastrtps_1"]


def test_without_segments_nothing_is_done(tmp_path: Path) -> None:
    assert remove_orphaned_segments(tmp_path, tmp_path) == []
