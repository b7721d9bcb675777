"""The train bus as nodes: terminals, cable and monitor, each on its own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.srv import ChangeState

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import Table
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_bus import (
    BUS_LINK,
    BUS_LINKS,
    BUS_RX,
    BUS_STATE,
    BUS_TRACE,
    BUS_TREND,
    BUS_TX,
    BUS_VERDICTS,
    REFLECTOMETER_RX,
    REFLECTOMETER_TX,
)
from rail_msgs_py.waveform import Waveform, silence
from rail_onboard.train_bus.message import PAYLOAD_BYTES, BusMessage
from rail_onboard.train_bus.monitor_node import TrainBusMonitorNode
from rail_onboard.train_bus.terminal_node import BusTerminalNode
from rail_signals.train_bus.consist import Deviations
from rail_signals.train_bus.faults import BadSplice, BusFault
from rail_signals.train_bus.frame import BusFrameFormat
from rail_signals.train_bus.receiver import BusFrameReceiver
from rail_signals.train_bus.roughness import draw_roughness, roughened
from rail_signals.train_bus.tdr.measured_trace import step_edge
from rail_signals.train_bus.tdr.reflectometer import Reflectometer, measure
from rail_signals.train_bus.train import train_consist
from rail_world.train_bus.medium_node import BusMediumNode

TICK_NS = 250_000_000
FRAME = BusFrameFormat(PAYLOAD_BYTES)
RATE_HZ = FRAME.sample_rate_hz
CARS = ("CM2", "CM3", "CM4")


def parameters(plan: Plan, name: str) -> dict[str, Any]:
    (spec,) = (spec for spec in plan.nodes if spec.name == name)
    return dict(spec.parameters)


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("failing_bus"), tmp_path)


def last(box: list[Any]) -> dict[str, float]:
    table = Table.from_msg(box[-1])
    return table.row(table.rows[0])


def block(stamp_ns: int, samples: Any, rate_hz: float = RATE_HZ) -> Any:
    rows = np.atleast_2d(np.asarray(samples, dtype=complex))
    return Waveform(stamp_ns, rate_hz, 0.0, 0, rows).to_msg()


def silent(stamp_ns: int) -> Any:
    return silence(stamp_ns, RATE_HZ, 0.0, 0).to_msg()


class Terminal:
    """A terminal, and a test that plays clock, bus and other end."""

    def __init__(self, graph: Any, end: str) -> None:
        self.graph, self.end, self.name = graph, end, f"/train_1/bus_{end}"
        self.tx = graph.mailbox(BUS_TX, train="train_1", end=end)
        self.link = graph.mailbox(BUS_LINK, train="train_1", end=end)
        self._clock = graph.sender(CLOCK)
        self._rx = graph.sender(BUS_RX, train="train_1", end=end)
        given = {"end": end, "tick_s": 1e-9 * TICK_NS}
        node = BusTerminalNode(f"bus_{end}", context=graph.context, parameters=given)
        node.switch_on()
        graph.add(node)
        graph.connect(self.name)

    def tick(self, tick: int, samples: Any) -> Waveform:
        """Give clock and what arrives, None for silence; return what was sent."""
        stamp_ns = tick * TICK_NS
        self._clock(clock_to_cdr(stamp_ns))
        self.graph.wait(lambda: len(self.tx) > tick)
        self._rx(silent(stamp_ns) if samples is None else block(stamp_ns, samples))
        self.graph.wait(lambda: len(self.link) > tick)
        return Waveform.from_msg(self.tx[-1])


def said(wave: Waveform) -> BusMessage:
    payload = BusFrameReceiver(FRAME).receive(wave.row.real).payload
    assert payload is not None
    return BusMessage.from_bytes(payload)


def test_the_head_speaks_and_learns_that_the_tail_has_heard_it(graph: Any) -> None:
    head = Terminal(graph, "head")
    sent = head.tick(0, 3.0 * FRAME.waveform(BusMessage("tail", 0, None, 0).to_bytes()))
    assert (sent.sample_rate_hz, sent.samples.shape) == (RATE_HZ, (1, FRAME.samples))
    assert said(sent) == BusMessage("head", 0, None, 0)
    assert last(head.link)["other_end"] == 0.0
    sent = head.tick(1, 3.0 * FRAME.waveform(BusMessage("tail", 1, 0, 0).to_bytes()))
    assert said(sent) == BusMessage("head", 1, 0, 0)
    found = last(head.link)
    assert (found["sent"], found["received"], found["lost"]) == (2.0, 2.0, 0.0)
    assert (found["other_end"], found["other_end_age_s"]) == (1.0, 0.25)
    assert found["bits"] == 256.0
    assert found["bit_errors"] == 0.0


def test_a_tail_without_a_bus_says_so(graph: Any) -> None:
    tail = Terminal(graph, "tail")
    tail.tick(0, FRAME.waveform(BusMessage("head", 0, None, 0).to_bytes()))
    for tick in range(1, 12):
        broken = np.full(FRAME.samples, math.nan) if tick % 2 else None
        assert said(tail.tick(tick, broken)).received_tick == 0
    found = last(tail.link)
    assert (found["received"], found["lost"]) == (1.0, 11.0)
    assert math.isnan(found["ebn0_db"])
    assert graph.told("/train_1/bus_tail: train bus") == [
        (DiagnosticStatus.OK, "hears the head"),
        (DiagnosticStatus.WARN, "loses messages of the head"),
        (DiagnosticStatus.ERROR, "the head is not received"),
    ]


def test_a_terminal_that_is_switched_off_is_silent(graph: Any) -> None:
    head = Terminal(graph, "head")
    head.tick(0, None)
    request = ChangeState.Request()
    request.transition.id = 4  # deactivate
    assert graph.call(ChangeState, "/train_1/bus_head/change_state", request).success
    assert head.tick(1, None).silent
    assert last(head.link)["sent"] == 1.0
    assert last(head.link)["lost"] == 1.0


def test_the_cable_carries_frames_both_ways_and_echoes(graph: Any, plan: Plan) -> None:
    train = "train_a"
    clock = graph.sender(CLOCK)
    send = {end: graph.sender(BUS_TX, train=train, end=end) for end in ("head", "tail")}
    heard = {end: graph.mailbox(BUS_RX, train=train, end=end) for end in ("head", "tail")}
    probe = graph.sender(REFLECTOMETER_TX, train=train)
    echo = graph.mailbox(REFLECTOMETER_RX, train=train)
    links = graph.mailbox(BUS_LINKS)
    done = graph.mailbox(DONE, raw=True, node="/world/bus_medium")
    given = parameters(plan, "/world/bus_medium")
    graph.add(BusMediumNode(context=graph.context, parameters=given))
    graph.connect("/world/bus_medium")

    def tick(number: int, head: Any, tail: Any, edges: Any) -> None:
        stamp_ns = number * TICK_NS
        clock(clock_to_cdr(stamp_ns))
        for give, samples, rate_hz in (
            (send["head"], head, RATE_HZ),
            (send["tail"], tail, RATE_HZ),
            (probe, edges, 2e8),
        ):
            give(silent(stamp_ns) if samples is None else block(stamp_ns, samples, rate_hz))
        graph.wait(lambda: len(done) > number)

    question, answer = (BusMessage(end, 0, None, 0).to_bytes() for end in ("head", "tail"))
    tick(0, FRAME.waveform(question), FRAME.waveform(answer), None)
    graph.wait(lambda: heard["head"] and heard["tail"] and echo and links)
    receiver = BusFrameReceiver(FRAME)
    assert receiver.receive(Waveform.from_msg(heard["tail"][-1]).row.real).payload == question
    assert receiver.receive(Waveform.from_msg(heard["head"][-1]).row.real).payload == answer
    assert Waveform.from_msg(echo[-1]).silent
    assert last(links)["grown"] == 0.0
    assert 20.0 < last(links)["ebn0_tail_db"] < 40.0
    # In silence nothing is heard, and the edges come back.
    edge = step_edge(5e-9 * np.arange(-16, 484), 20e-9)
    tick(1, None, None, np.stack([edge, edge]))
    graph.wait(lambda: len(echo) > 1 and len(heard["head"]) > 1 and len(heard["tail"]) > 1)
    assert Waveform.from_msg(heard["tail"][-1]).silent
    assert Waveform.from_msg(heard["head"][-1]).silent
    seen = Waveform.from_msg(echo[-1])
    assert (seen.samples.shape, seen.sample_rate_hz) == ((2, 500), 2e8)
    assert 1e-4 < np.abs(seen.samples).max() < 0.2
    # What is sampled otherwise than the bus is not on it; NaN stays what it is.
    clock(clock_to_cdr(2 * TICK_NS))
    send["head"](block(2 * TICK_NS, FRAME.waveform(question), 1e6))
    send["tail"](block(2 * TICK_NS, np.full(FRAME.samples, math.nan)))
    probe(silent(2 * TICK_NS))
    graph.wait(lambda: len(done) > 2 and len(heard["head"]) > 2 and len(heard["tail"]) > 2)
    assert Waveform.from_msg(heard["tail"][-1]).silent
    assert receiver.receive(Waveform.from_msg(heard["head"][-1]).row.real).payload is None


class Monitor:
    """A monitor, and a test that plays clock and cable."""

    def __init__(self, graph: Any, **given: Any) -> None:
        self.graph = graph
        self.tx = graph.mailbox(REFLECTOMETER_TX, train="train_1")
        self.state = graph.mailbox(BUS_STATE, train="train_1")
        self.trace = graph.mailbox(BUS_TRACE, train="train_1")
        self.verdicts = graph.mailbox(BUS_VERDICTS, train="train_1")
        self.trend = graph.mailbox(BUS_TREND, train="train_1")
        self._clock = graph.sender(CLOCK)
        self._rx = graph.sender(REFLECTOMETER_RX, train="train_1")
        self.consist = train_consist(CARS)
        self.instrument = Reflectometer(self.consist.termination.resistance_ohm)
        self._rng = rng = np.random.default_rng(5)
        self._line = self.consist.bus_line(Deviations.draw(len(CARS), rng))
        self._rough = draw_roughness(self.consist, rng)
        given = {"cars": CARS, "tick_s": 1e-9 * TICK_NS, "period_s": 1.0, "traces": 4, **given}
        node = TrainBusMonitorNode(context=graph.context, parameters=given)
        node.switch_on()
        graph.add(node)
        graph.connect("/train_1/train_bus_monitor")

    def echoes(self, fault: BusFault | None) -> Any:
        """What the cable sends back to four edges."""
        line = self._line if fault is None else fault.apply(self._line)
        samples = self.instrument.samples_for(self.consist.bus_line().delay_s)
        rough = roughened(line, self._rough)
        return measure(rough, self.instrument, self._rng, 4, samples=samples).reflection

    def tick(self, tick: int, fault: BusFault | None = None, samples: Any = None) -> bool:
        """Play one tick; return whether the monitor measured."""
        stamp_ns = tick * TICK_NS
        self._clock(clock_to_cdr(stamp_ns))
        self.graph.wait(lambda: len(self.tx) > tick)
        sent = Waveform.from_msg(self.tx[-1])
        if sent.silent:
            self._rx(silent(stamp_ns))
        else:
            seen = self.echoes(fault) if samples is None else samples
            self._rx(block(stamp_ns, seen, sent.sample_rate_hz))
        self.graph.wait(lambda: len(self.state) > tick)
        return not sent.silent


def test_the_monitor_measures_in_its_period_and_finds_a_healthy_bus(graph: Any) -> None:
    monitor = Monitor(graph)
    measured = [monitor.tick(tick) for tick in range(9)]
    assert measured == [tick % 4 == 0 for tick in range(9)]
    edge = Waveform.from_msg(monitor.tx[8])
    assert edge.samples.shape[0] == 4
    assert (edge.samples.real[:, 0] < 1e-6).all()
    assert (edge.samples.real[:, -1] == 1.0).all()
    found = last(monitor.state)
    assert (found["measurements"], found["interpretations"]) == (3.0, 1.0)
    assert (found["level"], found["kind"]) == (0.0, 0.0)
    graph.wait(lambda: len(monitor.trace) == 3 and monitor.verdicts)
    assert Waveform.from_msg(monitor.trace[-1]).samples.shape == (1, edge.samples.shape[1])
    verdicts = Table.from_msg(monitor.verdicts[-1])
    assert verdicts.rows == ("car_1", "car_2", "car_3")
    for car, length_m in zip(verdicts.rows, (47.0, 47.0, 27.0), strict=True):
        row = verdicts.row(car)
        assert row["length_m"] == pytest.approx(length_m, rel=0.05)
        assert 95.0 < row["impedance_ohm"] < 115.0
        assert 0.0 < row["attenuation_db"] < 15.0
        assert row["passed"] == 1.0
    assert len(monitor.verdicts) == 1
    assert monitor.trend == []


def test_a_splice_is_confirmed_at_once_and_its_trend_told(graph: Any) -> None:
    monitor = Monitor(graph)
    for tick in range(4):
        monitor.tick(tick)
    splice = BadSplice(60.0, 12.0)
    assert monitor.tick(4, splice)
    assert last(monitor.state)["kind"] == 0.0  # said once is not believed
    assert monitor.tick(5, splice)
    found = last(monitor.state)
    assert (found["kind"], found["level"]) == (4.0, 1.0)
    assert found["place_m"] == pytest.approx(60.0, abs=0.5)
    assert found["size"] == pytest.approx(12.0, rel=0.2)
    assert math.isnan(found["growth_per_s"])
    assert [monitor.tick(tick, splice) for tick in (6, 7)] == [False, False]
    for tick in range(8, 17):
        monitor.tick(tick, BadSplice(60.0, 5.0 * tick))
    found = last(monitor.state)
    assert found["growth_per_s"] == pytest.approx(20.0, rel=0.25)
    graph.wait(lambda: len(monitor.trend) == 4)
    trend = Table.from_msg(monitor.trend[-1])
    assert trend.values[:, 0].tolist() == [1.25, 2.0, 3.0, 4.0]
    told = graph.told("bus cable")
    assert told[0][0] == DiagnosticStatus.OK
    assert told[1][0] == DiagnosticStatus.WARN
    assert told[1][1].startswith("bad splice in car 2 at 60.")


def test_what_is_no_trace_is_not_interpreted(graph: Any) -> None:
    monitor = Monitor(graph)
    monitor.tick(0, samples=np.full((4, 400), math.nan))
    for tick in range(1, 4):
        monitor.tick(tick)
    monitor.tick(4, samples=np.zeros((4, 7)))
    found = last(monitor.state)
    assert (found["measurements"], found["level"], found["kind"]) == (0.0, 0.0, 0.0)
    told = [s.message for m in graph.diagnostics for s in m.status if s.name.endswith("ment")]
    assert any("must be" in message for message in told)


@pytest.mark.parametrize(
    ("kind", "wrong", "line"),
    [
        (BusTerminalNode, {"end": "middle"}, "end: middle: must be head or tail"),
        (BusTerminalNode, {"samples_per_bit": 7}, "samples_per_bit must be even"),
        (BusTerminalNode, {"rise_time_s": 9e-4}, "rise_time_s must be from 0 to half a bit"),
        (TrainBusMonitorNode, {"cars": ("CM9",)}, "cars"),
        (TrainBusMonitorNode, {"traces": 0}, "traces"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, kind: Any, wrong: Any, line: str) -> None:
    with pytest.raises(ParameterError, match=line):
        kind(context=graph.context, parameters=wrong)
