"""A process that is killed is named at once, and the corridor goes on without it."""

from __future__ import annotations

import json
import os
import signal
from typing import TYPE_CHECKING

import pytest

from rail_msgs_py.stamps import to_ns
from rail_msgs_py.topics.tick import CLOCK, FAILED

if TYPE_CHECKING:
    from .conftest import Listener, Rail

pytestmark = pytest.mark.system


#: Processes, as the system names them, and the node that each has.
_KILLED = {
    "rail_wrs5": "/wayside/wrs5",
    "rail_train_b": "/train_b/vrs",
    "rail_zone_contr": "/wayside/zone_controller",
}


def test_killed_processes_are_named_and_the_corridor_goes_on(
    rail: Rail, listener: Listener
) -> None:
    path, recording = rail.directory / "report.json", rail.directory / "run.mcap"
    failed = listener.listen(FAILED)
    clock = listener.listen(CLOCK)
    run = rail.start(
        *("run", "branch", "--duration", 20, "--rate", 5, "--processes", "site"),
        *("--report", path, "--record", recording),
    )
    listener.until(lambda: len(clock) > 10)
    for process, node in _KILLED.items():
        (pid,) = (pid for pid, name in rail.processes().items() if name == process)
        os.kill(pid, signal.SIGKILL)
        killed_ns = to_ns(clock[-1].clock)
        listener.until(lambda one=node: one in {message.name for message in failed})
        # It goes on: three more seconds of simulated time pass.
        listener.until(lambda since=killed_ns: to_ns(clock[-1].clock) > since + 3_000_000_000)
    assert rail.finish(run) == 4
    report = json.loads(path.read_text())
    assert report["complete"]
    assert report["ticks"] == 200
    assert {failure["node"] for failure in report["failures"]} == {*_KILLED.values()}
    # By the launcher, which saw them die, not by a timeout.
    assert all("SIGKILL" in failure["reason"] for failure in report["failures"])
    assert all(node in rail.output(run) for node in _KILLED.values())
    assert not rail.processes()
    # The recording holds what it told before it was killed, be it that nobody had connected yet.
    recorded = rail.again(recording)
    assert recorded["failures"] == report["failures"]
    assert recorded["ticks"] == report["ticks"]
    assert recorded["missing_ticks"] <= report["missing_ticks"]
