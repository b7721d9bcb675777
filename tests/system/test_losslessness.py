"""What a run sends arrives: a report that lags loses nothing, a late reader gets the newest."""

from __future__ import annotations

import json
import os
import signal
from typing import TYPE_CHECKING, Any

import pytest
from rclpy.qos import QoSProfile

from rail_msgs_py.position import Position
from rail_msgs_py.stamps import to_ns
from rail_msgs_py.topics.ranging import POSITION
from rail_msgs_py.topics.tick import CLOCK, DIAGNOSTICS, OBSERVED

if TYPE_CHECKING:
    from rail_testing.plugin import CorridorFactory

    from .conftest import Listener, Rail

pytestmark = pytest.mark.system
_RUN = ("jammed_channel", "--duration", 60)


def test_a_report_that_stands_still_for_a_hundred_ticks_misses_none(
    rail: Rail, listener: Listener, corridor: CorridorFactory
) -> None:
    path = rail.directory / "report.json"
    clock, observed = listener.listen(CLOCK), listener.listen(OBSERVED)
    # Paced, so that the report stops long before the end; not in shared memory, where a process
    # that is stopped may hold the lock of a port (Fast DDS issue 6485).
    run = rail.start(
        *("run", *_RUN, "--rate", 15, "--processes", "site", "--report", path), transports="UDPv4"
    )
    listener.until(lambda: observed)
    os.kill(run.pid, signal.SIGSTOP)
    stopped = len(clock)
    listener.until(lambda: len(clock) > stopped + 100)
    os.kill(run.pid, signal.SIGCONT)
    assert rail.finish(run) == 0
    report = json.loads(path.read_text())
    assert report["complete"] and report["ticks"] == 600
    assert report["missing_ticks"] == 0 and not report["failures"]
    whole = corridor("jammed_channel", duration_s=60.0).run_to_end().report
    assert report["digest"] == whole["digest"]
    # What nodes said of their health as well, each change once.
    assert report["events"] == whole["events"] and len(whole["events"]) >= 4


def test_who_joins_late_gets_the_newest_estimate_first_and_soon_the_health_of_all(
    rail: Rail, listener: Listener
) -> None:
    clock = listener.listen(CLOCK)
    run = rail.start("run", "plain_line", "--rate", 10, "--processes", "site")
    listener.until(lambda: len(clock) > 100)
    # As `ros2 topic echo` does: with the durability that is offered.
    name = POSITION.name(train="train_a")
    (sender,) = listener.node.get_publishers_info_by_topic(name)
    reader = QoSProfile(depth=10, durability=sender.qos_profile.durability)
    positions: list[Any] = []
    joined_ns = to_ns(clock[-1].clock)
    listener.node.create_subscription(POSITION.type, name, positions.append, reader)
    health = listener.listen(DIAGNOSTICS)
    listener.until(lambda: positions)
    assert Position.from_msg(positions[0]).stamp_ns >= joined_ns - 100_000_000

    def nodes() -> set[str]:
        return {status.hardware_id for array in health for status in array.status}

    stations = {f"/wayside/wrs{number}" for number in range(1, 7)}
    everybody = stations | {"/world", "/world/radio_medium", "/train_a/vrs", "/report"}
    listener.until(lambda: nodes() >= everybody | {"/wayside/zone_controller"})
    assert all(to_ns(array.header.stamp) >= joined_ns for array in health)
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
