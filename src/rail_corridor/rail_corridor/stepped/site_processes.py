"""The processes of a stepped corridor that are not its own: one for each site and train.

A clean process without ROS forks them, as the launcher of ``rail run`` does: the process of a test
may be full of threads, and a fork of it would not be safe. What to start and to kill comes over a
pipe, one line of JSON each; they all end when that closes.
"""

from __future__ import annotations

import json
import os
import pickle
import select
import subprocess
import sys
from collections.abc import Mapping, Sequence
from functools import partial
from typing import IO, Any

from rail_corridor.equipment.node_spec import NodeSpec
from rail_corridor.run.host import load_for_nodes, run_nodes
from rail_corridor.run.processes import ProcessGroup

_POLL_S = 0.05
_GRACE_S = 10.0


class SiteProcesses:
    """Nodes in processes of their own.

    Parameters
    ----------
    groups : mapping
        Nodes by process.
    domain : int, optional
        ROS domain; that of the environment if not given.
    report_reads : frozenset of str
        As of `rail_corridor.run.host.run_nodes`.
    """

    def __init__(
        self,
        groups: Mapping[str, Sequence[NodeSpec]],
        domain: int | None,
        report_reads: frozenset[str],
    ) -> None:
        self._process_of = {spec.name: name for name, specs in groups.items() for spec in specs}
        self._groups = groups
        environment = dict(os.environ)
        if domain is not None:
            environment["ROS_DOMAIN_ID"] = str(domain)
        environment["PYTHONPATH"] = os.pathsep.join(filter(None, sys.path))
        self._host = subprocess.Popen(
            [sys.executable, "-m", __name__], stdin=subprocess.PIPE, env=environment
        )
        assert self._host.stdin is not None
        self._pipe: IO[bytes] = self._host.stdin
        pickle.dump((dict(groups), report_reads), self._pipe)
        self._pipe.flush()

    def __contains__(self, node: str) -> bool:
        return node in self._process_of

    def beside(self, node: str) -> list[str]:
        """Full names of all nodes in the process of one."""
        return [spec.name for spec in self._groups[self._process_of[node]]]

    def kill(self, node: str) -> None:
        """Kill the process of a node."""
        self._tell("kill", self._process_of[node])

    def start(self, node: str) -> None:
        """Start the process of a node again."""
        self._tell("start", self._process_of[node])

    def _tell(self, what: str, process: str) -> None:
        self._pipe.write(f"{json.dumps([what, process])}\n".encode())
        self._pipe.flush()

    def close(self) -> None:
        """End all of them."""
        self._pipe.close()
        try:
            self._host.wait(timeout=_GRACE_S)
        except subprocess.TimeoutExpired:
            self._host.kill()  # they notice, and end by themselves
            self._host.wait()


def main() -> None:
    """Fork the processes, and do what is told, until the pipe closes."""
    pipe = sys.stdin.buffer
    groups, report_reads = pickle.load(pipe)
    os.set_blocking(pipe.fileno(), False)
    load_for_nodes({spec.kind for specs in groups.values() for spec in specs})
    processes = ProcessGroup()

    def start(name: str) -> None:
        work = partial(run_nodes, groups[name], switches=True, report_reads=report_reads)
        processes.start(name, work)

    for name in groups:
        start(name)
    waiting = b""
    try:
        while True:
            if select.select([pipe], [], [], _POLL_S)[0]:
                piece: Any = pipe.read(4096)
                if piece == b"":
                    break
                waiting += piece or b""
                *lines, waiting = waiting.split(b"\n")
                for line in lines:
                    what, name = json.loads(line)
                    if what == "kill":
                        processes.kill(name)
                    else:
                        start(name)
            processes.poll()
    finally:
        processes.stop()


if __name__ == "__main__":
    main()
