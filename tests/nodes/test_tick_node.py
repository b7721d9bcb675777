"""The common base of nodes, with equipment and a medium made for the purpose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import make_plan
from rail_msgs_py.decoders import table_row
from rail_msgs_py.parameters import ParameterError, parameter
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.tick_node import EquipmentNode, TickNode
from rail_msgs_py.topics.column import Column
from rail_msgs_py.topics.qos import STREAM
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.world import STATE
from rail_onboard.track_code.receiver_node import TrackCodeReceiverNode
from rail_world.medium_node import MediumNode, MediumParameters
from rail_world.ranging.description import RadioDescription
from rail_world.train_bus.description import BusDescription

TICK_NS = 100_000_000


def topic(pattern: str, column: str) -> Topic:
    return Topic(
        pattern, Float64MultiArray, STREAM, Table, "", "", "", (Column(column, "a number"),)
    )


PULSES = topic("/wayside/{site}/head/pulses", "pulses")
COUNT = topic("/wayside/{site}/counter/count", "count")


@dataclass(frozen=True)
class CounterParameters:
    """Parameters of a counter."""

    most: int = parameter(100, "count at which it stops", low=0, high=1000)
    timeout_s: float = parameter(0.2, "wall time of a head", unit="s", low=0.05, high=60.0)


class Counter(EquipmentNode[CounterParameters], name="counter", namespace="/wayside/ac1"):
    """Adds the pulses of every tick; negative ones are none that it can work with."""

    def setup(self) -> None:
        if self._p.most == 13:
            raise ValueError("most: 13: brings bad luck\nand two lines")
        self._pulses = self.inputs.port(PULSES, table_row(PULSES), site=self.place)
        self.inputs.clock()
        self._send = self.table_out(COUNT, (self.place,), awaited=True, site=self.place)

    def start_over(self) -> None:
        self._count = 0.0

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        pulses = items.get(self._pulses, [-0.5])[0]
        if pulses < -1.0:
            raise ArithmeticError("less than no pulse")
        self._count = min(self._count + pulses, float(self._p.most))
        self._send(stamp_ns, np.array([[self._count]]))


class Site:
    """A counter, and the test as the head that it listens to."""

    def __init__(self, graph: Any, **parameters: Any) -> None:
        self.graph = graph
        self._clock, self._pulses = graph.sender(CLOCK), graph.sender(PULSES, site="ac1")
        self._box = graph.mailbox(COUNT, site="ac1")
        self.node = Counter(context=graph.context, parameters=parameters)
        graph.add(self.node)
        graph.connect("/wayside/ac1/counter")

    def send(self, tick: int, pulses: float | None) -> None:
        self._clock(clock_to_cdr(tick * TICK_NS))
        if pulses is not None:
            row = np.array([[pulses]])
            self._pulses(TableWriter(("ac1",), PULSES.columns).write(tick * TICK_NS, row))

    def tick(self, tick: int, pulses: float | None) -> float:
        before = len(self._box)
        self.send(tick, pulses)
        self.graph.wait(lambda: len(self._box) > before)
        answer = Table.from_msg(self._box[-1])
        assert answer.stamp_ns == tick * TICK_NS
        return answer.row("ac1")["count"]

    def switch(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert self.graph.call(ChangeState, "/wayside/ac1/counter/change_state", request).success


def test_equipment_answers_every_tick_with_its_parameters(graph: Any) -> None:
    site = Site(graph, most=5)
    assert [site.tick(tick, 2.0) for tick in range(4)] == [2.0, 4.0, 5.0, 5.0]


def test_equipment_that_is_switched_on_knows_nothing_of_before(graph: Any) -> None:
    site = Site(graph)
    assert site.tick(0, 3.0) == 3.0
    site.switch(Transition.TRANSITION_DEACTIVATE)
    assert site.tick(1, 3.0) == 6.0  # that it is off is the business of its kind
    assert not site.node.switched_on
    site.switch(Transition.TRANSITION_ACTIVATE)
    assert site.node.switched_on
    assert site.tick(2, 3.0) == 3.0


def test_a_missing_port_is_named_and_the_tick_answered_without_it(graph: Any) -> None:
    site = Site(graph)
    assert site.tick(0, None) == -0.5
    graph.wait(lambda: graph.failed)
    (failed,) = graph.failed
    assert failed.name == "/wayside/ac1/head"
    assert site.tick(1, None) == -1.0  # at once
    assert len(graph.failed) == 1


def test_an_exception_is_reported_and_the_next_tick_answered(graph: Any) -> None:
    site = Site(graph)
    site.send(0, -7.0)

    def reports() -> list[Any]:
        statuses = (status for array in graph.diagnostics for status in array.status)
        return [status for status in statuses if status.name == "/wayside/ac1/counter: software"]

    graph.wait(reports)
    (status,) = reports()
    assert status.level == DiagnosticStatus.ERROR
    assert status.message == "ArithmeticError: less than no pulse"
    assert site.tick(1, 1.0) == 1.0


def test_names_are_those_of_the_kind_unless_others_are_given(graph: Any) -> None:
    default = graph.add(Counter(context=graph.context, services=False))
    other = Counter("c2", namespace="/wayside/ac2", context=graph.context, services=False)
    graph.add(other)
    assert default.get_fully_qualified_name() == "/wayside/ac1/counter"
    assert (other.get_fully_qualified_name(), other.place) == ("/wayside/ac2/c2", "ac2")
    assert Counter.parameter_type is CounterParameters


def test_a_namespace_given_on_the_command_line_is_that_of_the_topics(ros_domain: int) -> None:
    context = rclpy.Context()
    rclpy.init(
        args=["--ros-args", "-r", "__ns:=/wayside/ac7"],
        context=context,
        domain_id=ros_domain,
        signal_handler_options=SignalHandlerOptions.NO,
    )
    node = Counter(context=context, services=False)
    try:
        assert node.place == "ac7"
        names = {name for name, _ in node.get_topic_names_and_types()}
        assert {"/wayside/ac7/head/pulses", "/wayside/ac7/counter/count"} <= names
    finally:
        node.destroy_node()
        rclpy.try_shutdown(context=context)


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"most": 2000}, "counter: most: "),
        ({"most": 13}, "counter: most: 13: brings bad luck"),
    ],
)
def test_wrong_parameters_are_one_line_that_begins_with_the_node(
    graph: Any, wrong: dict[str, Any], line: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        Counter(context=graph.context, parameters=wrong, services=False)
    assert str(caught.value).startswith(line)
    assert "\n" not in str(caught.value)


class EchoMedium(MediumNode[MediumParameters], name="echo", namespace="/world"):
    """Delivers to each site what its head sends."""

    def setup(self) -> None:
        self.trains = len(self.part("ranging", RadioDescription).trains)
        self._state = self.state_port(self.inputs, self.trains)
        self._out = self.table_out(COUNT, ("ac1",), awaited=True, site="ac1")

    def on_tick(self, stamp_ns: int, items: dict[str, Any]) -> None:
        if stamp_ns == 0:
            raise ArithmeticError("no first tick")
        self._out(stamp_ns, np.array([[items[self._state].sum()]]))


class BusEcho(EchoMedium, name="bus_echo", namespace="/world"):
    """Needs a part that the world does not have."""

    def setup(self) -> None:
        self.part("train_bus", BusDescription)


@pytest.fixture
def world_file(tmp_path: Path) -> str:
    make_plan(load_scenario("plain_line"), tmp_path)
    return str(tmp_path / "world.json")


def test_a_medium_is_done_once_it_has_delivered(graph: Any, world_file: str) -> None:
    state, done = graph.sender(STATE), graph.mailbox(DONE, node="/world/echo")
    box = graph.mailbox(COUNT, site="ac1")
    medium = EchoMedium(context=graph.context, parameters={"world_file": world_file})
    graph.add(medium)
    graph.connect("/world/echo")
    values = np.ones((medium.trains, len(STATE.columns)))
    rows = tuple(f"t{number}" for number in range(medium.trains))
    for tick in range(2):
        state(TableWriter(rows, STATE.columns).write(tick * TICK_NS, values))
    graph.wait(lambda: done and box)
    assert [message.stamp.nanosec for message in done] == [TICK_NS]  # not of the one that failed
    assert Table.from_msg(box[0]).row("ac1")["count"] == values.sum()


def test_a_medium_without_its_part_of_the_world_says_so(graph: Any, world_file: str) -> None:
    with pytest.raises(ParameterError) as caught:
        BusEcho(context=graph.context, parameters={"world_file": world_file}, services=False)
    assert str(caught.value) == f"bus_echo: world_file: {world_file}: describes no train_bus"


def test_a_medium_that_is_switched_off_is_dead_air(graph: Any, world_file: str) -> None:
    medium = EchoMedium(context=graph.context, parameters={"world_file": world_file})
    legs = [
        medium.leg(lambda stamp_ns, items: heard.append(items), 1.0),
    ]
    heard: list[dict[str, Any]] = []
    for on in (True, False):
        medium.switched_on = on
        legs[0]._step(0, {medium._state: "truth", "port": "block"})
    assert heard == [{medium._state: "truth", "port": "block"}, {medium._state: "truth"}]
    medium.destroy_node()


class Plain(TickNode[MediumParameters], name="plain", namespace="/wayside"):
    """Does nothing, and cannot be switched off."""

    def setup(self) -> None:
        self.inputs.clock()


def test_a_node_that_cannot_be_switched_off_has_no_lifecycle(graph: Any) -> None:
    plain = graph.add(Plain(context=graph.context))
    services = {name for name, _ in plain.get_service_names_and_types_by_node("plain", "/wayside")}
    assert "/wayside/plain/get_parameters" in services
    assert "/wayside/plain/change_state" not in services


@pytest.mark.parametrize(
    ("from_s", "to_s", "counts"),
    [
        # At the edge of a tick, between two, in none, over the first one.
        ((0.2,), (0.4,), [1, 2, None, None, 1, 2, 3]),
        ((0.15,), (0.301,), [1, 2, None, None, 1, 2, 3]),
        ((0.31,), (0.39,), [1, 2, 3, 4, 1, 2, 3]),
        ((0.0, 0.5), (0.1, 0.6), [None, 1, 2, 3, 4, None, 1]),
    ],
)
def test_equipment_is_switched_off_at_simulated_times(
    graph: Any, from_s: tuple[float], to_s: tuple[float], counts: list[int | None]
) -> None:
    site = Site(graph, off_from_s=from_s, off_to_s=to_s)
    seen: list[float | None] = []
    for tick in range(7):
        count = site.tick(tick, 1.0)
        seen.append(count if site.node.switched_on else None)
        assert site.node._is_active is site.node.switched_on
    assert seen == counts
    if None in counts:
        said = f"switched off from {from_s[0]:g} s to {to_s[0]:g} s"
        graph.wait(lambda: said in [message for _, message in graph.told("counter: equipment")])


def test_what_is_late_is_judged_by_its_own_stamp(graph: Any) -> None:
    site = Site(graph, off_from_s=(0.2,), off_to_s=(0.4,))
    on = {}
    for tick in (0, 1, 3, 1, 4, 3, 5):
        site.node.begin_step(tick * TICK_NS)
        on[len(on), tick] = site.node.switched_on
    assert [tick for (_, tick), is_on in on.items() if is_on] == [0, 1, 1, 4, 5]


def test_who_switches_by_hand_keeps_what_he_has_set(graph: Any) -> None:
    site = Site(graph, off_from_s=(0.2,), off_to_s=(0.4,))
    site.switch(Transition.TRANSITION_DEACTIVATE)
    site.tick(1, 1.0)
    assert not site.node.switched_on
    site.tick(2, 1.0)
    site.switch(Transition.TRANSITION_ACTIVATE)  # in vain: the fault lasts
    site.tick(3, 1.0)
    assert not site.node.switched_on
    site.tick(4, 1.0)
    assert site.node.switched_on
    site.switch(Transition.TRANSITION_DEACTIVATE)
    site.tick(5, 1.0)
    assert not site.node.switched_on


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        ({"off_from_s": (1.0,)}, "off_to_s: (): one for each of off_from_s, (1.0,)"),
        ({"off_from_s": (1.0,), "off_to_s": (1.0,)}, "each must be after"),
        ({"off_from_s": (1.0, 2.0), "off_to_s": (2.0, 3.0)}, "must be in order and apart"),
    ],
)
def test_off_times_that_do_not_fit_are_one_line(
    graph: Any, wrong: dict[str, Any], line: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        Counter(context=graph.context, parameters=wrong, services=False)
    assert line in str(caught.value)


def test_a_receiver_that_is_switched_on_again_has_received_nothing(graph: Any) -> None:
    receiver = graph.add(TrackCodeReceiverNode(context=graph.context, services=False))
    before = receiver._selector, receiver._receivers
    receiver.trigger_deactivate()
    assert (receiver._selector, receiver._receivers) == before
    receiver.trigger_activate()
    assert receiver._selector is not before[0]
    assert all(receiver._receivers[hz] is not before[1][hz] for hz in before[1])
