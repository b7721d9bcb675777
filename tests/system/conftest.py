"""Fixtures that run corridors in processes of their own, on a domain of their own."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor

from rail_corridor.recording.parts import Recording
from rail_corridor.report.from_recording import report_of
from rail_msgs_py.topics.topic import Topic

from .waiting import PATIENCE_S, until

ROOT = Path(__file__).resolve().parents[2]
_TOKEN = "RAIL_TEST_TOKEN"


@pytest.fixture
def wait_until() -> Callable[[Callable[[], Any]], Any]:
    """Return a function that waits for a condition and returns early; it fails after long."""
    return until


def _segments_of(processes: Iterable[int]) -> set[Path]:
    """Return the segments of participants; those of ports are shared with other domains."""
    found = set()
    for pid in processes:
        try:
            maps = Path(f"/proc/{pid}/maps").read_text()
        except OSError:
            continue
        found |= {Path(name) for name in re.findall(r"/dev/shm/fastrtps_[0-9a-f]{16}\b", maps)}
    return found


@dataclass
class Rail:
    """Runs ``rail`` commands that share a domain and a mark in their environment."""

    directory: Path
    domain: int
    token: str = field(default_factory=lambda: uuid.uuid4().hex)
    started: list[subprocess.Popen[str]] = field(default_factory=list)

    @property
    def environment(self) -> dict[str, str]:
        sources = os.pathsep.join(str(path) for path in sorted((ROOT / "src").glob("rail_*")))
        path = os.pathsep.join(filter(None, (sources, os.environ.get("PYTHONPATH"))))
        mine = {"PYTHONPATH": path, "ROS_DOMAIN_ID": str(self.domain), _TOKEN: self.token}
        inherited = {k: v for k, v in os.environ.items() if k != "FASTDDS_BUILTIN_TRANSPORTS"}
        return {**inherited, **mine}

    def start(
        self,
        *arguments: object,
        command: list[str] | None = None,
        transports: str = "DEFAULT",
    ) -> subprocess.Popen[str]:
        """Start ``rail`` or another command, on these transports; its output goes to files."""
        number = len(self.started)
        with (
            (self.directory / f"stdout_{number}").open("w") as stdout,
            (self.directory / f"stderr_{number}").open("w") as stderr,
        ):
            process = subprocess.Popen(
                [
                    *(command or [sys.executable, "-m", "rail_corridor.cli.main"]),
                    *map(str, arguments),
                ],
                stdout=stdout,
                stderr=stderr,
                text=True,
                env=self.environment | {"FASTDDS_BUILTIN_TRANSPORTS": transports},
                cwd=self.directory,
            )
        self.started.append(process)
        return process

    def output(self, process: subprocess.Popen[str]) -> str:
        """Return what a process has written to its standard output."""
        return (self.directory / f"stdout_{self.started.index(process)}").read_text()

    def errors(self, process: subprocess.Popen[str]) -> str:
        """Return what a process has written to its standard error."""
        return (self.directory / f"stderr_{self.started.index(process)}").read_text()

    def finish(self, process: subprocess.Popen[str]) -> int:
        """Wait for the end of a process; return its exit code."""
        return process.wait(timeout=PATIENCE_S)

    def report(self, *arguments: object) -> dict[str, Any]:
        """Run a corridor to its end and return its report."""
        path = self.directory / f"report_{len(self.started)}.json"
        process = self.start("run", *arguments, "--report", path)
        assert self.finish(process) == 0, self.errors(process)
        report: dict[str, Any] = json.loads(path.read_text())
        return report

    def recorded(self, *arguments: object) -> dict[str, Any]:
        """Run a corridor to its end and return its report, which its recording gives as well."""
        path = self.directory / f"run_{len(self.started)}.mcap"
        report = self.report(*arguments, "--record", path)
        assert self.again(path) == report
        return report

    def again(self, recording: Path) -> dict[str, Any]:
        """Return the report of a recording, which must be whole, computed from its messages."""
        with Recording(recording) as file:
            report = report_of(file)
        assert file.cut_at is None
        return report

    def processes(self) -> dict[int, str]:
        """Return every living process that descends from this fixture: its id and its name."""
        found = {}
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if self.token.encode() not in (entry / "environ").read_bytes():
                    continue
                state = (entry / "stat").read_text().rsplit(")", 1)[1].split()[0]
                if state != "Z":
                    found[int(entry.name)] = (entry / "comm").read_text().strip()
            except OSError:
                continue
        return found

    def cpu_s(self) -> float:
        """Return the CPU time of every process that tests have started, ended or alive.

        Unlike the time on the wall it does not grow with what else the machine does.
        """
        ended = resource.getrusage(resource.RUSAGE_CHILDREN)
        alive = 0
        for pid in self.processes():
            fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
            alive += sum(map(int, fields[11:13]))
        return ended.ru_utime + ended.ru_stime + alive / os.sysconf("SC_CLK_TCK")

    def segments(self) -> set[Path]:
        """Return the shared memory that these processes have open."""
        return _segments_of(self.processes())

    def left_behind(self, segments: set[Path]) -> set[Path]:
        """Return those of the segments that are still there and that no process has open."""
        everybody = (int(entry.name) for entry in Path("/proc").glob("[0-9]*"))
        there = {path for path in segments if path.exists()}
        return there - _segments_of(everybody)


@contextmanager
def _runner(directory: Path, domain: int) -> Iterator[Rail]:
    runner = Rail(directory, domain)
    yield runner
    for pid in runner.processes():
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
    for process in runner.started:
        process.wait()


@pytest.fixture
def rail(tmp_path: Path, ros_domain: int) -> Iterator[Rail]:
    """Return a runner of ``rail``; whatever it has started is gone afterwards."""
    with _runner(tmp_path, ros_domain) as runner:
        yield runner


@pytest.fixture(scope="module")
def module_rail(tmp_path_factory: pytest.TempPathFactory, module_domain: int) -> Iterator[Rail]:
    """Return a runner of ``rail`` that the tests of a module share."""
    with _runner(tmp_path_factory.mktemp("rail"), module_domain) as runner:
        yield runner


class Listener:
    """An ordinary ROS node beside the corridor."""

    def __init__(self, domain: int) -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("test_listener", context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)

    def listen(self, topic: Topic, **parts: object) -> list[Any]:
        """Subscribe; return the list that the messages are added to."""
        heard: list[Any] = []
        self.node.create_subscription(topic.type, topic.name(**parts), heard.append, topic.qos)
        return heard

    def until(self, condition: Callable[[], Any], patience_s: float = PATIENCE_S) -> Any:
        """Spin until a condition is true; fail after a long time."""
        deadline_s = time.monotonic() + patience_s
        while not (value := condition()):
            assert time.monotonic() < deadline_s, f"waited {patience_s} s in vain"
            self._executor.spin_once(timeout_sec=0.05)
        return value

    def close(self) -> None:
        """End the node; what the corridor shares with it is then its own again."""
        if not self.context.ok():
            return
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)


@pytest.fixture
def listener(rail: Rail) -> Iterator[Listener]:
    """Return a node in the domain of the corridor."""
    node = Listener(rail.domain)
    yield node
    node.close()
