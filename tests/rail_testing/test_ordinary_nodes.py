"""Nodes that know nothing of the bench: their timers, what they say and ask for at their start."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

from rail_corridor.errors import InputError
from rail_testing import Corridor, NodeError

Make = Callable[..., Corridor]
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
