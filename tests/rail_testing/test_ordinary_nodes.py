"""Nodes that know nothing of the bench: their timers, what they say and ask for at their start."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from rail_corridor.errors import InputError
from rail_corridor.stepped.corridor import StalledError
from rail_corridor.stepped.topics import NotKnownError
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import to_ns
from rail_testing import Corridor, NodeError

Make = Callable[..., Corridor]
POSITION = "/wayside/zone_controller/train_a/position"
KEPT = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)
SIMULATED = [Parameter("use_sim_time", value=True)]


class Timed(Node):
    """Says at its start what it is, and later how late it is by the clock of the simulation."""

    def __init__(self) -> None:
        super().__init__("timed", parameter_overrides=SIMULATED)
        self._send = self.create_publisher(String, "/timed/is", KEPT)
        for word in ("made", "ready", "here"):
            self._send.publish(String(data=word))
        self.called_at_ns: list[int] = []
        self.create_timer(0.2, lambda: self.called_at_ns.append(self.get_clock().now().nanoseconds))


class Asking(Node):
    """Wants what was said before it came."""

    def __init__(self) -> None:
        super().__init__("asking")
        self.heard: dict[str, list[str]] = {}
        self.ask("/timed/is")
        self.ask("/world/scenario")

    def ask(self, topic: str, profile: QoSProfile = KEPT) -> list[str]:
        """Subscribe; return what is heard."""
        heard: list[str] = []
        self.create_subscription(String, topic, lambda said: heard.append(said.data), profile)
        self.heard[topic] = heard
        return heard


def test_timers_in_simulated_time_are_due_at_their_ticks(corridor: Make) -> None:
    c = corridor("plain_line")
    timed = c.add(Timed)
    c.run_for(2.0)  # up to 1.9 s
    assert timed.node.called_at_ns == [200_000_000 * number for number in range(1, 10)]


def test_what_is_said_at_the_start_is_seen(corridor: Make) -> None:
    c = corridor("plain_line")
    c.add(Timed)
    c.step()
    assert [said.data for said in c.topic("/timed/is")] == ["made", "ready", "here"]
    assert c.topic("/world/scenario").count == 1


def test_a_late_subscription_hears_as_much_as_is_kept(corridor: Make) -> None:
    c = corridor("plain_line")
    c.add(Timed)
    entry = c.add(Asking)
    c.step(3)
    asking = entry.node
    assert asking.heard["/timed/is"] == ["ready", "here"]
    assert len(asking.heard["/world/scenario"]) == 1
    again = asking.ask("/timed/is")
    volatile = asking.ask("/timed/is", QoSProfile(depth=10))
    one = asking.ask("/timed/is", QoSProfile(depth=1, durability=KEPT.durability))
    c.step()
    assert (again, volatile, one) == (["ready", "here"], [], ["here"])


@pytest.mark.parametrize("overrides", [SIMULATED, []], ids=["simulated", "wall"])
def test_a_timer_that_raises_fails_the_test(corridor: Make, overrides: list[Any]) -> None:
    class Broken(Node):
        def __init__(self) -> None:
            super().__init__("broken", parameter_overrides=overrides)
            self.create_timer(0.001, self.fail)

        def fail(self) -> None:
            raise ValueError("no more")

    c = corridor("plain_line")
    c.add(Broken)
    with pytest.raises(NodeError, match=r"/broken (at tick \d+|before .*): ValueError: no more"):
        c.run_to_end()


def test_calls_that_mean_nothing_are_one_line(corridor: Make) -> None:
    c = corridor("plain_line")
    for call, said in (
        (lambda: c.run_for(-1), "seconds: -1: must be a time, not below 0"),
        (lambda: c.run_for(float("nan")), "seconds: nan: must be"),
        (lambda: c.step(-1), "ticks: -1: must be a whole number"),
        (lambda: c.step(1.5), "ticks: 1.5: must be a whole number"),
        (lambda: c.run_until(lambda: True, within_s=-1), "within_s: -1: must be"),
        (lambda: c.inject("dead"), "faults: 'dead': must be a mapping"),
        (lambda: corridor(None), "scenario: None: must be a name"),
        (lambda: c.publish("/clock", String()), "/clock: .*: must be of Clock"),
    ):
        with pytest.raises(InputError, match=f"^{said}"):
            call()
    for wrong in (lambda: c.always(3), lambda: c.run_until(3, within_s=1)):
        with pytest.raises(TypeError, match="a lambda, not 3"):
            wrong()
    assert c.ticks == 0


def test_of_two_conditions_in_a_line_the_one_that_fails_is_quoted(corridor: Make) -> None:
    c = corridor("plain_line")
    c.always(lambda: c.ticks > 0), c.always(lambda: c.ticks < 3)
    with pytest.raises(AssertionError, match=r"does not hold: lambda: c\.ticks < 3"):
        c.run_for(1.0)


class Quiet(Node):
    """Takes the place of a controller, and says nothing."""

    def __init__(self) -> None:
        super().__init__("quiet")


def test_an_ordinary_node_that_sends_nothing_fails_the_test(corridor: Make) -> None:
    c = corridor("plain_line", timeout_s=0.5)
    c.add(Quiet, replaces="/wayside/zone_controller")
    with pytest.raises(NodeError, match=r"^/wayside/zone_controller at tick 0: has sent nothing"):
        c.run_to_end()


def test_a_default_of_a_callback_is_no_second_argument(corridor: Make) -> None:
    heard: list[tuple[str, bool]] = []

    class Tagging(Node):
        def __init__(self) -> None:
            super().__init__("tagging")
            self.create_subscription(
                String, "/world/scenario", lambda m, tag="mine": heard.append((tag, bool(m))), KEPT
            )
            self.create_subscription(
                String, "/world/scenario", lambda m, info: heard.append(("", info == {})), KEPT
            )

    c = corridor("plain_line")
    c.add(Tagging)
    c.step()
    assert heard == [("mine", True), ("", True)]


def test_a_node_under_test_comes_back_as_itself(corridor: Make) -> None:
    class Counting(Node):
        def __init__(self) -> None:
            super().__init__("counting")
            self._send = self.create_publisher(Odometry, POSITION, 10)
            self._count = 0
            self.create_subscription(Clock, "/clock", self._answer, 10)

        def _answer(self, message: Clock) -> None:
            self._count += 1
            where = Position(
                to_ns(message.clock), "train_a", "main", 1.0 * self._count, 4.0, 0.0, 1.0
            )
            self._send.publish(where.to_msg())

    c = corridor("plain_line")
    c.add(Counting, replaces="/wayside/zone_controller")
    c.step(5)
    assert c.topic(POSITION).latest.chainage_m == 5.0
    c.restart("/wayside/zone_controller")
    c.step(3)
    assert c.topic(POSITION).latest.chainage_m == 3.0


def test_what_begins_to_be_sent_later_is_kept_whole(corridor: Make) -> None:
    class Late(Node):
        def __init__(self) -> None:
            super().__init__("late")
            self._ticks = 0
            self.create_subscription(Clock, "/clock", self._count, 10)

        def _count(self, _: Clock) -> None:
            self._ticks += 1
            if self._ticks == 3:
                self._send = self.create_publisher(String, "/late", 10)
            if self._ticks >= 3:
                self._send.publish(String(data=str(self._ticks)))

    c = corridor("plain_line")
    c.add(Late)
    c.step(2)
    c.publish("/mine", String(data="first"))
    c.step(8)
    assert [said.data for said in c.topic("/late")] == [str(n) for n in range(3, 11)]
    assert [said.data for said in c.topic("/mine")] == ["first"]
    assert {"/late", "/mine"} <= c.histories.keys()


def test_messages_that_go_round_for_ever_are_a_stalled_tick(corridor: Make) -> None:
    class Echo(Node):
        def __init__(self) -> None:
            super().__init__("echo")
            self._send = self.create_publisher(String, "/round", 10)
            self.create_subscription(String, "/round", self._send.publish, 10)
            self.create_subscription(Clock, "/clock", lambda _: self._send.publish(String()), 10)

    c = corridor("plain_line", timeout_s=0.5)
    c.add(Echo)
    c.start()
    with pytest.raises(StalledError, match="messages wait on /round"):
        c._session._run_until(1, patience_s=1.0)  # type: ignore[union-attr]


def test_a_node_that_computes_for_long_makes_nobody_else_late(
    corridor: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    computed_s = [0.0]

    class Slow(Node):
        def __init__(self) -> None:
            super().__init__("slow")
            self.create_subscription(Clock, "/clock", self._compute, 10)

        def _compute(self, _: Clock) -> None:
            """Take a minute, between two looks of the world whether somebody is late."""
            world = c._session.world  # type: ignore[union-attr]
            world._check()
            computed_s.append(60.0)
            world._check()

    c = corridor("plain_line")
    c.add(Slow)
    c.start()
    world = c._session.world  # type: ignore[union-attr]
    monkeypatch.setattr(world, "steady_s", lambda: time.monotonic() + sum(computed_s))
    c.step(2)
    assert sum(computed_s) == 120.0 and c.report()["failures"] == []


def test_a_tick_is_not_stepped_from_within(corridor: Make) -> None:
    class Impatient(Node):
        def __init__(self) -> None:
            super().__init__("impatient")
            self.create_subscription(Clock, "/clock", lambda _: c.step(), 10)

    c = corridor("plain_line")
    c.add(Impatient)
    with pytest.raises(NodeError, match="a tick is under way"):
        c.step()


def test_a_maintenance_tool_switches_a_station_by_its_service(corridor: Make) -> None:
    class Tool(Node):
        def __init__(self) -> None:
            super().__init__("tool")
            self._client = self.create_client(ChangeState, "/wayside/wrs1/change_state")
            self.create_timer(0.01, self._ask)
            self.answers: list[bool] = []
            self._asked = False

        def _ask(self) -> None:
            if self._asked or not self._client.service_is_ready():
                return
            self._asked = True
            request = ChangeState.Request()
            request.transition.id = Transition.TRANSITION_DEACTIVATE
            answer = self._client.call_async(request)
            answer.add_done_callback(lambda done: self.answers.append(done.result().success))

    c = corridor("plain_line", switches=True)
    tool = c.add(Tool)
    c.run_until(lambda: tool.node.answers, within_s=59)
    assert tool.node.answers == [True]
    said = {event["message"] for event in c.report()["events"]}
    assert "switched off" in said


def test_after_the_end_nothing_is_done_to_it(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=0.5)
    c.run_to_end()
    for call in (
        lambda: c.kill("/wayside/wrs1"),
        lambda: c.inject({"kind": "dead_station", "station": "wrs1"}),
        lambda: c.publish("/mine", String()),
        lambda: c.always(lambda: False),
    ):
        with pytest.raises(InputError, match="the run has come to its end"):
            call()
    with pytest.raises(InputError, match="kind: 'dead_statio': is no kind of fault, did you mean"):
        corridor("plain_line").inject({"kind": "dead_statio"})


@pytest.mark.system
def test_what_is_sent_elsewhere_is_not_intercepted(corridor: Make) -> None:
    c = corridor("plain_line", placement="site")
    with pytest.raises(InputError, match="is sent in another process"):
        c.intercept(POSITION, lambda message: None)
    assert c.intercept("/world/state", lambda message: message) is not None


def test_a_command_that_cannot_be_started_is_one_line(corridor: Make) -> None:
    c = corridor("plain_line")
    c.add(command=["no_such_program"], replaces="/wayside/zone_controller")
    with pytest.raises(InputError, match="command: 'no_such_program': cannot be started: No such"):
        c.step()


def test_what_is_not_known_stays_so_in_computations(corridor: Make) -> None:
    c = corridor("plain_line", duration_s=2.0)
    position = c.topic(POSITION)
    c.kill("/wayside/wrs1")
    c.step(8)
    assert not position.latest.known
    for condition in (
        lambda: abs(position.latest.chainage_m - 3.0) < 1.0,
        lambda: not 2.0 * position.latest.chainage_m > 5.0,
        lambda: position.latest.chainage_m == 3.0,
        lambda: bool(position.latest.speed_mps),
    ):
        with pytest.raises(NotKnownError):
            condition()
    value = position.latest.chainage_m
    assert math.isnan(value) and value != value


def test_a_condition_tells_of_topics_that_it_was_given(corridor: Make) -> None:
    c = corridor("plain_line")
    position = c.topic(POSITION)
    with pytest.raises(AssertionError, match=r"last seen: <.*/train_a/position: 10 messages"):
        c.run_until(lambda: position.latest.chainage_m > 9999, within_s=1.0)
