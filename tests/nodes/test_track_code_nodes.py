"""Track codes as nodes: circuit, rails, receiver and supervision, each on its own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.localizer import LOCALIZER_STATE
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.track_code import (
    CIRCUIT_RX,
    CIRCUIT_TX,
    CODE_RECEIVED,
    CODE_RX,
    CODE_SENT,
    OCCUPANCY,
)
from rail_msgs_py.topics.world import COMMAND, ODOMETER, STATE
from rail_msgs_py.waveform import Waveform
from rail_onboard.track_code.receiver_node import TrackCodeReceiverNode
from rail_onboard.track_code.supervision_node import CodeSupervisionNode
from rail_signals.track_code.profile import load_profile
from rail_signals.track_code.signal import FmTransmitter
from rail_signals.track_code.word import as_number, decode, encode
from rail_wayside.track_code.transmitter_node import TrackCodeTransmitterNode
from rail_world.track_code.medium_node import RailMediumNode

TICK_NS = 250_000_000
RATE_HZ = 16_000.0
SAMPLES = 4000
PROFILE = load_profile("tones27")
FIELDS = {"speed": 0x65, "gradient": 10, "block_length": 20, "network": 0}


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("follow_codes"), tmp_path)


def parameters(plan: Plan, name: str) -> dict[str, Any]:
    (spec,) = (spec for spec in plan.nodes if spec.name == name)
    return spec.parameters


def rows(box: list[Any], index: int = -1) -> dict[str, float]:
    table = Table.from_msg(box[index])
    return table.row(table.rows[0])


def block(stamp_ns: int, samples: Any) -> Any:
    return Waveform(stamp_ns, RATE_HZ, 0.0, 0, np.asarray(samples, complex)[None]).to_msg()


class Circuit:
    """The first circuit of the line, with three circuits ahead that the test plays."""

    def __init__(self, graph: Any, plan: Plan) -> None:
        self.graph = graph
        name = "/wayside/tc1/track_code"
        given = parameters(plan, name)
        self.ahead = given["ahead"]
        self.tx = graph.mailbox(CIRCUIT_TX, circuit="tc1")
        self.sent = graph.mailbox(CODE_SENT, circuit="tc1")
        self.sensed = graph.mailbox(OCCUPANCY, circuit="tc1")
        self._clock = graph.sender(CLOCK)
        self._rx = graph.sender(CIRCUIT_RX, circuit="tc1")
        self._occupancy = {c: graph.sender(OCCUPANCY, circuit=c) for c in self.ahead}
        node = TrackCodeTransmitterNode(
            namespace="/wayside/tc1", context=graph.context, parameters=given
        )
        node.switch_on()
        graph.add(node)
        graph.connect(name)

    def tick(self, tick: int, occupied: dict[str, float] | None = None) -> dict[str, float]:
        """Give the clock and, but for the first tick, what the circuits ahead sensed."""
        self._clock(clock_to_cdr(tick * TICK_NS))
        for circuit, send in self._occupancy.items() if tick else ():
            writer = TableWriter((circuit,), OCCUPANCY.columns)
            flag = (occupied or {}).get(circuit, 0.0)
            row = [flag if name in ("occupied", "detected") else 0.0 for name in OCCUPANCY.columns]
            send(writer.write((tick - 1) * TICK_NS, np.array([row])))
        self.graph.wait(lambda: len(self.sent) > tick and len(self.tx) > tick)
        return rows(self.sent)

    def hears(self, stamp_ns: int, samples: Any) -> dict[str, float]:
        count = len(self.sensed)
        self._rx(block(stamp_ns, samples))
        self.graph.wait(lambda: len(self.sensed) > count)
        return rows(self.sensed)


def test_a_circuit_sends_what_the_circuits_ahead_allow(graph: Any, plan: Plan) -> None:
    circuit = Circuit(graph, plan)
    assert circuit.tick(0)["speed"] == 0.0  # nothing known is occupied
    free = circuit.tick(1)
    speeds_kmh = parameters(plan, "/wayside/tc1/track_code")["speeds_kmh"]
    assert speeds_kmh[int(free["speed"]) >> 4] >= 80.0
    assert circuit.tick(2, {circuit.ahead[0]: 1.0})["speed"] == 0.0
    word = int(circuit.tick(3)["word"])
    assert word == free["word"]
    fields = decode(PROFILE, np.array([bool(word >> i & 1) for i in range(27)]))
    assert fields is not None
    assert fields["block_length"] == 20
    sent = [Waveform.from_msg(message) for message in circuit.tx]
    assert {wave.samples.shape for wave in sent} == {(1, SAMPLES)}
    assert [wave.stamp_ns for wave in sent] == [tick * TICK_NS for tick in range(4)]


def test_a_circuit_is_clear_while_its_own_code_arrives_at_its_level(graph: Any, plan: Plan) -> None:
    circuit = Circuit(graph, plan)
    other = FmTransmitter(PROFILE, 1700.0, RATE_HZ)

    def sensed(tick: int, gain: float, add: Any = 0.0) -> dict[str, float]:
        circuit.tick(tick)
        sent = Waveform.from_msg(circuit.tx[-1]).row.real
        return circuit.hears(tick * TICK_NS, gain * sent + add)

    # Switched on it knows nothing: it takes two seconds of its own code to be clear.
    occupied = [sensed(tick, 0.7)["occupied"] for tick in range(9)]
    assert occupied == [1.0] * 7 + [0.0] * 2
    assert sensed(9, 0.003)["occupied"] == 1.0
    recovering = [sensed(tick, 0.7)["occupied"] for tick in range(10, 18)]
    assert recovering == [1.0] * 7 + [0.0]
    # Another code of the same carrier at the same level is not its own.
    foreign = encode(PROFILE, FIELDS)
    for tick in range(18, 30):
        row = sensed(tick, 0.0, 0.7 * other.block(foreign, SAMPLES))
        assert row["occupied"] == 1.0
    assert sensed(30, 0.7, np.full(SAMPLES, math.nan))["occupied"] == 1.0
    circuit.tick(31)
    assert circuit.hears(31 * TICK_NS, np.zeros((0,)))["occupied"] == 1.0


def test_a_train_understands_the_code_of_its_circuit(graph: Any) -> None:
    rx = graph.sender(CODE_RX, train="train_1")
    box = graph.mailbox(CODE_RECEIVED, train="train_1")
    node = TrackCodeReceiverNode(namespace="/train_1", context=graph.context)
    node.switch_on()
    graph.add(node)
    graph.connect("/train_1/track_code")
    bits = encode(PROFILE, FIELDS)
    transmitter = FmTransmitter(PROFILE, 2300.0, RATE_HZ)
    noise = np.random.default_rng(4)
    for tick in range(14):
        samples = 0.1 * transmitter.block(bits, SAMPLES) + 1e-3 * noise.standard_normal(SAMPLES)
        rx(block(tick * TICK_NS, samples))
        graph.wait(lambda tick=tick: len(box) > tick)
    last = rows(box)
    assert (last["valid"], last["carrier_hz"]) == (1.0, 2300.0)
    assert int(last["word"]) == as_number(bits)
    assert {name: int(last[name]) for name in FIELDS} == FIELDS
    # Not before a whole slot of 1.5625 s has gone by.
    first = next(i for i in range(14) if rows(box, i)["valid"])
    assert (first + 1) * 0.25 >= 1.5625
    # What is lost is not held on to.
    for tick in range(14, 18):
        rx(block(tick * TICK_NS, np.zeros(SAMPLES)))
        graph.wait(lambda tick=tick: len(box) > tick)
    assert rows(box)["valid"] == rows(box)["carrier_hz"] == 0.0


def test_supervision_brakes_without_a_code_and_releases_with_one(graph: Any) -> None:
    code = graph.sender(CODE_RECEIVED, train="train_1")
    odometer = graph.sender(ODOMETER, train="train_1")
    box = graph.mailbox(COMMAND, train="train_1", supervision="code_supervision")
    node = CodeSupervisionNode(namespace="/train_1", context=graph.context)
    node.switch_on()
    graph.add(node)
    graph.connect("/train_1/code_supervision")
    codes = TableWriter(("train_1",), CODE_RECEIVED.columns)
    wheels = TableWriter(("train_1",), ODOMETER.columns)

    def tick(number: int, fields: dict[str, int] | None, speed_mps: float) -> dict[str, float]:
        values = dict.fromkeys(CODE_RECEIVED.columns, 0.0)
        if fields is not None:
            values |= {"carrier_hz": 1700.0, "valid": 1.0, **fields}
        cells = np.array([[values[name] for name in CODE_RECEIVED.columns]], dtype=float)
        code(codes.write(number * TICK_NS, cells))
        odometer(wheels.write(number * TICK_NS, np.array([[0.0, speed_mps]])))
        graph.wait(lambda: len(box) > number)
        assert to_ns_of(box[-1]) == number * TICK_NS
        return rows(box)

    assert tick(0, None, 0.0)["service_brake"] == 1.0
    released = tick(1, FIELDS, 0.0)
    assert released["service_brake"] == released["emergency_brake"] == 0.0
    assert released["permitted_mps"] == pytest.approx(70.0 / 3.6)  # entrance unknown: the end speed
    assert tick(2, FIELDS, 26.0)["emergency_brake"] == 1.0
    lost = [tick(number, None, 10.0) for number in range(3, 16)]
    assert lost[-1]["service_brake"] == 1.0


def test_supervision_judges_the_fastest_that_a_localizer_allows(graph: Any) -> None:
    code = graph.sender(CODE_RECEIVED, train="train_1")
    odometer = graph.sender(ODOMETER, train="train_1")
    localizer = graph.sender(LOCALIZER_STATE, train="train_1")
    box = graph.mailbox(COMMAND, train="train_1", supervision="code_supervision")
    parameters = {"localizer": True}
    node = CodeSupervisionNode(namespace="/train_1", context=graph.context, parameters=parameters)
    node.switch_on()
    graph.add(node)
    graph.connect("/train_1/code_supervision")
    columns = CODE_RECEIVED.columns, ODOMETER.columns, LOCALIZER_STATE.columns
    codes, wheels, places = (TableWriter(("train_1",), names) for names in columns)
    values = dict.fromkeys(CODE_RECEIVED.columns, 0.0) | {"carrier_hz": 1700.0, "valid": 1.0}
    values |= FIELDS

    def tick(
        number: int,
        believed_mps: float,
        fastest_mps: float,
        *,
        doubted: bool = True,
        carrier_hz: float = 1700.0,
    ) -> dict[str, float]:
        told = values | {"carrier_hz": carrier_hz}
        heard = np.array([[told[name] for name in CODE_RECEIVED.columns]], dtype=float)
        place = dict.fromkeys(LOCALIZER_STATE.columns, 0.0)
        place |= {"low_m": -1.0, "high_m": 1.0, "speed_mps": believed_mps}
        place |= {"fastest_mps": fastest_mps, "wheels_doubted": float(doubted)}
        code(codes.write(number * TICK_NS, heard))
        odometer(wheels.write(number * TICK_NS, np.array([[0.0, 0.0]])))  # they stand still
        row = np.array([[place[name] for name in LOCALIZER_STATE.columns]])
        localizer(places.write(number * TICK_NS, row))
        graph.wait(lambda: len(box) > number)
        return rows(box)

    permitted_mps = 70.0 / 3.6  # the entrance is not known: the end speed
    slow = tick(0, 0.0, 0.5)
    assert slow["service_brake"] == 0.0
    # The driver is shown less by what he may be faster than he believes.
    assert slow["permitted_mps"] == pytest.approx(permitted_mps - 0.5)
    # The doubt of wheels that are believed is made up for in the braking distance.
    entered = [tick(n, 0.0, 0.0, doubted=False, carrier_hz=2300.0) for n in range(1, 5)][-1]
    assert entered["permitted_mps"] > permitted_mps + 1.0
    creeps = tick(5, 0.0, 25.0, doubted=False, carrier_hz=2300.0)
    assert creeps["permitted_mps"] < entered["permitted_mps"] - 1.0
    assert tick(6, 19.0, 26.0, carrier_hz=2300.0)["emergency_brake"] == 1.0


def to_ns_of(message: Any) -> int:
    return Table.from_msg(message).stamp_ns


def test_the_rails_carry_a_code_to_the_train_in_the_circuit(graph: Any, plan: Plan) -> None:
    given = parameters(plan, "/world/rail_medium")
    state = graph.sender(STATE)
    circuits = [f"tc{number}" for number in range(1, 11)]
    send = {c: graph.sender(CIRCUIT_TX, circuit=c) for c in circuits}
    ends = {c: graph.mailbox(CIRCUIT_RX, circuit=c) for c in circuits}
    heard = {t: graph.mailbox(CODE_RX, train=t) for t in ("leader", "follower")}
    graph.mailbox(DONE, raw=True, node="/world/rail_medium")
    graph.add(RailMediumNode(context=graph.context, parameters=given))
    graph.connect("/world/rail_medium")
    values = np.zeros((2, len(STATE.columns)))
    values[:, STATE.columns.index("chainage_m")] = 900.0, 150.0
    values[:, STATE.columns.index("on_line")] = 1.0
    state(TableWriter(("leader", "follower"), STATE.columns).write(0, values))
    time_s = np.arange(SAMPLES) / RATE_HZ
    for number, circuit in enumerate(circuits):
        carrier_hz = (1700.0, 2300.0)[number % 2]
        send[circuit](block(0, np.sin(2 * np.pi * carrier_hz * time_s)))
    graph.wait(lambda: all(heard.values()) and all(ends.values()))

    def power(box: list[Any], carrier_hz: float) -> float:
        samples = Waveform.from_msg(box[-1]).row.real
        return abs(np.mean(samples * np.exp(-2j * np.pi * carrier_hz * time_s))) ** 2 * 4.0

    # The leader is 100 m, the follower 350 m from the end of its circuit; 6 dB/km.
    assert 10 * math.log10(power(heard["leader"], 2300.0)) == pytest.approx(-0.6, abs=0.3)
    assert 10 * math.log10(power(heard["follower"], 1700.0)) == pytest.approx(-2.1, abs=0.3)
    # Axles in tc1 and tc2 keep the signal from their receiving ends; tc5 is clear.
    assert 10 * math.log10(power(ends["tc5"], 1700.0)) == pytest.approx(-3.0, abs=0.3)
    assert 10 * math.log10(power(ends["tc1"], 1700.0)) < -25.0
    assert 10 * math.log10(power(ends["tc2"], 2300.0)) < -25.0


@pytest.mark.parametrize(
    ("kind", "wrong", "line"),
    [
        (TrackCodeReceiverNode, {"profile": "morse"}, "profile: morse"),
        (TrackCodeTransmitterNode, {"profile": "morse"}, "profile: morse"),
        (TrackCodeTransmitterNode, {"ahead": ("tc2",)}, "each needs a length"),
        (TrackCodeTransmitterNode, {"tick_s": 7.0}, "tick_s"),
        (CodeSupervisionNode, {"braking_mps2": -1.0}, "braking_mps2"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, kind: Any, wrong: Any, line: str) -> None:
    with pytest.raises(ParameterError, match=line):
        kind(context=graph.context, parameters=wrong)
