"""Who listens from outside, and when, is not seen in a run; who listens hears every message."""

from __future__ import annotations

import json
import math
import signal
from typing import TYPE_CHECKING, Any

import pytest
from rclpy.qos import QoSProfile

from rail_msgs_py.cdr_stamp import stamp_reader
from rail_msgs_py.map_pose import MapPose
from rail_msgs_py.topics.ranging import POSITION, RANGE, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK, DIAGNOSTICS
from rail_msgs_py.topics.world import MAP_POSE, STATE

if TYPE_CHECKING:
    from rail_msgs_py.topics.topic import Topic
    from rail_testing.plugin import CorridorFactory

    from .conftest import Listener, Rail

pytestmark = pytest.mark.system
_RUN = ("run", "plain_line", "--duration", 30, "--processes", "one")
_ZONE = {"site": "wrs2", "zone": "zone2"}
#: Streams and estimates, which are not sent while nobody listens.
_TOPICS: tuple[tuple[Topic, dict[str, str]], ...] = (
    (STATE, {}),
    (POSITION, {"train": "train_a"}),
    (WRS_TX, _ZONE),
    (WRS_RX, _ZONE),
    (RANGE, _ZONE),
)


class Visits:
    """Listens to a topic again and again, a few messages at a time."""

    def __init__(self, listener: Listener, topic: Topic, parts: dict[str, str]) -> None:
        self._node, self._topic, self._name = listener.node, topic, topic.name(**parts)
        self.visits: list[list[bytes]] = []
        self._come()

    def _come(self) -> None:
        heard: list[bytes] = []
        self.visits.append(heard)
        # Deep: this listener is slower than a node of the corridor.
        self._subscription = self._node.create_subscription(
            self._topic.type, self._name, heard.append, QoSProfile(depth=1000), raw=True
        )

    def go_and_come(self) -> None:
        """Begin another visit once this one has heard enough."""
        if len(self.visits[-1]) >= 10:
            self._node.destroy_subscription(self._subscription)
            self._come()


def test_listeners_that_come_and_go_change_nothing_and_miss_nothing(
    rail: Rail, listener: Listener, corridor: CorridorFactory
) -> None:
    path = rail.directory / "report.json"
    visits = [Visits(listener, topic, parts) for topic, parts in _TOPICS]
    run = rail.start(*_RUN, "--rate", 5, "--report", path)

    def over() -> bool:
        for each in visits:
            each.go_and_come()
        return run.poll() is not None

    listener.until(over)
    assert run.returncode == 0, rail.errors(run)
    report = json.loads(path.read_text())
    alone = corridor("plain_line", duration_s=30.0).run_to_end().report
    assert report["digest"] == alone["digest"] and report["missing_ticks"] == 0
    assert report["events"] == alone["events"]
    for each, (topic, _) in zip(visits, _TOPICS, strict=True):
        assert len(each.visits) > 5, each
        read = stamp_reader(topic.type)
        for heard in filter(None, each.visits):
            stamps: list[Any] = [read(bytes(raw)) for raw in heard]
            assert stamps == list(range(stamps[0], stamps[-1] + 1, 100_000_000)), topic.pattern


def test_who_joins_a_process_hears_the_tick_at_hand_and_the_health_of_all(
    rail: Rail, listener: Listener
) -> None:
    clock = listener.listen(CLOCK)
    run = rail.start(*_RUN, "--rate", 8)
    listener.until(lambda: len(clock) > 20)
    joined_s = clock[-1].clock.sec + clock[-1].clock.nanosec * 1e-9
    health: list[Any] = listener.listen(DIAGNOSTICS)
    nodes = {f"/wayside/wrs{number}" for number in range(1, 7)} | {"/world", "/report"}
    listener.until(lambda: nodes <= {status.hardware_id for m in health for status in m.status})
    said_s = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in health]
    assert joined_s - 0.1 < said_s[0] < joined_s + 3.0
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT


def test_poses_in_the_map_are_there_for_who_asks(rail: Rail, listener: Listener) -> None:
    poses: dict[str, list[Any]] = {
        source: listener.listen(MAP_POSE, train="train_a", source=source)
        for source in ("truth", "ranging")
    }
    # Slow enough for discovery on a busy machine to leave nine seconds of it.
    run = rail.start(*_RUN, "--rate", 3)
    listener.until(lambda: all(len(heard) > 8 for heard in poses.values()))
    run.send_signal(signal.SIGINT)
    assert rail.finish(run) == 128 + signal.SIGINT
    by_time = {
        source: {pose.stamp_ns: pose for pose in map(MapPose.from_msg, heard)}
        for source, heard in poses.items()
    }
    truth, ranging = by_time["truth"], by_time["ranging"]
    assert {stamp_ns % 10**9 for stamp_ns in truth} == {900_000_000}
    assert all(pose.variance_m2 is None for pose in truth.values())
    both = truth.keys() & ranging.keys()
    assert len(both) > 5
    for stamp_ns in both:
        here, thought = truth[stamp_ns], ranging[stamp_ns]
        assert thought.variance_m2 is not None
        away_m = math.dist((here.x_m, here.y_m, here.z_m), (thought.x_m, thought.y_m, thought.z_m))
        assert away_m < 6.0 * math.sqrt(thought.variance_m2) + 1.0
        assert thought.heading_rad == pytest.approx(here.heading_rad, abs=0.02)
