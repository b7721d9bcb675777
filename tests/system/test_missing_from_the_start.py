"""A node that is not there at the start is missing, and nothing else is different."""

from __future__ import annotations

import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from rail_msgs_py.position import Position
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.tick import CLOCK, FAILED

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Listener, Rail

pytestmark = pytest.mark.system
NODE = "/wayside/wrs3"
EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


@pytest.mark.parametrize("placement", ["one", "site"])
def test_a_station_that_never_comes(rail: Rail, corridor: CorridorFactory, placement: str) -> None:
    path = rail.directory / "report.json"
    run = rail.start(
        *("run", "plain_line", "--duration", 15, "--processes", placement, "--timeout", 2),
        *("--external", NODE, "--report", path),
    )
    assert rail.finish(run) == 4
    assert f"not meant to fail: {NODE}" in rail.output(run)
    report = json.loads(path.read_text())
    assert report["complete"] and report["ticks"] == 150
    assert [failed["node"] for failed in report["failures"]] == [NODE]
    # At full speed: nobody is waited for any longer.
    assert report["wall_time_s"] < 10.0
    # As if it had been killed in the first tick.
    c = corridor("plain_line", duration_s=15.0)
    c.step()
    c.kill(NODE)
    killed = c.run_to_end().report
    assert report["trains"].keys() == killed["trains"].keys()
    assert report["trains"]["train_a"]["phase_ranging"] == pytest.approx(
        killed["trains"]["train_a"]["phase_ranging"], rel=0.1
    )


def test_a_process_that_dies_at_the_fork(
    rail: Rail, wait_until: Callable[[Callable[[], Any]], Any]
) -> None:
    path = rail.directory / "report.json"
    run = rail.start(
        *("run", "plain_line", "--duration", 5, "--processes", "site"),
        *("--allow-failures", "--report", path),
    )
    wait_until(lambda: "rail_wrs3" in rail.processes().values())
    (pid,) = (pid for pid, name in rail.processes().items() if name == "rail_wrs3")
    os.kill(pid, signal.SIGKILL)
    assert rail.finish(run) == 0
    report = json.loads(path.read_text())
    assert report["complete"] and report["ticks"] == 50
    (failed,) = report["failures"]
    assert failed["node"] == NODE and "SIGKILL" in failed["reason"]


def test_who_comes_late_is_taken_up_again(rail: Rail, listener: Listener) -> None:
    controller = "/wayside/zone_controller"
    path = rail.directory / "report.json"
    clock, failed = listener.listen(CLOCK), listener.listen(FAILED)
    positions = listener.listen(POSITION, train="train_a")
    run = rail.start(
        *("run", "plain_line", "--rate", 5, "--processes", "site", "--timeout", 3),
        *("--external", controller, "--allow-failures", "--report", path),
    )
    listener.until(lambda: len(clock) > 5)
    assert [message.name for message in failed] == [controller] and not positions
    mine = rail.start(command=[sys.executable, "-u", str(EXAMPLES / "own_estimator.py")])
    listener.until(lambda: len(positions) > 20)
    # In step: a position of every tick, the last of the tick at hand.
    stamps = [Position.from_msg(message).stamp_ns for message in positions[-10:]]
    assert stamps == list(range(stamps[0], stamps[-1] + 1, 100_000_000))

    def behind_ns() -> int:
        return to_ns(clock[-1].clock) - Position.from_msg(positions[-1]).stamp_ns

    listener.until(lambda: behind_ns() <= 100_000_000)
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
    mine.send_signal(signal.SIGTERM)
    rail.finish(mine)
    assert [one["node"] for one in json.loads(path.read_text())["failures"]] == [controller]
