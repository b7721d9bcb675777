"""The vehicle station as a node: returns the tone on the pair in force, or keeps quiet."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.table import Table
from rail_msgs_py.topics.ranging import VRS_CHANNEL, VRS_RX, VRS_TX
from rail_msgs_py.waveform import Waveform, silence
from rail_onboard.ranging.vrs_node import VrsNode
from rail_signals.ranging.receiver import FmToneReceiver
from rail_signals.ranging.signal import RangingSignal, modulate

SIGNAL = RangingSignal()
TICK_NS = 100_000_000
DELAY_S = 1e-6
CARRIERS_HZ = {1: 2.4e9, 2: 2.405e9, 3: 2.41e9, 4: 2.415e9}
NOISE_MW = 1e-10


class Vehicle:
    """A vehicle station on the bench, with downlink channels 1 and 3."""

    def __init__(self, graph: Any, **parameters: Any) -> None:
        self.graph = graph
        self._rng = np.random.default_rng(1)
        self.tx = graph.mailbox(VRS_TX, raw=True, train="train_1")
        self.channels = graph.mailbox(VRS_CHANNEL, train="train_1")
        self.rx = {c: graph.sender(VRS_RX, train="train_1", channel=c) for c in (1, 3)}
        self.node = graph.add(VrsNode(context=graph.context, parameters=parameters))
        graph.connect("/train_1/vrs")

    def answer(
        self, tick: int, levels_dbm: dict[int, float], lag_rad: float = 0.4, order: int = 1
    ) -> Waveform:
        """Return what it sends when it hears these channels; the others are silent."""
        count = len(self.tx), len(self.channels)
        for channel in sorted(self.rx)[::order]:
            radio = (SIGNAL.sample_rate_hz, CARRIERS_HZ[channel], channel)
            block = silence(tick * TICK_NS, *radio)
            if channel in levels_dbm:
                amplitude = 10.0 ** (levels_dbm[channel] / 20.0)
                noise = self._rng.standard_normal((SIGNAL.samples, 2)).view(np.complex128)[:, 0]
                samples = amplitude * modulate(SIGNAL, [lag_rad])
                samples += noise * math.sqrt(NOISE_MW / 2.0)
                block = Waveform(tick * TICK_NS, *radio, samples[None, :])
            self.rx[channel](block.to_cdr())
        self.graph.wait(lambda: len(self.tx) > count[0] and len(self.channels) > count[1])
        return Waveform.from_cdr(self.tx[-1])

    @property
    def table(self) -> Table:
        """Channels and levels of the last tick."""
        return Table.from_msg(self.channels[-1])

    def change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert self.graph.call(ChangeState, "/train_1/vrs/change_state", request).success


@pytest.mark.parametrize("trim_s", [0.0, -3e-9])
def test_it_returns_the_tone_a_delay_later(graph: Any, trim_s: float) -> None:
    vehicle = Vehicle(graph, delay_trim_s=trim_s, power_dbm=-10.0)
    reply = vehicle.answer(3, {1: -50.0}, lag_rad=0.4)
    assert (reply.stamp_ns, reply.channel, reply.carrier_hz) == (3 * TICK_NS, 2, 2.405e9)
    assert reply.power_dbm == pytest.approx(-10.0, abs=1e-6)
    lag_rad = FmToneReceiver(SIGNAL).estimate(reply.samples[0]).phase_lag_rad[0]
    # -50 dBm over -100 dBm of noise: 0.1 mrad.
    assert lag_rad == pytest.approx(0.4 + 2 * math.pi * 375e3 * (DELAY_S + trim_s), abs=1e-3)


def test_it_follows_the_stronger_channel_whatever_comes_first(graph: Any) -> None:
    vehicle = Vehicle(graph)
    assert vehicle.answer(0, {1: -50.0, 3: -80.0}).channel == 2
    assert vehicle.answer(1, {1: -80.0, 3: -50.0}, order=-1).channel == 4
    assert vehicle.answer(2, {1: -50.0, 3: -51.0}).channel == 4
    row = vehicle.table.row("train_1")
    assert (row["downlink"], row["uplink"]) == (3.0, 4.0)
    assert row["level_1_dbm"] == pytest.approx(-50.0, abs=0.1)
    assert row["level_3_dbm"] == pytest.approx(-51.0, abs=0.1)
    assert vehicle.table.stamp_ns == 2 * TICK_NS


def test_hearing_nothing_it_keeps_quiet_and_on_its_channel(graph: Any) -> None:
    vehicle = Vehicle(graph)
    assert vehicle.answer(0, {}).silent
    assert vehicle.table.row("train_1")["downlink"] == 0.0
    assert not vehicle.answer(1, {3: -50.0}).silent
    quiet = vehicle.answer(2, {})
    assert (quiet.silent, quiet.channel) == (True, 4)
    row = vehicle.table.row("train_1")
    assert (row["downlink"], row["level_3_dbm"]) == (3.0, -math.inf)


def test_noise_alone_is_not_returned(graph: Any) -> None:
    vehicle = Vehicle(graph)
    for tick in range(5):
        assert vehicle.answer(tick, {1: -200.0, 3: -200.0}).silent


def test_switched_off_by_the_lifecycle_service_it_answers_with_silence(graph: Any) -> None:
    vehicle = Vehicle(graph)
    assert not vehicle.answer(0, {1: -50.0}).silent
    vehicle.change(Transition.TRANSITION_DEACTIVATE)
    off = vehicle.answer(1, {1: -50.0})
    assert (off.silent, off.stamp_ns) == (True, TICK_NS)
    vehicle.change(Transition.TRANSITION_ACTIVATE)
    assert not vehicle.answer(2, {1: -50.0}).silent


@pytest.mark.parametrize(
    "parameters",
    [
        {"uplink_channels": (2,)},
        {"uplink_carriers_hz": (2.4e9, 2.405e9, 2.41e9)},
        {"delay_trim_s": math.nan},
        {"power_dbm": "loud"},
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, parameters: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"^vrs: \w+: ") as caught:
        VrsNode(context=graph.context, parameters=parameters, services=False)
    assert "\n" not in str(caught.value)
