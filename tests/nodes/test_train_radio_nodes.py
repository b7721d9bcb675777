"""The train radio as nodes: base station, radio on board, the medium between, each on its own."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header

from rail_corridor.equipment.ranging.nodes import CONTROLLER
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import clock_to_cdr, to_ns
from rail_msgs_py.table import Table, TableWriter
from rail_msgs_py.topics.tick import CLOCK, DONE
from rail_msgs_py.topics.train_radio import (
    BACKBONE,
    BACKBONE_DOWN,
    CBTC_BASE_RX,
    CBTC_BASE_TX,
    CBTC_LINKS,
    CBTC_TRAIN_RX,
    CBTC_TRAIN_TX,
    DOWN_TELEGRAMS,
    RADIO_LINK,
    RADIO_TELEGRAMS,
    TRAIN_TELEGRAMS,
    UP_TELEGRAMS,
)
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.train_radio.parameters import TrainRadioParameters, slots_of
from rail_msgs_py.train_radio.telegrams import Telegrams
from rail_msgs_py.waveform import Waveform, silence
from rail_onboard.train_radio.radio_node import CbtcRadioNode
from rail_signals.train_radio.burst import RadioBurstReceiver
from rail_signals.train_radio.slots import frame_of
from rail_wayside.train_radio.base_station_node import BEACON, CbtcBaseStationNode
from rail_world.train_radio.description import CbtcDescription
from rail_world.train_radio.medium_node import CbtcMediumNode

TICK_NS = 250_000_000
MEDIUM = "/world/cbtc_medium"
TRACK = load_scenario("moving_block").network.tracks["main"]
SLOTS = slots_of(TrainRadioParameters(trains=4, samples_per_symbol=2))
RECEIVER = RadioBurstReceiver(SLOTS.burst)
RATE_HZ = SLOTS.burst.sample_rate_hz
FIRST, SECOND, OTHER = (bytes([n]) * 64 for n in (1, 2, 3))
#: Two antennas to two antennas, without fading.
AIR = np.array([[0.8, 0.3j], [-0.2, 0.7 - 0.4j]])


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("moving_block"), tmp_path)


def parameters(plan: Plan, name: str) -> dict[str, Any]:
    (spec,) = (spec for spec in plan.nodes if spec.name == name)
    return dict(spec.parameters)


def heard(samples: NDArray[np.complex128], level: float = 1e-3, seed: int = 1) -> Any:
    """What arrives of what two antennas send, over a little noise."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((*samples.shape, 2)).view(np.complex128)[..., 0]
    return level * (AIR @ samples + 0.03 * noise)


def frames_in(samples: Any) -> dict[int, bytes]:
    """Frames by slot that a receiver finds in a block, unfaded."""
    found = RECEIVER.receive(SLOTS.cut(AIR @ samples))
    return {n: frame_of(found.bits[n]) for n in np.flatnonzero(found.detected).tolist()}


# The base station -------------------------------------------------------------------------


class Base:
    """The first base station; the test is clock, zone controller and air."""

    name = "/wayside/base1/cbtc"

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        given = parameters(plan, self.name) | changes
        ordered = BACKBONE_DOWN if given["backbone"] else DOWN_TELEGRAMS
        self._clock = graph.sender(CLOCK)
        self._order = graph.sender(ordered, base="base1")
        self._rx = graph.sender(CBTC_BASE_RX, base="base1")
        self.tx = graph.mailbox(CBTC_BASE_TX, raw=True, base="base1")
        self.told = graph.mailbox(UP_TELEGRAMS, base="base1")
        graph.add(
            CbtcBaseStationNode(namespace="/wayside/base1", context=graph.context, parameters=given)
        )
        graph.connect(self.name)

    def sends(self, tick: int) -> Waveform:
        """Start a tick; return what is sent in it."""
        self._clock(clock_to_cdr(tick * TICK_NS))
        self.graph.wait(lambda: len(self.tx) > tick)
        block = Waveform.from_cdr(self.tx[tick])
        assert block.stamp_ns == tick * TICK_NS
        return block

    def order(self, tick: int, *frames: tuple[int, bytes]) -> None:
        self._order(Telegrams(tick * TICK_NS, frames).to_msg())

    def hears(self, tick: int, samples: Any = None) -> tuple[tuple[int, bytes], ...]:
        """Let it hear samples, None for silence; return the frames it tells of."""
        count, radio = len(self.told), (RATE_HZ, 2.45e9, 1)
        block = silence(tick * TICK_NS, *radio)
        if samples is not None:
            block = Waveform(tick * TICK_NS, *radio, samples)
        self._rx(block.to_msg())
        self.graph.wait(lambda: len(self.told) > count)
        telegrams = Telegrams.from_msg(self.told[-1])
        assert telegrams.stamp_ns == tick * TICK_NS
        return telegrams.frames


def test_a_base_station_sends_its_beacon_and_the_frames_of_the_tick_before(
    graph: Any, plan: Plan
) -> None:
    base = Base(graph, plan, power_dbm=10.0)
    block = base.sends(0)
    assert (block.channel, block.carrier_hz, block.sample_rate_hz) == (1, 2.4e9, RATE_HZ)
    assert frames_in(block.samples) == {0: BEACON}
    # 10 dBm of both antennas together, but for the tails of the pulses before and after a burst.
    first, end = SLOTS.span(0)
    power_mw = np.sum(np.mean(np.abs(block.samples[:, first:end]) ** 2, axis=1))
    assert 10.0 * math.log10(power_mw) == pytest.approx(10.0, abs=0.4)
    # Of two frames in a slot the last is sent; a slot that no train has is none.
    base.order(0, (2, FIRST), (2, SECOND), (4, OTHER), (5, OTHER), (0, OTHER))
    assert frames_in(base.sends(1).samples) == {0: BEACON, 2: SECOND, 4: OTHER}
    base.order(1)
    assert frames_in(base.sends(2).samples) == {0: BEACON}


def test_a_base_station_hears_the_trains_in_their_slots(graph: Any, plan: Plan) -> None:
    base = Base(graph, plan)
    assert base.hears(0) == ()
    sent = SLOTS.block({1: FIRST, 3: SECOND})
    assert base.hears(1, heard(sent)) == ((1, FIRST), (3, SECOND))
    # Noise alone is no burst, nor is a burst that no number can be made of.
    assert base.hears(2, heard(np.zeros_like(sent), 1.0)) == ()
    broken = heard(sent)
    broken[:, SLOTS.span(1)[0] + 5] = np.nan
    assert base.hears(3, broken) == ((3, SECOND),)


@pytest.mark.parametrize(("backbone", "owner"), [(False, CONTROLLER), (True, BACKBONE)])
def test_who_brings_the_telegrams_is_named_when_silent(
    graph: Any, plan: Plan, backbone: bool, owner: str
) -> None:
    base = Base(graph, plan, backbone=backbone, timeout_s=0.05)
    base.sends(0)
    assert frames_in(base.sends(1).samples) == {0: BEACON}  # it goes on without
    (failed,) = graph.failed
    assert failed.name == owner
    assert {p.key: p.value for p in failed.values} == {"detected_by": base.name, "time_s": "0.25"}
    base.order(1, (1, FIRST))
    assert frames_in(base.sends(2).samples) == {0: BEACON, 1: FIRST}
    assert len(graph.failed) == 1


def test_a_base_station_that_is_switched_off_is_silent_and_deaf(graph: Any, plan: Plan) -> None:
    base = Base(graph, plan)
    base.sends(0)
    graph.switch(base.name, on=False)
    base.order(0, (1, FIRST))
    assert base.sends(1).silent
    sent = heard(SLOTS.block({1: FIRST}))
    assert base.hears(1, sent) == ()
    graph.switch(base.name, on=True)
    base.order(1, (1, SECOND))
    assert frames_in(base.sends(2).samples) == {0: BEACON, 1: SECOND}
    assert base.hears(2, sent) == ((1, FIRST),)


# The radio on board ----------------------------------------------------------------------


class Radio:
    """The radio of the second train; the test is clock, protection and air."""

    name = "/second/cbtc_radio"

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        given = parameters(plan, self.name) | changes
        self.channels = given["downlink_channels"]
        self._clock = graph.sender(CLOCK)
        self._order = graph.sender(TRAIN_TELEGRAMS, train="second")
        self._rx = {c: graph.sender(CBTC_TRAIN_RX, train="second", channel=c) for c in (1, 2, 3)}
        self.tx = graph.mailbox(CBTC_TRAIN_TX, raw=True, train="second")
        self.told = graph.mailbox(RADIO_TELEGRAMS, train="second")
        self.link = graph.mailbox(RADIO_LINK, train="second")
        graph.add(CbtcRadioNode(namespace="/second", context=graph.context, parameters=given))
        graph.connect(self.name)

    def order(self, tick: int, *frames: tuple[int, bytes]) -> None:
        self._order(Telegrams(tick * TICK_NS, frames).to_msg())

    def sends(self, tick: int) -> Waveform:
        """Start a tick; return what is sent in it."""
        self._clock(clock_to_cdr(tick * TICK_NS))
        self.graph.wait(lambda: len(self.tx) > tick)
        block = Waveform.from_cdr(self.tx[tick])
        assert block.stamp_ns == tick * TICK_NS
        return block

    def hears(
        self,
        tick: int,
        levels: dict[int, float],
        frames: dict[int, bytes] | None = None,
        missing: tuple[int, ...] = (),
    ) -> tuple[tuple[int, bytes], ...]:
        """Let it hear beacons of these levels, with its own frame on some; return its frames."""
        count = len(self.told)
        for channel, send in self._rx.items():
            radio = (RATE_HZ, 2.4e9 + 1e6 * (channel - 1), channel)
            block = silence(tick * TICK_NS, *radio)
            if channel in levels:
                sent = np.zeros((2, 2 * SLOTS.burst.samples), dtype=complex)
                sent[:, : SLOTS.burst.samples] = SLOTS.bursts([BEACON])[0]
                if frames and channel in frames:
                    sent[:, SLOTS.burst.samples :] = SLOTS.bursts([frames[channel]])[0]
                # The noise is of one level: that of the weakest that is still heard well.
                rng = np.random.default_rng([tick, channel])
                noise = rng.standard_normal((*sent.shape, 2)).view(np.complex128)[..., 0]
                samples = levels[channel] * (AIR @ sent) + 1e-5 * noise
                block = Waveform(tick * TICK_NS, *radio, samples)
            if channel not in missing:
                send(block.to_msg())
        self.graph.wait(lambda: len(self.told) > count and len(self.link) > count)
        telegrams = Telegrams.from_msg(self.told[-1])
        assert telegrams.stamp_ns == tick * TICK_NS
        return telegrams.frames

    @property
    def figures(self) -> dict[str, float]:
        return Table.from_msg(self.link[-1]).row("second")


def test_a_radio_takes_its_frame_and_answers_on_the_channel_in_force(
    graph: Any, plan: Plan
) -> None:
    radio = Radio(graph, plan)
    # Before it has heard a base station there is nobody to speak to.
    assert radio.sends(0).silent
    assert radio.hears(0, {2: 1e-3, 3: 3e-4}, {2: FIRST}) == ((2, FIRST),)
    values = radio.figures
    assert (values["channel"], values["bursts"]) == (2.0, 1.0)
    assert values["beacon_snr"] > 100.0
    radio.order(0, (2, SECOND))
    block = radio.sends(1)
    assert (block.channel, block.carrier_hz) == (2, 2.451e9)
    found = RECEIVER.receive(AIR @ block.samples)
    assert frame_of(found.bits) == SECOND
    power_mw = np.sum(np.mean(np.abs(block.samples) ** 2, axis=1))
    assert 10.0 * math.log10(power_mw) == pytest.approx(20.0, abs=0.4)


def test_a_radio_changes_to_a_base_station_that_is_clearly_better(graph: Any, plan: Plan) -> None:
    radio = Radio(graph, plan)
    radio.hears(0, {1: 1e-3, 2: 1e-3})
    before = radio.figures["channel"]
    other = 3.0 - before
    for tick in range(1, 4):
        radio.hears(tick, {1: 1e-3, 2: 1e-3})
        assert radio.figures["channel"] == before
    levels = {int(before): 1e-4, int(other): 1e-3}
    for tick in range(4, 12):
        radio.hears(tick, levels)
    assert radio.figures["channel"] == other
    # In silence the last one stays.
    for tick in range(12, 16):
        assert radio.hears(tick, {}) == ()
    assert (radio.figures["channel"], radio.figures["beacon_snr"]) == (other, 0.0)
    told = [message for _, message in graph.told(": radio")]
    assert told == ["hears a base station", "hears no base station"]


def test_protection_that_is_silent_is_named_and_the_radio_goes_on(graph: Any, plan: Plan) -> None:
    radio = Radio(graph, plan, timeout_s=0.05)
    radio.sends(0)
    radio.hears(0, {1: 1e-3})
    assert radio.sends(1).silent
    assert [(f.name, f.values[0].value) for f in graph.failed] == [("/second/atp", radio.name)]
    radio.order(1, (2, FIRST))
    assert not radio.sends(2).silent
    assert len(graph.failed) == 1


def test_a_radio_that_is_switched_off_neither_sends_nor_hears(graph: Any, plan: Plan) -> None:
    radio = Radio(graph, plan)
    radio.sends(0)
    radio.hears(0, {1: 1e-3}, {1: FIRST})
    graph.switch(radio.name, on=False)
    radio.order(0, (2, FIRST))
    assert radio.sends(1).silent
    assert radio.hears(1, {1: 1e-3}, {1: FIRST}) == ()
    assert radio.figures["beacon_snr"] == radio.figures["bursts"] == 0.0
    graph.switch(radio.name, on=True)
    radio.order(1, (2, SECOND))
    radio.sends(2)
    assert radio.hears(2, {1: 1e-3}, {1: FIRST}) == ((2, FIRST),)
    radio.order(2, (2, SECOND))
    assert frame_of(RECEIVER.receive(AIR @ radio.sends(3).samples).bits) == SECOND


# The medium ------------------------------------------------------------------------------


class Air:
    """The medium; the test is the world, all base stations and all trains."""

    def __init__(self, graph: Any, plan: Plan, **changes: Any) -> None:
        self.graph = graph
        described = plan.world.part("train_radio", CbtcDescription)
        self.bases = [base.name for base in described.base_stations]
        self.feet_m = {base.name: base.chainage_m for base in described.base_stations}
        self.channel = {base.name: base.channel for base in described.base_stations}
        self.trains = described.trains
        self._state = graph.sender(STATE)
        self._down = {b: graph.sender(CBTC_BASE_TX, base=b) for b in self.bases}
        self._up = {t: graph.sender(CBTC_TRAIN_TX, train=t) for t in self.trains}
        channels = sorted(described.downlink_hz)
        self.at_train = {
            (t, c): graph.mailbox(CBTC_TRAIN_RX, raw=True, train=t, channel=c)
            for t in self.trains
            for c in channels
        }
        self.at_base = {b: graph.mailbox(CBTC_BASE_RX, raw=True, base=b) for b in self.bases}
        self.links = graph.mailbox(CBTC_LINKS)
        self.done = graph.mailbox(DONE, raw=True, node=MEDIUM)
        given = parameters(plan, MEDIUM) | changes
        graph.add(CbtcMediumNode(context=graph.context, parameters=given))
        graph.connect(MEDIUM)

    def tick(
        self,
        tick: int,
        places_m: dict[str, float],
        down: dict[str, Any] | None = None,
        up: dict[str, tuple[int, Any]] | None = None,
        missing: tuple[str, ...] = (),
    ) -> None:
        """Play a tick: the trains named are on the line at these places; the others are not."""
        stamp_ns, down, up = tick * TICK_NS, down or {}, up or {}
        values = np.zeros((len(self.trains), len(STATE.columns)))
        for row, train in enumerate(self.trains):
            if train in places_m:
                pose = TRACK.pose(places_m[train])
                place = {"x_m": pose.x_m, "y_m": pose.y_m, "z_m": pose.z_m, "on_line": 1.0}
                for name, value in (place | {"chainage_m": places_m[train]}).items():
                    values[row, STATE.index[name]] = float(value)
        self._state(TableWriter(self.trains, STATE.columns).write(stamp_ns, values))
        for base, send in self._down.items():
            radio = (RATE_HZ, 2.4e9, self.channel[base])
            block = silence(stamp_ns, *radio)
            if base in down:
                block = Waveform(stamp_ns, *radio, down[base])
            if base not in missing:
                send(block.to_msg())
        for train, send in self._up.items():
            channel, samples = up.get(train, (1, None))
            block = silence(stamp_ns, RATE_HZ, 2.45e9, channel)
            if samples is not None:
                block = Waveform(stamp_ns, RATE_HZ, 2.45e9, channel, samples)
            if train not in missing:
                send(block.to_msg())
        boxes = (*self.at_train.values(), *self.at_base.values(), self.links, self.done)
        self.graph.wait(lambda: all(len(box) > tick for box in boxes))
        assert to_ns(deserialize_message(self.done[-1], Header).stamp) == stamp_ns

    def train_hears(self, train: str, channel: int) -> Waveform:
        return Waveform.from_cdr(self.at_train[train, channel][-1])

    def base_hears(self, base: str) -> Waveform:
        return Waveform.from_cdr(self.at_base[base][-1])


def strong(frames: dict[int, bytes]) -> NDArray[np.complex128]:
    """A block of 20 dBm."""
    return np.asarray(10.0 * math.sqrt(2.0) * SLOTS.block(frames))


def test_the_air_carries_frames_both_ways_where_they_can_be_heard(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    base = air.bases[0]
    channel, near_m = air.channel[base], air.feet_m[base] + 60.0
    burst = 10.0 * math.sqrt(2.0) * SLOTS.bursts([SECOND])[0]
    far_m = air.feet_m[air.bases[-1]]
    air.tick(
        0,
        {"first": near_m, "second": near_m + 40.0, "third": far_m},
        {base: strong({0: BEACON, 1: FIRST, 2: OTHER})},
        {"first": (channel, burst), "third": (channel, burst)},
    )
    # Each hears the beacon and its own slot, not that of the other.
    for train, frame in (("first", FIRST), ("second", OTHER)):
        block = air.train_hears(train, channel)
        assert block.samples.shape == (2, 2 * SLOTS.burst.samples)
        found = RECEIVER.receive(SLOTS.cut(block.samples))
        assert [frame_of(bits) for bits in found.bits] == [BEACON, frame]
    # 4 km away there is nothing of it, nor for who is off the line.
    assert far_m - near_m > 3000.0
    for train in ("third", "fourth"):
        found_block = air.train_hears(train, channel)
        if not found_block.silent:
            assert not RECEIVER.receive(SLOTS.cut(found_block.samples)).detected.any()
    assert air.train_hears("fourth", channel).silent
    up = air.base_hears(base)
    found = RECEIVER.receive(SLOTS.cut(up.samples))
    assert found.detected.tolist() == [False, True, False, False, False]
    assert frame_of(found.bits[1]) == SECOND
    # The truth of the links: the nearest base station, and so many dB less where it is farther.
    table = Table.from_msg(air.links[-1])
    assert table.row("first")["base_index"] == 0.0
    assert table.row("third")["base_index"] == len(air.bases) - 1
    assert table.row("first")["snr_down"] > table.row("second")["snr_down"] > 1e3
    assert table.row("fourth")["snr_down"] == 0.0


def test_in_silence_nothing_arrives_but_noise(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    air.tick(0, {"first": air.feet_m[air.bases[0]]})
    for base in air.bases:
        assert air.base_hears(base).silent
    channel = air.channel[air.bases[0]]
    block = air.train_hears("first", channel)
    # k T F over the sample rate, 8 dB of noise figure.
    noise_mw = 10.0 ** ((-173.975 + 8.0) / 10.0) * RATE_HZ
    assert np.mean(np.abs(block.samples) ** 2) == pytest.approx(noise_mw, rel=0.1)
    assert not RECEIVER.receive(SLOTS.cut(block.samples)).detected.any()


def test_who_sends_nothing_is_named_and_the_tick_goes_on(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan, timeout_s=0.05)
    base = air.bases[0]
    places_m = {"first": air.feet_m[base] + 60.0}
    sent = {base: strong({0: BEACON, 1: FIRST})}
    silent = (air.bases[1], "third")
    air.tick(0, places_m, sent, missing=silent)
    assert sorted(f.name for f in graph.failed) == [
        "/third/cbtc_radio",
        f"/wayside/{air.bases[1]}/cbtc",
    ]
    assert not air.train_hears("first", air.channel[base]).silent
    # They are not waited for any more, and again as soon as they are heard.
    air.tick(1, places_m, sent, missing=silent)
    air.tick(2, places_m, sent)
    assert len(graph.failed) == 2


@pytest.mark.parametrize(
    ("kind", "wrong", "line"),
    [
        (CbtcRadioNode, {"uplink_carriers_hz": (2.45e9,)}, "uplink_carriers_hz"),
        (CbtcRadioNode, {"slot": 0}, "slot"),
        (CbtcRadioNode, {"power_dbm": math.nan}, "power_dbm"),
        (CbtcBaseStationNode, {"timeout_s": -1.0}, "timeout_s"),
        (CbtcBaseStationNode, {"samples_per_symbol": 1}, "samples_per_symbol"),
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, kind: Any, wrong: Any, line: str) -> None:
    with pytest.raises(ParameterError, match=line) as caught:
        kind(context=graph.context, parameters=wrong, services=False)
    assert "\n" not in str(caught.value)
