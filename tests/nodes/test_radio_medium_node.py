"""The radio medium as a node: two passes in one tick, and nodes that do not answer."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rail_corridor.equipment.ranging.nodes import MEDIUM
from rail_corridor.loading.loader import load_scenario
from rail_corridor.plan.plan import Plan, make_plan
from rail_msgs_py.failures import failure
from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.stamps import clock_from_cdr
from rail_msgs_py.table import Table
from rail_msgs_py.topics.ranging import LINKS, VRS_RX, VRS_TX, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import DONE, FAILED
from rail_msgs_py.topics.world import STATE
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_world.ranging.description import RadioDescription
from rail_world.ranging.medium_node import RadioMediumNode

SIGNAL = RangingSignal()
TICK_NS = 100_000_000
C_MPS = 299_792_458.0
CARRIERS_HZ = {1: 2.4e9, 2: 2.405e9, 3: 2.41e9, 4: 2.415e9}
#: Trains of the plain line: one.
TRAIN = "train_a"


class Air:
    """The medium of the plain line; the test is the world and all equipment."""

    def __init__(self, graph: Any, plan: Plan, timeout_s: float = 20.0) -> None:
        self.graph = graph
        self.stations = plan.world.part("ranging", RadioDescription).stations
        self._state = graph.sender(STATE)
        parts = [{"site": s.site, "zone": s.zone} for s in self.stations]
        self._down = [graph.sender(WRS_TX, **part) for part in parts]
        self._up = graph.sender(VRS_TX, train=TRAIN)
        self.to_train = {c: graph.mailbox(VRS_RX, raw=True, train=TRAIN, channel=c) for c in (1, 3)}
        self.to_station = [graph.mailbox(WRS_RX, raw=True, **part) for part in parts]
        self.links = graph.mailbox(LINKS)
        self.done = graph.mailbox(DONE, raw=True, node=MEDIUM)
        (spec,) = (spec for spec in plan.nodes if spec.name == MEDIUM)
        parameters = {**spec.parameters, "timeout_s": timeout_s}
        graph.add(RadioMediumNode(context=graph.context, parameters=parameters))
        graph.connect(MEDIUM)

    def move(self, tick: int, chainage_m: float, on_line: float = 1.0) -> None:
        """Publish where the train is; the plain line runs east along the x axis."""
        row = dict.fromkeys(STATE.columns, 0.0)
        row |= {"path_m": chainage_m, "x_m": chainage_m, "on_line": on_line}
        row["chainage_m"] = chainage_m
        values = np.array([[row[column] for column in STATE.columns]])
        self._state(Table(tick * TICK_NS, (TRAIN,), STATE.columns, values).to_msg())

    def call(self, tick: int, zones: tuple[str, ...] | None = None, quiet: bool = False) -> None:
        """Send the block of every station, or of these zones."""
        for station, send in zip(self.stations, self._down, strict=True):
            if zones is None or station.zone in zones:
                send(self._block(tick, station.downlink_channel, quiet=quiet))

    def answer(self, tick: int, channel: int, quiet: bool = False) -> None:
        """Send the block of the train."""
        self._up(self._block(tick, channel, quiet=quiet))

    def _block(self, tick: int, channel: int, *, quiet: bool) -> bytes:
        radio = (SIGNAL.sample_rate_hz, CARRIERS_HZ[channel], channel)
        if quiet:
            return silence(tick * TICK_NS, *radio).to_cdr()
        samples = math.sqrt(0.1) * modulate(SIGNAL, [0.0])
        return Waveform(tick * TICK_NS, *radio, samples[None, :]).to_cdr()

    def at_train(self, ticks: int) -> dict[int, Waveform]:
        self.graph.wait(lambda: all(len(box) >= ticks for box in self.to_train.values()))
        return {c: Waveform.from_cdr(box[ticks - 1]) for c, box in self.to_train.items()}

    def at_stations(self, ticks: int) -> dict[str, Waveform]:
        self.graph.wait(
            lambda: (
                all(len(box) >= ticks for box in self.to_station)
                and min(len(self.done), len(self.links)) >= ticks
            )
        )
        return {
            station.zone: Waveform.from_cdr(box[ticks - 1])
            for station, box in zip(self.stations, self.to_station, strict=True)
        }


@pytest.fixture
def plan(tmp_path: Path) -> Plan:
    return make_plan(load_scenario("plain_line"), tmp_path)


def one_way_m(block: Waveform) -> float:
    lag_rad = FmToneReceiver(SIGNAL).estimate(block.samples[0]).phase_lag_rad[0]
    return float(lag_rad) * C_MPS / (2.0 * math.pi * SIGNAL.tones_hz[0])


def test_a_tick_there_and_back(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    air.move(0, 150.0)
    air.call(0)
    heard = air.at_train(1)
    expected_m = math.dist(air.stations[0].position_m, (150.0, 0.0, 0.0))
    assert heard[1].channel == 1
    assert heard[1].power_dbm > heard[3].power_dbm + 20.0
    assert one_way_m(heard[1]) == pytest.approx(expected_m, abs=0.5)
    air.answer(0, 2)
    received = air.at_stations(1)
    assert one_way_m(received["zone1"]) == pytest.approx(expected_m, abs=0.5)
    assert all(block.stamp_ns == 0 for block in received.values())
    # The train sends on channel 2; the stations of channel 4 hear nothing.
    assert received["zone2"].silent
    assert clock_from_cdr(air.done[0]) == 0
    links = Table.from_msg(air.links[0]).row(TRAIN)
    assert (links["downlink_channel"], links["uplink_channel"]) == (1.0, 2.0)
    assert links["snr_down"] == pytest.approx(links["snr_up"], rel=0.01)
    assert links["snr_down"] > 100.0


def test_every_port_gets_a_block_even_in_silence(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    air.move(0, 150.0)
    air.call(0, quiet=True)
    assert all(block.silent for block in air.at_train(1).values())
    air.answer(0, 2, quiet=True)
    assert all(block.silent for block in air.at_stations(1).values())
    assert np.all(Table.from_msg(air.links[0]).values == 0.0)


def test_a_train_that_is_off_the_line_is_not_heard(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    air.move(0, 150.0, on_line=0.0)
    air.call(0)
    assert all(block.silent for block in air.at_train(1).values())
    air.answer(0, 2)
    assert all(block.silent for block in air.at_stations(1).values())


def test_a_silent_node_is_named_and_the_corridor_goes_on(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan, timeout_s=0.05)
    every = tuple(station.zone for station in air.stations)
    air.move(0, 150.0)
    air.call(0, zones=every[:-1])
    assert not air.at_train(1)[1].silent
    missing = f"/wayside/{air.stations[-1].site}"
    assert [status.name for status in graph.failed] == [missing]
    # The train does not answer either.
    air.at_stations(1)
    assert [status.name for status in graph.failed] == [missing, f"/{TRAIN}/vrs"]
    values = {(pair.key, pair.value) for status in graph.failed for pair in status.values}
    assert values == {("detected_by", MEDIUM), ("time_s", "0.0")}
    # Neither is waited for from now on...
    air.move(1, 152.0)
    air.call(1, zones=every[:-1])
    air.at_stations(2)
    assert len(graph.failed) == 2
    # ... until they are heard again; what came too late counts for nothing else.
    air.answer(1, 2)
    air.move(2, 154.0)
    air.call(2)
    air.at_train(3)
    air.answer(2, 2)
    assert not air.at_stations(3)["zone1"].silent
    assert len(graph.failed) == 2


def test_who_is_named_failed_by_others_is_not_waited_for(graph: Any, plan: Plan) -> None:
    air = Air(graph, plan)
    every = tuple(station.zone for station in air.stations)
    tell = graph.sender(FAILED)
    air.move(0, 250.0)
    air.call(0, zones=every[1:])
    tell(failure(f"/wayside/{air.stations[0].site}", "process killed by SIGKILL", "a test"))
    heard = air.at_train(1)
    # Station 1 is gone, and the next one on its channel looks the other way.
    assert heard[1].silent
    assert not heard[3].silent


def test_a_missing_world_file_is_an_error(graph: Any, tmp_path: Path) -> None:
    parameters = {"world_file": str(tmp_path / "none.json")}
    with pytest.raises(ParameterError, match=r"radio_medium: world_file: .*none\.json': No such"):
        RadioMediumNode(context=graph.context, parameters=parameters, services=False)
