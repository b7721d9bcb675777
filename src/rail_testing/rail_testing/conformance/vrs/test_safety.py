"""Safety of the vehicle station: what a wayside station would range wrongly by."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
import pytest

from rail_msgs_py.topics.ranging import VRS_RX, VRS_TX
from rail_msgs_py.waveform import HEADER_VALUES, Waveform
from rail_testing.conformance.bench import Bench
from rail_testing.conformance.vrs.kind import KIND

REQUIREMENT = pytest.mark.requirement


@REQUIREMENT("S0 fig 7, channels by zone")
def test_it_answers_on_the_channel_of_its_zone_only(bench: Bench) -> None:
    """Through four zones: each answer is on the pair of the strongest station."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    channels = set()

    def note() -> str:
        reply = KIND.reply(bench)
        if not reply.silent:
            channels.add(reply.channel)
        return ""

    bench.run(50.0, note)
    if len(channels) < 2:
        bench.refuse(f"has answered on channels {sorted(channels)} through four zones")


@REQUIREMENT("S0 eq 12 and erratum: the delay of the transponder, calibrated")
def test_its_delay_is_that_of_its_calibration(bench: Bench) -> None:
    """The phase of each answer against that received: the calibrated delay, to 20 ns and noise."""
    bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    bench.run(15.0)


@REQUIREMENT("DESIGN, What a claim is")
def test_without_a_station_it_is_silent(bench: Bench) -> None:
    """Receiver noise alone, of any level, is no station: nothing is sent."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    generator = np.random.default_rng(2)

    def noise(message: Any) -> Any:
        block = Waveform.from_msg(message)
        data = np.array(message.data)
        level = 10.0 ** (generator.uniform(-110.0, -40.0) / 20.0)
        if block.silent:
            count = int(bench.parameters["samples"])
            samples = generator.standard_normal((1, count)) + 0j
            head = (block.stamp_ns, block.sample_rate_hz, block.carrier_hz, block.channel)
            return Waveform(*head, level * samples).to_msg()
        data[HEADER_VALUES:] = level * generator.standard_normal(data.size - HEADER_VALUES)
        message.data = array.array("d", data.tobytes())
        return message

    for channel in bench.parameters["downlink_channels"]:
        c.intercept(VRS_RX.name(train=bench.place, channel=channel), noise)
    bench.run(bench.tick_s, claims=False)
    bench.run(20.0, lambda: KIND.believes_garbage(bench), claims=False)


@REQUIREMENT("S0, two stations on one channel")
def test_a_jammed_tone_is_not_returned(bench: Bench) -> None:
    """A second signal of the same strength on each channel: no answer that is wrong by more."""
    c = bench.start()
    bench.run_until_working(KIND.starts_within_s, "after the start")
    generator = np.random.default_rng(3)

    def jam(message: Any) -> Any:
        block = Waveform.from_msg(message)
        if block.silent:
            return message
        data = np.array(message.data)
        power = float(np.sqrt(np.mean(data[HEADER_VALUES:] ** 2)))
        jamming = 3.0 * power * generator.standard_normal(data.size - HEADER_VALUES)
        data[HEADER_VALUES:] += jamming
        message.data = array.array("d", data.tobytes())
        return message

    for channel in bench.parameters["downlink_channels"]:
        c.intercept(VRS_RX.name(train=bench.place, channel=channel), jam)
    sent = c.topic(VRS_TX.name(train=bench.place))

    def answers() -> str:
        strong = any(level > -90.0 for level in KIND.levels(bench).values())
        if sent.latest.silent or not strong:
            return ""
        return "answers on a channel that is jammed by 10 dB more than the signal"

    bench.run(bench.tick_s, claims=False)
    bench.run(15.0, answers, claims=False)
