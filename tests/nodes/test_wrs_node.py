"""The wayside station as a node: what it sends, what it makes of what it receives."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from rail_msgs_py.parameters import ParameterError
from rail_msgs_py.ranging.range_reading import RangeReading
from rail_msgs_py.stamps import clock_to_cdr
from rail_msgs_py.topics.ranging import RANGE, WRS_RX, WRS_TX
from rail_msgs_py.topics.tick import CLOCK
from rail_msgs_py.waveform import Waveform, silence
from rail_signals.ranging.phase_range import range_to_phase_rad
from rail_signals.ranging.signal import RangingSignal, modulate
from rail_wayside.ranging.wrs_node import WrsNode

SIGNAL = RangingSignal()
TICK_NS = 100_000_000
RADIO = (SIGNAL.sample_rate_hz, 2.405e9, 2)
PLACE = {"site": "wrs1", "zone": "zone1"}


def returned(stamp_ns: int, range_m: float) -> bytes:
    """Return the block that a train that far away would cause."""
    lag = [float(range_to_phase_rad(range_m, SIGNAL.tones_hz[0], delay_s=1e-6))]
    return Waveform(stamp_ns, *RADIO, 1e-3 * modulate(SIGNAL, lag)[None, :]).to_cdr()


class Station:
    """A station on the bench: its ports in the hands of the test."""

    def __init__(self, graph: Any, **parameters: Any) -> None:
        self.graph = graph
        self.tx = graph.mailbox(WRS_TX, raw=True, **PLACE)
        self.ranges = graph.mailbox(RANGE, raw=True, **PLACE)
        self.clock = graph.sender(CLOCK)
        self.rx = graph.sender(WRS_RX, **PLACE)
        self.node = graph.add(WrsNode("wrs1", context=graph.context, parameters=parameters))
        graph.connect("/wayside/wrs1")

    def sent(self, stamp_ns: int) -> Waveform:
        """Return what it sends in a tick."""
        count = len(self.tx)
        self.clock(clock_to_cdr(stamp_ns))
        self.graph.wait(lambda: len(self.tx) > count)
        assert len(self.tx) == count + 1
        return Waveform.from_cdr(self.tx[-1])

    def reading(self, raw: bytes) -> RangeReading:
        """Return what it makes of a received block."""
        count = len(self.ranges)
        self.rx(raw)
        self.graph.wait(lambda: len(self.ranges) > count)
        return RangeReading.from_cdr(self.ranges[-1])

    def change(self, transition: int) -> None:
        request = ChangeState.Request(transition=Transition(id=transition))
        assert self.graph.call(ChangeState, "/wayside/wrs1/change_state", request).success


def test_it_answers_the_clock_with_its_tone(graph: Any) -> None:
    station = Station(graph, power_dbm=3.0)
    for tick in (0, 1, 2):
        block = station.sent(tick * TICK_NS)
        assert (block.stamp_ns, block.channel, block.carrier_hz) == (tick * TICK_NS, 1, 2.4e9)
        assert block.power_dbm == pytest.approx(3.0)
        expected = 10.0 ** (3.0 / 20.0) * modulate(SIGNAL, [0.0])
        assert np.allclose(block.samples[0], expected, rtol=0.0, atol=1e-6)


def test_it_ranges_what_it_receives(graph: Any) -> None:
    station = Station(graph)
    for tick, range_m in enumerate((12.5, 123.0, 250.0)):
        reading = station.reading(returned(tick * TICK_NS, range_m))
        assert (reading.stamp_ns, reading.zone) == (tick * TICK_NS, "zone1")
        assert reading.range_m == pytest.approx(range_m, abs=1e-3)
        assert 0.0 < reading.variance_m2 < 0.01
    assert reading.max_range_m - reading.min_range_m == pytest.approx(399.72, abs=0.01)
    assert station.reading(silence(4 * TICK_NS, *RADIO).to_cdr()).range_m == math.inf


def test_a_jammed_channel_is_told_on_diagnostics(graph: Any) -> None:
    station = Station(graph)
    rng = np.random.default_rng(1)
    noise = 1e-3 * rng.standard_normal((1, SIGNAL.samples, 2)).view(np.complex128)[..., 0]
    reading = station.reading(Waveform(0, *RADIO, noise).to_cdr())
    assert reading.disturbed

    def told() -> list[Any]:
        statuses = [status for array in graph.diagnostics for status in array.status]
        return [s for s in statuses if s.name == "/wayside/wrs1: zone1" and "jammed" in s.message]

    graph.wait(told)
    assert told()[0].level == DiagnosticStatus.WARN


def test_switched_off_by_the_lifecycle_service_it_is_silent(graph: Any) -> None:
    station = Station(graph)
    assert not station.sent(0).silent
    station.change(Transition.TRANSITION_DEACTIVATE)
    off = station.sent(TICK_NS)
    assert (off.silent, off.stamp_ns, off.channel) == (True, TICK_NS, 1)
    assert station.reading(returned(TICK_NS, 100.0)).range_m == math.inf
    station.change(Transition.TRANSITION_ACTIVATE)
    assert not station.sent(2 * TICK_NS).silent
    assert station.reading(returned(2 * TICK_NS, 100.0)).usable
    messages = [s.message for array in graph.diagnostics for s in array.status]
    assert "switched off" in messages


@pytest.mark.parametrize(
    "parameters",
    [
        {"zones": ("z1", "z2")},
        {"downlink_channels": (1, 3)},
        {"comparator": "xor"},
        {"power_dbm": math.nan},
        {"power_dbm": 61.0},
        {"samples": 7},
        {"uplink_channels": (0,)},
        {"delay_s": "1 us"},
    ],
)
def test_wrong_parameters_are_one_line(graph: Any, parameters: dict[str, Any]) -> None:
    with pytest.raises(ParameterError) as caught:
        WrsNode("wrs1", context=graph.context, parameters=parameters, services=False)
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("wrs1: ")


@pytest.mark.parametrize(
    "parameters", [{"samples": 961}, {"tones_hz": (375e3, 400e3)}, {"sample_rate_hz": 5e5}]
)
def test_parameters_that_make_no_signal_name_the_field(
    graph: Any, parameters: dict[str, Any]
) -> None:
    with pytest.raises(ValueError, match="must"):
        WrsNode("wrs1", context=graph.context, parameters=parameters, services=False)
