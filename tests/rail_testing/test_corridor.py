"""The bench itself: time, topics, faults, nodes under test, against what a run is known to do."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64, String

from rail_corridor.equipment.registry import subsystems
from rail_corridor.errors import InputError
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import to_ns
from rail_testing import Corridor, Late
from rail_testing.interception import InterceptorError
from rail_testing.under_test import NodeError
from rail_wayside.zone_controller_node import ZoneControllerNode

Make = Callable[..., Corridor]
POSITION = "/wayside/zone_controller/train_a/position"


class Counter(Node):
    """Listens, and knows nothing of any corridor."""

    def __init__(self) -> None:
        super().__init__("counter")
        self.seen: list[float] = []
        self._send = self.create_publisher(Float64, "/counter/seen", 10)
        self.create_subscription(Odometry, POSITION, self._count, 10)

    def _count(self, message: Odometry) -> None:
        self.seen.append(message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec)
        self._send.publish(Float64(data=float(len(self.seen))))


def test_time_stands_between_calls_and_runs_as_far_as_it_is_told(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0)
    assert (c.ticks, c.time_s) == (0, 0.0)
    assert c.step(3) == 3 and c.ticks == 3
    assert c.time_s == pytest.approx(0.2)
    assert c.topic(POSITION).count == 3
    c.run_for(1.0)
    assert c.ticks == 13
    assert c.step(100) == 37 and c.finished and c.step() == 0
    report = c.report()
    assert report["complete"] and report["ticks"] == 50 and report["missing_ticks"] == 0


def test_a_node_that_only_listens_misses_nothing(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    counter: list[Counter] = []

    def make() -> Counter:
        counter.append(Counter())
        return counter[-1]

    c.add(make)
    c.run_to_end()
    assert counter[0].seen == pytest.approx([0.1 * tick for tick in range(200)])
    assert c.topic("/counter/seen").latest.data == 200.0


def test_what_is_seen_is_what_a_run_without_the_bench_gives(corridor: Make) -> None:
    with Corridor("plain_line", duration_s=3.0) as other:
        digest = other.run_to_end().digest
    c = corridor("plain_line", duration_s=3.0)
    c.add(Counter)
    for _ in range(30):
        c.step()
        assert c.topic(POSITION).latest.stamp_ns == round(1e9 * c.time_s)
    assert c.outcome().digest == digest


def test_a_condition_that_ceases_names_tick_source_and_what_was_seen(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    c.always(lambda: c.topic(POSITION).latest.chainage_m < 200.0)
    with pytest.raises(AssertionError) as failed:
        c.run_to_end()
    said = str(failed.value)
    assert f"tick {c.ticks - 1} ({c.time_s:.2f} s): does not hold" in said
    assert "chainage_m < 200.0" in said and "Position(" in said
    assert c.topic(POSITION).latest.chainage_m == pytest.approx(200.0, abs=5.0)


def test_a_condition_that_never_comes_says_what_was_last_seen(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    with pytest.raises(AssertionError, match=r"tick 9 \(0\.90 s\): not within 1 s: .*4711"):
        c.run_until(lambda: c.topic(POSITION).count == 4711, within_s=1)
    assert c.run_until(lambda: c.topic(POSITION).count == 12, within_s=1) == pytest.approx(0.2)


def test_a_fault_comes_when_it_is_injected(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    c.run_for(4.0)
    known = c.topic(POSITION).latest
    c.inject({"kind": "dead_station", "station": "wrs1"})
    c.step(2)
    after = c.topic(POSITION).latest
    assert known.track == "main" and after.variance_m2 > known.variance_m2
    with pytest.raises(InputError, match="wrs99"):
        c.inject({"kind": "dead_station", "station": "wrs99"})


def test_who_is_killed_is_missing_and_who_is_restarted_is_back(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    c.run_for(2.0)
    ranges = c.topic("/wayside/wrs1/zone1/range")
    c.kill("/wayside/wrs1")
    count = ranges.count
    c.run_for(2.0)
    assert ranges.count == count
    c.restart("/wayside/wrs1")
    c.run_for(2.0)
    assert ranges.count > count + 15
    failures = c.report()["failures"]
    assert [(each["node"], each["reason"]) for each in failures] == [("/wayside/wrs1", "killed")]


def test_messages_are_dropped_delayed_altered_and_forged(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    positions = c.topic(POSITION)
    c.step(5)
    c.intercept(POSITION, lambda _: None)
    c.step(5)
    assert positions.count == 5
    delayed = c.intercept(POSITION, lambda message: Late(message, 2))
    c.step(5)
    # Those of ticks 10, 11 and 12 have come, each two ticks late.
    assert [round(view.stamp_ns / 1e8) for view in positions.all[5:]] == [10, 11, 12]
    assert delayed is not None and delayed.seen == 5

    def moved(message: Odometry) -> list[Odometry]:
        message.pose.pose.position.x = 999.0
        return [message, message]

    c.intercept(POSITION, moved)
    c.step()
    assert [view.chainage_m for view in positions.all[-2:]] == [999.0, 999.0]
    c.intercept(POSITION, None)
    c.step()
    assert positions.latest.chainage_m < 300.0


def test_equipment_is_switched_and_starts_knowing_nothing(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=20.0)
    c.run_for(3.0)
    ranges = c.topic("/wayside/wrs1/zone1/range")
    assert ranges.latest.usable
    c.switch_off("/wayside/wrs1")
    c.step(2)
    assert not ranges.latest.usable
    c.switch_on("/wayside/wrs1")
    c.step(3)
    assert ranges.latest.usable
    with pytest.raises(InputError, match="can be switched"):
        c.switch_off("/world")


def test_what_a_node_under_test_raises_fails_the_test(corridor: Make) -> None:
    class Wrong(Counter):
        def _count(self, message: Odometry) -> None:
            raise ValueError("no such luck")

    c = corridor("plain_line", duration_s=5.0)
    c.add(Wrong)
    with pytest.raises(NodeError, match="/counter at tick 0: ValueError: no such luck"):
        c.step()


def test_names_that_are_not_there_are_one_line(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0)
    with pytest.raises(InputError, match="did you mean /wayside/wrs1"):
        c.kill("/wayside/wrs11")
    with pytest.raises(InputError, match="did you mean"):
        c.topic("/wayside/zone_controller/train_b/position")
    with pytest.raises(InputError, match="there are train_a"):
        c.truth("train_b")
    with pytest.raises(InputError, match="before the first tick"):
        c.add(Counter)
    with pytest.raises(InputError, match="no such node"):
        corridor("plain_line").add(Counter, replaces="/wayside/wrs99")
    with pytest.raises(InputError, match="nothing goes on without the world"):
        c.kill("/world")


@pytest.mark.rail(seeds=[4, 5])
def test_the_marker_gives_seeds(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=1.0)
    assert c.seed in (4, 5)
    c.run_to_end()


def test_a_corridor_that_has_stood_for_an_hour_goes_on(
    corridor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Corridor("plain_line", duration_s=3.0) as other:
        digest = other.run_to_end().digest
    c = corridor("plain_line", duration_s=3.0)
    c.step(10)
    now_s = time.monotonic
    for hour in (1, 2):
        monkeypatch.setattr("time.monotonic", lambda hours=hour: now_s() + 3600.0 * hours)
        c.step(5)
    outcome = c.run_to_end()
    assert outcome.report["failures"] == [] and outcome.digest == digest


def test_a_forged_message_is_taken_for_a_true_one(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0)
    c.step(5)
    forged = Position(500_000_000, "train_a", "main", 77.0, 0.01, 0.0, 0.01)
    c.publish(POSITION, forged)
    assert c.topic(POSITION).latest == forged
    c.publish("/not/ours", String(data="nobody knows it"))
    c.step()
    assert c.topic(POSITION).latest.chainage_m != 77.0


class PlainController(Node):
    """A zone controller that knows nothing: an ordinary node that answers every tick."""

    def __init__(self) -> None:
        super().__init__("mine", namespace="/somewhere")
        self._send = self.create_publisher(Odometry, POSITION, 10)
        self.create_subscription(Clock, "/clock", self._on_clock, 10)

    def _on_clock(self, message: Clock) -> None:
        where = Position(to_ns(message.clock), "train_a", "main", 50.0, 4.0, 0.0, 1.0)
        self._send.publish(where.to_msg())


def test_an_ordinary_node_takes_the_place_of_one_of_the_corridor(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0)
    c.add(PlainController, replaces="/wayside/zone_controller")
    outcome = c.run_to_end()
    assert outcome.report["failures"] == [] and outcome.report["missing_ticks"] == 0
    assert {view.chainage_m for view in c.topic(POSITION)} == {50.0}
    # It is wrong, and the truth says so.
    assert outcome.verdict == "unsafe"
    assert list(outcome.verdict.violations) == ["trains.train_a.phase_ranging.misleading_ticks"]


class Mute(ZoneControllerNode):
    """A zone controller that is not done with the sixth tick."""

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        """Answer every tick but one."""
        if stamp_ns != 500_000_000:
            super().on_tick(stamp_ns, items)


def test_a_node_that_may_be_late_is_not_waited_for(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=2.0)
    c.add(Mute, replaces="/wayside/zone_controller", within_s=0.2)
    report = c.run_to_end().report
    (failure,) = report["failures"]
    assert failure["node"] == "/wayside/zone_controller"
    assert failure["reason"] == "late by 0.2 s"
    # From the next tick on it is taken up again.
    ticks = [round(view.stamp_ns / 1e8) for view in c.topic(POSITION)]
    assert ticks == [tick for tick in range(20) if tick != 5]


def test_a_node_that_does_not_answer_fails_the_test(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=2.0, timeout_s=0.5)
    c.add(Mute, replaces="/wayside/zone_controller")
    with pytest.raises(NodeError, match=r"^/wayside/zone_controller at tick 5: no answer within"):
        c.run_to_end()
    # Once: who wants to know what comes of it goes on.
    report = c.run_to_end().report
    assert [each["node"] for each in report["failures"]] == ["/wayside/zone_controller"]
    assert "no answer within 0.5 s" in report["failures"][0]["reason"]


@pytest.mark.system
def test_placement_cannot_be_seen(corridor: Make) -> None:
    outcomes = {}
    for placement in ("one", "site"):
        c = corridor("plain_line", duration_s=3.0, placement=placement)
        c.step(5)
        assert c.topic(POSITION).count == 5
        c.switch_off("/wayside/wrs1")
        c.step(2)
        c.switch_on("/wayside/wrs1")
        outcomes[placement] = c.run_to_end()
    assert outcomes["one"].digest == outcomes["site"].digest
    assert outcomes["site"].report["processes"] == 9
    assert outcomes["site"].report["missing_ticks"] == 0


@pytest.mark.system
def test_a_process_is_killed_and_comes_back(corridor: Make) -> None:
    c = corridor("plain_line", placement="site")
    ranges = c.topic("/wayside/wrs1/zone1/range")
    c.step(10)
    c.kill("/wayside/wrs1")
    c.step(10)
    assert ranges.count == 10
    c.restart("/wayside/wrs1")
    # Nobody waits for it before it has been heard: that takes wall time, and a tick little.
    c.run_until(lambda: ranges.count > 10, within_s=40)
    c.step(5)  # what it had not yet said of earlier ticks comes first
    count = ranges.count
    c.step(10)
    assert ranges.count == count + 10
    failures = c.report()["failures"]
    assert [each["node"] for each in failures] == ["/wayside/wrs1"]
    assert "SIGKILL" in failures[0]["reason"]


OUTSIDE = """
import rclpy
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header, String
from rclpy.qos import DurabilityPolicy, QoSProfile

rclpy.init()
node = rclpy.create_node("mine")
latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
position = node.create_publisher(Odometry, "/wayside/zone_controller/train_a/position", 10)
done = node.create_publisher(Header, "/wayside/zone_controller/done", 10)
ready = node.create_publisher(String, "/ready", latched)

def on_clock(message):
    answer = Odometry()
    answer.header.frame_id, answer.child_frame_id = "main", "train_a"
    answer.header.stamp = message.clock
    answer.pose.pose.position.x = 50.0
    answer.pose.covariance[0] = 4.0
    position.publish(answer)
    done.publish(Header(stamp=message.clock))

node.create_subscription(Clock, "/clock", on_clock, 10)
while not (position.get_subscription_count() and done.get_subscription_count()):
    rclpy.spin_once(node, timeout_sec=0.01)
ready.publish(String(data="/wayside/zone_controller"))
rclpy.spin(node)
"""


@pytest.mark.system
def test_a_node_that_a_command_starts_is_waited_for(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0)
    c.add(command=[sys.executable, "-c", OUTSIDE], replaces="/wayside/zone_controller")
    outcome = c.run_to_end()
    assert outcome.report["failures"] == [] and outcome.report["missing_ticks"] == 0
    assert [view.chainage_m for view in c.topic(POSITION)] == [50.0] * 50


@pytest.mark.system
def test_a_node_that_runs_already_beside_the_others_hears_every_tick(
    corridor: Make, ros_domain: int, tmp_path: Path
) -> None:
    code = OUTSIDE.replace("/wayside/zone_controller/done", "/my/monitor/done")
    code = code.replace('data="/wayside/zone_controller"', 'data="/my/monitor"')
    code = code.replace("/wayside/zone_controller/train_a/position", "/my/monitor/heard")
    code = code.replace("position.get_subscription_count() and ", "")
    code = code.replace("position.publish(answer)", "print(message.clock.sec, flush=True)")
    heard = tmp_path / "heard"
    with heard.open("w") as output:
        environment = {**os.environ, "ROS_DOMAIN_ID": str(ros_domain)}
        monitor = subprocess.Popen([sys.executable, "-c", code], stdout=output, env=environment)
    try:
        c = corridor("plain_line", duration_s=5.0, domain=ros_domain)
        c.add(name="/my/monitor")
        outcome = c.run_to_end()
        assert outcome.report["failures"] == []
        assert len(heard.read_text().split()) == 50
    finally:
        monitor.kill()
        monitor.wait()


@pytest.mark.system
def test_a_command_that_ends_fails_the_test(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=5.0, timeout_s=1.0)
    command = [sys.executable, "-c", "raise SystemExit(7)"]
    c.add(command=command, replaces="/wayside/zone_controller")
    with pytest.raises(NodeError, match="ended with 7"):
        c.run_to_end()


def test_every_hazard_is_a_figure_of_a_report(corridor: Make) -> None:
    found = set()
    for scenario in ("located_block", "located_codes", "failing_bus"):
        c = corridor(scenario)
        c.step(3)
        trains = "|".join(train.name for train in c.scenario.trains)
        found |= {
            re.sub(rf"^trains\.({trains})\.", "trains.*.", path) for path in c.verdict().counters
        }
        c.close()
    assert found == {path for each in subsystems() for path in each.hazards}


@pytest.mark.parametrize("wrong", [lambda _: 1 / 0, lambda: None, lambda _: True])
def test_an_interceptor_that_fails_fails_the_test(corridor: Make, wrong: Any) -> None:
    c = corridor("plain_line", duration_s=2.0)
    c.step(2)
    c.intercept(POSITION, wrong)
    with pytest.raises(InterceptorError, match=f"interceptor of {POSITION}: "):
        c.step()
    assert c.topic(POSITION).count == 3  # the message has passed as it was
    assert not c.report()["failures"]


def test_a_subscription_that_is_destroyed_hears_no_more(corridor: Make) -> None:
    class Brief(Node):
        def __init__(self) -> None:
            super().__init__("brief")
            self.seen = 0
            self.only = self.create_subscription(Clock, "/clock", self._count, 10)

        def _count(self, _: Clock) -> None:
            self.seen += 1
            if self.seen == 10:
                self.destroy_subscription(self.only)

    made: list[Brief] = []
    c = corridor("plain_line", duration_s=4.0)
    c.add(lambda: made.append(Brief()) or made[0])
    c.run_to_end()
    assert made[0].seen == 10


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"placement": "two"}, "placement: 'two': must be one of one, site, node"),
        ({"domain": 999}, "domain: 999: must be from 0 to 232"),
    ],
)
def test_a_wrong_argument_is_one_line(corridor: Make, arguments: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        corridor("plain_line", **arguments).step()


def test_what_cannot_be_added_is_refused_at_once(corridor: Make) -> None:
    c = corridor("plain_line")
    c.add(PlainController, replaces="/wayside/zone_controller")
    with pytest.raises(InputError, match="is replaced already"):
        c.add(PlainController, replaces="/wayside/zone_controller")
    for wrong in ({"node": Counter, "command": ["ls"]}, {"command": "ls -l"}, {}):
        with pytest.raises(ValueError, match=r"node|command"):
            c.add(**wrong)
    with pytest.raises(TypeError, match="3 is no node"):
        c.add(3)
    with pytest.raises(ValueError, match="within_s"):
        c.add(Counter, within_s=-1.0)
