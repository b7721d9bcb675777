"""The processes of a run: forked from the launcher, watched, ended without exception.

Forking before ROS is initialised shares the imported libraries, so that twenty processes start
in the time of one.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from .host import die_with

GRACE_S = 5.0
_POLL_S = 0.02


@dataclass
class Child:
    """One process: its name, and how it ended once it has."""

    name: str
    pid: int
    ended: str = ""


class ProcessGroup:
    """Starts and ends processes.

    Call :meth:`start` for all of them before initialising ROS in this process.
    """

    def __init__(self) -> None:
        self.children: list[Child] = []
        #: Of a pipe: the end that children read, and the one that closes with this process.
        self._ends: tuple[int, ...] = os.pipe()

    def start(self, name: str, work: Callable[[], None]) -> Child:
        """Fork a process that does ``work``."""
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid == 0:
            self._run(name, work)
        child = Child(name, pid)
        self.children.append(child)
        return child

    def _run(self, name: str, work: Callable[[], None]) -> None:
        """In the child; never returns."""
        code = 1
        try:
            # Ctrl-C in the terminal is the launcher's to handle.
            os.setsid()
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            read_end, write_end = self._ends
            os.close(write_end)
            self._ends = (read_end,)
            # The name that ps, top and pkill show.
            Path("/proc/self/comm").write_text(f"rail_{name}"[:15])
            die_with(read_end)
            work()
            code = 0
            if select.select([read_end], [], [], 0.0)[0]:
                self._tidy_up_in_place_of_the_launcher()
        except BaseException:
            traceback.print_exc()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)

    def _tidy_up_in_place_of_the_launcher(self) -> None:
        """In a child whose launcher was killed: wait for older siblings, remove what is left.

        Every child does so, so that the youngest alive, at least, comes after all others.
        """
        deadline_s = time.monotonic() + GRACE_S
        while any(_runs(child.pid) for child in self.children) and time.monotonic() < deadline_s:
            time.sleep(_POLL_S)
        remove_orphaned_segments(besides=os.getpid())

    def poll(self) -> list[Child]:
        """Children that have ended since the last call."""
        ended = []
        for child in self.children:
            if child.ended:
                continue
            pid, status = os.waitpid(child.pid, os.WNOHANG)
            if pid:
                child.ended = _how(status)
                ended.append(child)
        return ended

    def kill(self, name: str) -> None:
        """Kill a process; `poll` tells of its end."""
        for child in self._alive():
            if child.name == name:
                os.kill(child.pid, signal.SIGKILL)

    def stop(self, grace_s: float = GRACE_S) -> None:
        """End every child: asked first, then killed."""
        self._signal(signal.SIGTERM)
        deadline_s = time.monotonic() + grace_s
        while self._alive() and time.monotonic() < deadline_s:
            self.poll()
            time.sleep(_POLL_S)
        self._signal(signal.SIGKILL)
        for child in self._alive():
            _, status = os.waitpid(child.pid, 0)
            child.ended = _how(status)
        self.close()

    def close(self) -> None:
        """Let go of the pipe that ties the children to this process, as a sibling of them must."""
        ends, self._ends = self._ends, ()
        for end in ends:
            os.close(end)

    def _alive(self) -> list[Child]:
        return [child for child in self.children if not child.ended]

    def _signal(self, number: signal.Signals) -> None:
        for child in self._alive():
            with contextlib.suppress(ProcessLookupError):
                os.kill(child.pid, number)


def _how(status: int) -> str:
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        return f"killed by {signal.Signals(-code).name}"
    return "ended" if code == 0 else f"ended with exit code {code}"


def remove_orphaned_segments(
    directory: Path = Path("/dev/shm"), proc: Path = Path("/proc"), besides: int | None = None
) -> list[Path]:
    """Remove shared-memory segments of the middleware that no process, ``besides`` one, has.

    A killed process leaves them behind. A segment and its lock file stand or fall together:
    the one is mapped, the other only open.
    """
    families: dict[str, list[Path]] = {}
    for path in directory.glob("fastrtps_*"):
        if _mine(path):
            families.setdefault(path.name.removesuffix("_el"), []).append(path)
    if not families:
        return []
    for process in proc.glob("[0-9]*"):
        if process.name == str(besides):
            continue
        for name in _in_use(process, directory):
            families.pop(name.removesuffix("_el"), None)
    return _removed(path for paths in families.values() for path in paths)


def _in_use(process: Path, directory: Path) -> set[str]:
    """Names in a directory of what a process maps or has open."""
    start = f"{directory}/"
    names = set()
    with contextlib.suppress(OSError):
        for line in (process / "maps").read_text().splitlines():
            place = line.find(start)
            if place >= 0:
                names.add(line[place + len(start) :].removesuffix(" (deleted)"))
    with contextlib.suppress(OSError):
        for link in (process / "fd").iterdir():
            with contextlib.suppress(OSError):
                target = str(link.readlink())
                if target.startswith(start):
                    names.add(target[len(start) :].removesuffix(" (deleted)"))
    return names


def _runs(pid: int) -> bool:
    """Whether a process has memory, which a zombie has not."""
    with contextlib.suppress(OSError):
        return bool(Path(f"/proc/{pid}/maps").read_text())
    return False


def _mine(path: Path) -> bool:
    with contextlib.suppress(OSError):
        return path.stat().st_uid == os.getuid()
    return False


def _removed(segments: Iterable[Path]) -> list[Path]:
    removed = []
    for segment in sorted(segments):
        with contextlib.suppress(OSError):
            segment.unlink()
            removed.append(segment)
    return removed
