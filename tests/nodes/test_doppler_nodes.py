"""Positions by Doppler shifts as nodes: station, medium and positioner, each on its own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from rail_corridor.equipment.doppler.placement import references_of
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.position import Position
from rail_msgs_py.stamps import clock_to_cdr, to_ns
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.doppler import DOPPLER_FIX, DOPPLER_POSITION, REFERENCE_RX, REFERENCE_TX
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import Waveform, silence
from rail_onboard.doppler.positioner_node import DopplerPositionerNode
from rail_signals.constants import SPEED_OF_LIGHT_M_PER_S
from rail_signals.doppler.signal import block_times_s, received_tones, reference_tone
from rail_signals.doppler.solver import NoFixReason
from rail_wayside.doppler.reference_station_node import ReferenceStationNode
from rail_world.doppler.medium_node import ReferenceMediumNode

TICK_NS = 100_000_000
MEDIUM, STATION, POSITIONER = (
    "/world/reference_medium",
    "/wayside/ref3/reference",
    "/train_a/doppler",
)
SCENARIO = load_scenario("sensors")
REFERENCES = SCENARIO.references
assert REFERENCES is not None
TONES = REFERENCES.tones
RADIO = (TONES.sample_rate_hz, TONES.carrier_hz, 1)
TRACK = SCENARIO.network.tracks["main"]
STATIONS = {station.name: station for station in references_of(SCENARIO)}


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(SCENARIO, tmp_path)


def parameters(plan: Plan, name: str) -> dict[str, Any]:
    (spec,) = (spec for spec in plan.nodes if spec.name == name)
    return dict(spec.parameters)


def frequency_hz(samples: NDArray[np.complex128]) -> float:
    """Frequency of a single tone, from the turn between its halves."""
    half = samples.size // 2
    coarse = np.angle(np.sum(samples[1:] * samples[:-1].conj())) / (2.0 * np.pi)
    fine = np.angle(np.sum(samples[half:] * samples[:half].conj())) / (2.0 * np.pi)
    turns = np.round(coarse * half - fine) + fine
    return float(turns / half * TONES.sample_rate_hz)


# The station -----------------------------------------------------------------------------


class Station:
    """The third reference station; the test is its clock."""

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        self._clock = graph.sender(CLOCK)
        self.tx = graph.mailbox(REFERENCE_TX, raw=True, station="ref3")
        given = parameters(plan, STATION) | changes
        graph.add(
            ReferenceStationNode(namespace="/wayside/ref3", context=graph.context, parameters=given)
        )
        graph.connect(STATION)

    def sends(self, tick: int) -> Waveform:
        self._clock(clock_to_cdr(tick * TICK_NS))
        self.graph.wait(lambda: len(self.tx) > tick)
        block = Waveform.from_cdr(self.tx[tick])
        assert block.stamp_ns == tick * TICK_NS
        return block


def test_a_station_sends_its_tone_and_the_same_in_every_tick(graph: Any, plan: Plan) -> None:
    station = Station(graph, plan, power_dbm=10.0)
    blocks = [station.sends(tick) for tick in range(3)]
    assert (blocks[0].sample_rate_hz, blocks[0].carrier_hz, blocks[0].channel) == RADIO
    assert blocks[0].power_dbm == pytest.approx(10.0, abs=1e-9)
    slot = STATIONS["ref3"].slot
    assert frequency_hz(blocks[0].row) == pytest.approx(TONES.slot_offset_hz(slot), abs=1e-6)
    assert all(np.array_equal(block.samples, blocks[0].samples) for block in blocks)
    # It goes on from tick to tick: a tick is a whole number of its periods.
    assert (TONES.slot_offset_hz(slot) * 0.1) % 1.0 == pytest.approx(0.0, abs=1e-9)


def test_a_station_that_is_switched_off_is_silent_and_on_again_as_before(
    graph: Any, plan: Plan
) -> None:
    station = Station(graph, plan)
    before = station.sends(0)
    graph.switch(STATION, on=False)
    assert station.sends(1).silent
    assert station.sends(2).silent
    graph.switch(STATION, on=True)
    after = station.sends(3)
    assert np.array_equal(after.samples, before.samples)
    told = [s.message for m in graph.diagnostics for s in m.status if s.name.endswith(": tone")]
    assert told == ["sends its tone", "switched off", "sends its tone"]


# The medium ------------------------------------------------------------------------------


class Air:
    """The medium; the test is the world and all stations."""

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        self._state = graph.sender(STATE)
        self._tx = {name: graph.sender(REFERENCE_TX, station=name) for name in STATIONS}
        self.rx = graph.mailbox(REFERENCE_RX, raw=True, train="train_a")
        self.done = graph.mailbox(DONE, raw=True, node=MEDIUM)
        given = parameters(plan, MEDIUM) | changes
        graph.add(ReferenceMediumNode(context=graph.context, parameters=given))
        graph.connect(MEDIUM)

    def hears(
        self,
        tick: int,
        chainage_m: float,
        speed_mps: float,
        sending: tuple[str, ...] = tuple(STATIONS),
        *,
        missing: tuple[str, ...] = (),
        on_line: float = 1.0,
    ) -> Waveform:
        """Play a tick, with some stations sending and some saying nothing at all."""
        stamp_ns, pose = tick * TICK_NS, TRACK.pose(chainage_m)
        row = dict.fromkeys(STATE.columns, 0.0) | {
            "x_m": float(pose.x_m),
            "y_m": float(pose.y_m),
            "z_m": float(pose.z_m),
            "heading_rad": float(pose.heading_rad),
            "speed_mps": speed_mps,
            "chainage_m": chainage_m,
            "on_line": on_line,
        }
        self._state(
            TableWriter(("train_a",), STATE.columns).write(stamp_ns, np.array([list(row.values())]))
        )
        for name, send in self._tx.items():
            block = silence(stamp_ns, *RADIO)
            if name in sending:
                tone = math.sqrt(10.0) * reference_tone(TONES, STATIONS[name].slot)
                block = Waveform(stamp_ns, *RADIO, tone[None])
            if name not in missing:
                send(block.to_msg())
        self.graph.wait(lambda: len(self.rx) > tick and len(self.done) > tick)
        assert to_ns(deserialize_message(self.done[-1], Header).stamp) == stamp_ns
        heard = Waveform.from_cdr(self.rx[-1])
        assert (heard.stamp_ns, heard.sample_rate_hz, heard.carrier_hz, heard.channel) == (
            stamp_ns,
            *RADIO,
        )
        return heard


def test_a_tone_arrives_shifted_by_the_speed_towards_its_station(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    # ref2 stands ahead on a straight, ref1 at the begin of the line behind.
    at_m, v = 300.0, 30.0
    shifts_hz, powers_mw = [], []
    for tick, (name, speed_mps) in enumerate(
        [("ref2", v), ("ref2", 0.0), ("ref1", v), ("ref1", 0.0)]
    ):
        block = air.hears(tick, at_m, speed_mps, (name,))
        slot_hz = TONES.slot_offset_hz(STATIONS[name].slot)
        shifts_hz.append(frequency_hz(block.row) - slot_hz)
        powers_mw.append(float(np.mean(np.abs(block.row) ** 2)))
    # What oscillators are off by goes out of the difference from the train that stands.
    for index, name in ((0, "ref2"), (2, "ref1")):
        away_m = np.array([at_m, 0.0, 0.0]) - STATIONS[name].position_m
        distance_m = float(np.linalg.norm(away_m))
        tone_hz = TONES.carrier_hz + TONES.slot_offset_hz(STATIONS[name].slot)
        exact_hz = -tone_hz / SPEED_OF_LIGHT_M_PER_S * v * away_m[0] / distance_m
        assert shifts_hz[index] - shifts_hz[index + 1] == pytest.approx(exact_hz, abs=0.2)
        # Free space at 1 m, then the exponent of the scenario; 10 dBm.
        assert REFERENCES is not None
        wavelength_m = SPEED_OF_LIGHT_M_PER_S / TONES.carrier_hz
        loss_db = 20.0 * math.log10(4.0 * math.pi / wavelength_m) + REFERENCES.extra_loss_db
        loss_db += 10.0 * REFERENCES.path_loss_exponent * math.log10(distance_m)
        got_db = 10.0 * math.log10(powers_mw[index])
        assert got_db == pytest.approx(10.0 - loss_db, abs=0.2)


def test_nothing_arrives_off_the_line_or_when_nobody_sends(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    assert not air.hears(0, 300.0, 20.0).silent
    assert air.hears(1, 300.0, 20.0, ()).silent
    assert air.hears(2, 300.0, 20.0, on_line=0.0).silent
    # The last station is 2.6 km away along the curve.
    assert air.hears(3, 0.0, 20.0, ("ref8",)).silent
    assert not air.hears(4, 300.0, 20.0).silent


def test_a_station_that_says_nothing_is_named_and_the_tick_goes_on(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan, timeout_s=0.05)
    assert not air.hears(0, 300.0, 20.0, ("ref1",), missing=("ref3",)).silent
    (failed,) = graph.failed
    assert failed.name == STATION
    assert {p.key: p.value for p in failed.values} == {"detected_by": MEDIUM, "time_s": "0.0"}
    air.hears(1, 300.0, 20.0, missing=("ref3",))
    air.hears(2, 300.0, 20.0)
    assert len(graph.failed) == 1


# The positioner --------------------------------------------------------------------------


class Positioner:
    """The positioner of the train; the test is what its antenna receives."""

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        given = parameters(plan, POSITIONER) | {"localizer": False} | changes
        self._rx = graph.sender(REFERENCE_RX, train="train_a")
        self.fixes = graph.mailbox(DOPPLER_FIX, train="train_a")
        self.positions = graph.mailbox(DOPPLER_POSITION, train="train_a")
        self._rng = np.random.default_rng(5)
        graph.add(
            DopplerPositionerNode(namespace="/train_a", context=graph.context, parameters=given)
        )
        graph.connect(POSITIONER)

    def block(self, chainage_m: float, speed_mps: float, offset_hz: float = 300.0) -> Any:
        """Tones of the stations within 1.25 km of the straight, and noise 40 dB below at 100 m."""
        near = [s for s in STATIONS.values() if abs(s.position_m[0] - chainage_m) < 1250.0]
        way_m = chainage_m + speed_mps * block_times_s(TONES)
        line = np.stack([way_m, np.zeros_like(way_m), np.zeros_like(way_m)])
        places = np.array([s.position_m for s in near])[:, :, None]
        distance_m = np.linalg.norm(line[None] - places, axis=1)
        slots = [s.slot for s in near]
        block = received_tones(TONES, slots, distance_m, 100.0 / distance_m, offset_hz=offset_hz)
        noise = self._rng.normal(scale=0.007, size=(TONES.samples, 2)).view(np.complex128)[:, 0]
        return block + noise

    def hears(self, tick: int, samples: Any = None) -> tuple[dict[str, float], Position]:
        """Let it hear samples, None for silence; return fix and position."""
        count = len(self.fixes)
        block = silence(tick * TICK_NS, *RADIO)
        if samples is not None:
            block = Waveform(tick * TICK_NS, *RADIO, np.asarray(samples, complex)[None])
        self._rx(block.to_msg())
        self.graph.wait(lambda: len(self.fixes) > count and len(self.positions) > count)
        table, place = Table.from_msg(self.fixes[-1]), Position.from_msg(self.positions[-1])
        assert table.stamp_ns == place.stamp_ns == tick * TICK_NS
        return table.row("train_a"), place


def test_shifts_become_a_position(graph: Any, plan: Plan) -> None:
    positioner = Positioner(graph, plan, start_m=700.0)
    for tick in range(3):
        true_m = 700.0 + 3.0 * tick
        fix, place = positioner.hears(tick, positioner.block(true_m, 30.0))
        assert fix["reason"] == NoFixReason.NONE
        sigma_m = math.sqrt(fix["chainage_m2"])
        assert 0.0 < sigma_m < 5.0
        assert abs(fix["chainage_m"] - true_m) < 4.0 * sigma_m
        assert fix["speed_mps"] == pytest.approx(30.0, abs=4.0 * math.sqrt(fix["speed_m2ps2"]))
        assert fix["tones"] >= 3.0
        assert place.known
        assert (place.track, place.chainage_m) == ("main", fix["chainage_m"])
        assert place.variance_m2 == fix["chainage_m2"]


def test_without_tones_or_speed_there_is_no_position(graph: Any, plan: Plan) -> None:
    positioner = Positioner(graph, plan, start_m=700.0)
    rng = np.random.default_rng(6)
    noise = rng.standard_normal((TONES.samples, 2)).view(np.complex128)[:, 0]
    for tick, (samples, reason) in enumerate(
        [
            (None, NoFixReason.TOO_FEW_STATIONS),
            (noise, NoFixReason.TOO_FEW_STATIONS),
            (np.full(TONES.samples, math.nan), NoFixReason.TOO_FEW_STATIONS),
            (positioner.block(700.0, 0.0), NoFixReason.STANDSTILL),
        ]
    ):
        fix, place = positioner.hears(tick, samples)
        assert fix["reason"] == reason
        assert math.isnan(fix["chainage_m"]) and math.isnan(fix["chainage_m2"])
        assert not place.known and math.isinf(place.variance_m2)
    # It is found again where it is.
    fix, place = positioner.hears(4, positioner.block(705.0, 30.0))
    assert fix["reason"] == NoFixReason.NONE and place.known
    told = [s.message for m in graph.diagnostics for s in m.status if "position" in s.name]
    assert told == ["too few stations", "standstill", "position known"]


def test_a_block_of_another_length_is_told_and_stops_nothing(graph: Any, plan: Plan) -> None:
    positioner = Positioner(graph, plan, start_m=700.0)
    short = Waveform(0, *RADIO, np.ones((1, 100), complex))
    positioner._rx(short.to_msg())
    fix, _ = positioner.hears(1, positioner.block(700.0, 30.0))
    assert fix["reason"] == NoFixReason.NONE
    told = [s.message for m in graph.diagnostics for s in m.status if "software" in s.name]
    assert len(told) == 1 and "100" in told[0]


def test_switched_off_it_knows_nothing_and_on_again_it_begins_anew(graph: Any, plan: Plan) -> None:
    positioner = Positioner(graph, plan, start_m=700.0)
    for tick in range(5):
        fix, _ = positioner.hears(tick, positioner.block(700.0 + 8.0 * tick, 80.0))
        assert fix["reason"] == NoFixReason.NONE
    graph.switch(POSITIONER, on=False)
    fix, place = positioner.hears(5, positioner.block(740.0, 80.0))
    assert fix["reason"] == NoFixReason.TOO_FEW_STATIONS
    assert not place.known and math.isinf(place.variance_m2)
    graph.switch(POSITIONER, on=True)
    # It looks neither where it was put into service nor where it was last, but everywhere; on this
    # line no two stations share a tone.
    fix, place = positioner.hears(6, positioner.block(1000.0, 80.0))
    assert fix["reason"] == NoFixReason.NONE
    assert place.chainage_m == pytest.approx(1000.0, abs=5.0)


# What cannot be --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "wrong", "line"),
    [
        (ReferenceStationNode, {"slot": 10}, "slot: 10"),
        (ReferenceStationNode, {"tick_s": 0.10001}, "tick_s: 0.10001"),
        (ReferenceStationNode, {"samples": 1000}, "reference tones"),
        (DopplerPositionerNode, {"station_x_m": (1.0,)}, "doppler: line_chainage_m: ()"),
        (DopplerPositionerNode, {"placed_m": 0.0}, "placed_m"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, kind: Any, wrong: Any, line: str) -> None:
    with pytest.raises(ParameterError, match=line) as caught:
        kind(context=graph.context, parameters=wrong, services=False)
    assert "\n" not in str(caught.value)
