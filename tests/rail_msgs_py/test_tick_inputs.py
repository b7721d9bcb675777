"""The inputs of a step: when it runs, with what, and who is named when something is overdue."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from rail_msgs_py.decoders import bare_stamp, samples, stamped, table, table_row
from rail_msgs_py.headers import header_to_cdr
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import TableWriter
from rail_msgs_py.tick_inputs import TickInputs
from rail_msgs_py.topics.ranging import RANGE, WRS_TX
from rail_msgs_py.topics.topic import Topic
from rail_msgs_py.topics.track_code import OCCUPANCY
from rail_msgs_py.topics.train_radio import BACKBONE_DOWN, BACKBONE_UP, DOWN_TELEGRAMS
from rail_msgs_py.topics.world import ODOMETER
from rail_msgs_py.waveform import Waveform, silence

TICK_NS = 100_000_000
TIMEOUT_S = 2.0


class Recorder:
    """What a `TickInputs` needs of a node; its wall clock is in the hands of the test."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self.times: list[int] = []
        self.steps: list[int] = []
        self.feed: dict[str, Callable[[bytes], None]] = {}
        self.failed: list[tuple[str, str]] = []
        self.listens: list[Topic] = []
        self._timers: list[Callable[[], None]] = []
        self.ticks: list[tuple[int, dict[str, Any]]] = []

    def items_in(
        self,
        topic: Topic,
        decode: Callable[[bytes], tuple[int, Any]],
        callback: Callable[[int, Any], None],
        **parts: object,
    ) -> None:
        self.feed[topic.name(**parts)] = lambda raw: callback(*decode(raw))

    def listen(self, topic: Topic, callback: Callable[[Any], None], **parts: object) -> None:
        self.listens.append(topic)

    def publisher(self, topic: Topic, **parts: object) -> Any:
        self.listens.append(topic)
        return self

    def publish(self, message: Any) -> None:
        self.failed.append((message.name, message.message))

    def look_every(self, period_s: float, callback: Callable[[], None]) -> None:
        self._timers.append(callback)

    def steady_s(self) -> float:
        return self.now_s

    def at_tick(self, stamp_ns: int) -> None:
        self.times.append(stamp_ns)

    def begin_step(self, stamp_ns: int) -> None:
        self.steps.append(stamp_ns)

    def get_fully_qualified_name(self) -> str:
        return "/node"

    def wait(self, seconds: float) -> None:
        """Let time pass, with a look ten times a second."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.now_s = min(self.now_s + 0.1, end_s)
            for timer in self._timers:
                timer()

    def step(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self.ticks.append((stamp_ns, items))


@pytest.fixture
def node() -> Recorder:
    return Recorder()


def row(occupied: float) -> list[float]:
    return [occupied, *[0.0] * (len(OCCUPANCY.columns) - 1)]


def occupancy(circuit: str, tick: int, occupied: float = 0.0) -> bytes:
    writer = TableWriter((circuit,), OCCUPANCY.columns)
    return writer.write(tick * TICK_NS, np.array([row(occupied)]))


def clock(tick: int) -> bytes:
    return clock_to_cdr(tick * TICK_NS)


def open_circuits(node: Recorder, inputs: TickInputs, **how: Any) -> dict[str, str]:
    """Open the ports of two circuits and of the clock; names by circuit."""
    inputs.clock()
    return {
        circuit: inputs.port(OCCUPANCY, table_row(OCCUPANCY), circuit=circuit, **how)
        for circuit in ("tc2", "tc1")
    }


def test_a_step_runs_once_a_tick_whatever_the_order_of_arrival() -> None:
    for order in itertools.permutations(range(3)):
        node = Recorder()
        ports = open_circuits(node, TickInputs(node, node.step, TIMEOUT_S))
        arrivals = [("/clock", clock(0))]
        arrivals += [(ports[c], occupancy(c, 0, n)) for n, c in enumerate(ports)]
        for count, index in enumerate(order):
            assert node.ticks == [], count
            name, raw = arrivals[index]
            node.feed[name](raw)
        assert node.ticks == [(0, {"/clock": None, ports["tc1"]: row(1.0), ports["tc2"]: row(0.0)})]
        # Sums over the items are repeatable: they come in the order of the names.
        assert list(node.ticks[0][1]) == sorted(node.ticks[0][1])


def test_a_delayed_port_gives_what_was_sent_a_tick_before(node: Recorder) -> None:
    ports = open_circuits(node, TickInputs(node, node.step, TIMEOUT_S), delay_ns=TICK_NS)
    node.feed["/clock"](clock(0))
    for circuit, port in ports.items():
        node.feed[port](occupancy(circuit, 0, 1.0))
    assert [stamp_ns for stamp_ns, _ in node.ticks] == [0]
    node.feed["/clock"](clock(1))
    assert [[items[port] for port in ports.values()] for _, items in node.ticks] == [
        [None, None],
        [row(1.0), row(1.0)],
    ]


def test_nobody_was_late_while_this_process_was_held_up(node: Recorder) -> None:
    ports = open_circuits(node, TickInputs(node, node.step, TIMEOUT_S))
    node.feed[ports["tc1"]](occupancy("tc1", 0))
    node.feed["/clock"](clock(0))
    node.wait(1.0)
    node.now_s += 100.0  # a debugger
    node.wait(TIMEOUT_S - 1.3)
    assert node.failed == []
    node.wait(0.6)
    assert [name for name, _ in node.failed] == ["/wayside/tc2/track_code"]


def test_the_owner_of_an_overdue_port_is_named_and_its_item_missing(node: Recorder) -> None:
    ports = open_circuits(node, TickInputs(node, node.step, TIMEOUT_S))
    node.feed[ports["tc1"]](occupancy("tc1", 0))
    node.wait(10 * TIMEOUT_S)
    assert node.failed == []  # nobody is late before the tick has begun
    node.feed["/clock"](clock(0))
    node.wait(TIMEOUT_S)
    assert node.ticks == []
    node.wait(0.1)
    assert [name for name, _ in node.failed] == ["/wayside/tc2/track_code"]
    assert node.ticks == [(0, {"/clock": None, ports["tc1"]: row(0.0)})]
    # The next tick does not wait for it, until it is there again.
    node.feed[ports["tc1"]](occupancy("tc1", 1))
    node.feed["/clock"](clock(1))
    assert len(node.ticks) == 2
    node.feed[ports["tc2"]](occupancy("tc2", 2))
    node.feed["/clock"](clock(2))
    assert len(node.ticks) == 2
    node.feed[ports["tc1"]](occupancy("tc1", 2))
    assert set(node.ticks[2][1]) == {"/clock", *ports.values()}


def test_the_trigger_is_waited_for_indefinitely(node: Recorder) -> None:
    inputs = TickInputs(node, node.step, TIMEOUT_S)
    odometer = inputs.trigger(ODOMETER, table_row(ODOMETER), train="train_1")
    row = TableWriter(("train_1",), ODOMETER.columns)
    node.feed[odometer](row.write(0, np.array([[1.0, 2.0]])))
    node.wait(10 * TIMEOUT_S)
    assert node.failed == []
    assert node.ticks == [(0, {odometer: [1.0, 2.0]})]


def test_without_a_timeout_nobody_is_named(node: Recorder) -> None:
    ports = open_circuits(node, TickInputs(node, node.step))
    node.feed["/clock"](clock(0))
    node.wait(1e6)
    assert node.failed == node.ticks == node.listens == []
    for circuit, port in ports.items():
        node.feed[port](occupancy(circuit, 0))
    assert len(node.ticks) == 1


def test_a_port_that_the_node_feeds_itself(node: Recorder) -> None:
    inputs = TickInputs(node, node.step, TIMEOUT_S)
    inputs.clock()
    put = inputs.internal_port("bus", "/world/bus_medium", delay_ns=TICK_NS)
    node.feed["/clock"](clock(0))
    assert node.ticks == [(0, {"/clock": None, "bus": None})]
    put(0, "answer")
    node.feed["/clock"](clock(1))
    assert node.ticks[1] == (TICK_NS, {"/clock": None, "bus": "answer"})
    node.feed["/clock"](clock(2))
    node.wait(TIMEOUT_S + 0.1)
    assert [name for name, _ in node.failed] == ["/world/bus_medium"]


class TwoLegs:
    """Station by station up, then one by one down, as of a medium that is passed twice."""

    def __init__(self, node: Recorder, timed_from: Any = "leg") -> None:
        self.log: list[tuple[str, int]] = []
        self.node = node
        second = TickInputs(node, self._second, TIMEOUT_S, timed_from=timed_from)
        first = TickInputs(node, self._first, TIMEOUT_S, then=second)
        first.clock()
        self.up = first.port(OCCUPANCY, table_row(OCCUPANCY), circuit="up")
        self.down = second.port(OCCUPANCY, table_row(OCCUPANCY), circuit="down")
        self.fails = False

    def _first(self, stamp_ns: int, items: dict[str, Any]) -> None:
        if self.fails:
            raise ArithmeticError("broken")
        self.log.append(("first", stamp_ns // TICK_NS))

    def _second(self, stamp_ns: int, items: dict[str, Any]) -> None:
        self.log.append(("second", stamp_ns // TICK_NS))
        if self.fails:
            raise ArithmeticError("broken")

    def feed(self, *names: str, tick: int = 0) -> None:
        for name in names:
            if name == "clock":
                self.node.feed["/clock"](clock(tick))
            else:
                port = self.up if name == "up" else self.down
                self.node.feed[port](occupancy(name, tick))


def test_the_legs_of_a_tick_run_one_after_the_other(node: Recorder) -> None:
    for order in itertools.permutations(("clock", "up", "down")):
        legs = TwoLegs(node)
        legs.feed(*order)
        assert legs.log == [("first", 0), ("second", 0)]


def test_the_next_tick_waits_for_the_second_leg(node: Recorder) -> None:
    legs = TwoLegs(node)
    legs.feed("clock", "up")
    legs.feed("clock", "up", tick=1)
    assert legs.log == [("first", 0)]
    legs.feed("down")
    legs.feed("down", tick=1)
    assert legs.log == [("first", 0), ("second", 0), ("first", 1), ("second", 1)]


@pytest.mark.parametrize(("timed_from", "patience_s"), [("leg", TIMEOUT_S), ("tick", 0.5)])
def test_the_time_of_a_second_leg(node: Recorder, timed_from: str, patience_s: float) -> None:
    legs = TwoLegs(node, timed_from)
    legs.feed("clock")
    node.wait(TIMEOUT_S - 0.5)
    legs.feed("up")
    node.wait(patience_s)
    assert node.failed == []
    node.wait(0.1)
    assert [name for name, _ in node.failed] == ["/wayside/down/track_code"]
    assert legs.log == [("first", 0), ("second", 0)]


@pytest.mark.parametrize("failing", ["first", "second"])
def test_a_leg_that_raises_does_not_hold_up_the_next_tick(node: Recorder, failing: str) -> None:
    legs = TwoLegs(node)
    if failing == "second":
        legs.feed("clock", "up")
    legs.fails = True
    with pytest.raises(ArithmeticError):
        legs.feed(*(("clock", "up") if failing == "first" else ("down",)))
    legs.fails = False
    legs.feed("clock", "up", "down", tick=1)
    assert legs.log[-2:] == [("first", 1), ("second", 1)]


def test_the_node_is_told_the_time_once_a_tick(node: Recorder) -> None:
    legs = TwoLegs(node)
    for tick in range(2):
        legs.feed("clock", "up", "down", tick=tick)
    assert node.times == [0, TICK_NS]


def test_who_joins_in_the_midst_of_a_run_falls_in_step(node: Recorder) -> None:
    ports = open_circuits(node, TickInputs(node, node.step, TIMEOUT_S))
    # Connected one after the other: of the first tick it hears one sender, of the next all.
    node.feed[ports["tc1"]](occupancy("tc1", 57))
    node.feed["/clock"](clock(57))
    node.feed["/clock"](clock(58))
    for circuit, port in ports.items():
        node.feed[port](occupancy(circuit, 58))
    assert [stamp_ns // TICK_NS for stamp_ns, _ in node.ticks] == [57, 58]
    assert set(node.ticks[1][1]) == {"/clock", *ports.values()}
    assert node.failed == []


def test_decoders_give_stamp_and_item() -> None:
    assert bare_stamp(clock_to_cdr(7)) == bare_stamp(header_to_cdr(7)) == (7, None)
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    stamp_ns, read = table(ODOMETER, 2)(TableWriter(("a", "b"), ODOMETER.columns).write(5, values))
    assert stamp_ns == 5
    np.testing.assert_array_equal(read, values)
    row = TableWriter(("a",), ODOMETER.columns).write(5, values[:1])
    assert table_row(ODOMETER)(row) == (5, [1.0, 2.0])
    block = Waveform(9, 1e3, 0.0, 0, np.array([[1.0 + 2.0j, 3.0]]))
    stamp_ns, view = stamped(Waveform.from_cdr)(block.to_cdr())
    assert (stamp_ns, view.sample_rate_hz) == (9, 1e3)
    stamp_ns, sampled = samples(block.to_cdr())
    assert stamp_ns == 9
    np.testing.assert_array_equal(sampled, block.samples)
    assert samples(silence(9, 1e3, 0.0, 0).to_cdr()) == (9, None)


def test_owners_of_topics_that_are_named_further_below_their_node() -> None:
    assert RANGE.owner(site="wrs1", zone="z") == WRS_TX.owner(site="wrs1", zone="z")
    assert RANGE.owner(site="wrs1", zone="z") == "/wayside/wrs1"
    assert DOWN_TELEGRAMS.owner(base="b1") == "/wayside/zone_controller"
    assert BACKBONE_UP.owner(base="b1") == BACKBONE_DOWN.owner(base="b1") == "/world/backbone"
